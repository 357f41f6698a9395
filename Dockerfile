# Headimpact in two stages: the first installs the locked dependencies and builds the wheel, the second only runs them.
#
#   docker build --tag headimpact .
#   docker run --rm --read-only --publish 8000:8000 --volume headimpact:/data headimpact
#
# docs/operations.md says what the volume holds, how it is backed up, and how keys are made.

FROM python:3.11-slim-trixie AS build

ENV PIP_DISABLE_PIP_VERSION_CHECK=1 PIP_NO_CACHE_DIR=1 PIP_ROOT_USER_ACTION=ignore
WORKDIR /build

# The environment that is copied holds no pip; the image's own fills it, by hash and from wheels only. The locks are
# complete: without --no-deps pip would ask for a pin of each extra that a package names beside the package's own.
COPY requirements.lock requirements-build.lock ./
RUN python -m venv --without-pip /opt/headimpact \
    && pip --python /opt/headimpact/bin/python install --no-deps --require-hashes --only-binary :all: --requirement requirements.lock \
    && pip install --no-deps --require-hashes --only-binary :all: --requirement requirements-build.lock

COPY LICENSE README.md pyproject.toml ./
COPY migrations migrations
COPY models models
COPY service service
RUN pip wheel --no-index --no-deps --no-build-isolation --wheel-dir /build/dist . \
    && pip --python /opt/headimpact/bin/python install --no-index --no-deps /build/dist/*.whl \
    && pip --python /opt/headimpact/bin/python check


FROM python:3.11-slim-trixie

# SQLite before 3.51.3 can corrupt a file when two connections reset its write-ahead log at the same moment, and Debian
# trixie carries 3.46. This one library comes from the next release, which must not bring anything else with it:
# priority -1 refuses every other package of forky, so that the build fails rather than mixes.
RUN sed '/^$/,$d; s/^Suites:.*/Suites: forky/' /etc/apt/sources.list.d/debian.sources \
        > /etc/apt/sources.list.d/forky.sources \
    && printf 'Package: *\nPin: release n=forky\nPin-Priority: -1\n\nPackage: libsqlite3-0\nPin: release n=forky\nPin-Priority: 990\n' \
        > /etc/apt/preferences.d/forky \
    && apt-get update \
    && apt-get install --yes --no-install-recommends libsqlite3-0 \
    && rm -rf /var/lib/apt/lists/* /etc/apt/sources.list.d/forky.sources /etc/apt/preferences.d/forky \
    && python -c "import sqlite3; assert sqlite3.sqlite_version_info >= (3, 51, 3), sqlite3.sqlite_version"

COPY --from=build /opt/headimpact /opt/headimpact
RUN install --directory --owner 10001 --group 10001 --mode 0700 /data

# The root may be read-only: the database, and beside it the uploads that wait for a job, are all that is written.
ENV PATH=/opt/headimpact/bin:$PATH \
    PYTHONDONTWRITEBYTECODE=1 \
    PYTHONUNBUFFERED=1 \
    HEADIMPACT_DATABASE_URL=sqlite:////data/headimpact.db \
    HEADIMPACT_HOST=0.0.0.0 \
    HEADIMPACT_PORT=8000

USER 10001:10001
WORKDIR /data
VOLUME /data
EXPOSE 8000

HEALTHCHECK --interval=10s --timeout=5s --start-period=30s --retries=3 \
    CMD ["python", "-c", "import os, urllib.request as u; u.build_opener(u.ProxyHandler({})).open('http://127.0.0.1:' + os.environ['HEADIMPACT_PORT'] + '/livez', timeout=4)"]

ENTRYPOINT ["headimpact"]
CMD ["serve"]
