"""The container file and the locks that it installs: what can be held to the project without a container engine."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import threading
import tomllib
from collections.abc import Iterator
from contextlib import contextmanager
from fnmatch import fnmatch
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from importlib.metadata import requires, version

import pytest
from documents import ROOT, text
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from headimpact_service.settings import Settings
from headimpact_service.store.sqlite import WAL_RESET_FIXED

PYPROJECT = tomllib.loads(text("pyproject.toml"))
LOCKS = ["requirements.lock", "requirements-build.lock"]


# The locks


def locked(name: str) -> dict[Requirement, list[str]]:
    """Each requirement of a lock file with its hashes."""
    lines = [line.strip() for line in text(name).replace("\\\n", "").splitlines()]
    entries = [line.split("--hash=") for line in lines if line and not line.startswith("#")]
    return {Requirement(head.strip()): [part.strip() for part in hashes] for head, *hashes in entries}


@pytest.mark.parametrize("lock", LOCKS)
def test_every_requirement_of_a_lock_has_one_exact_version_and_its_hashes(lock: str) -> None:
    for requirement, hashes in locked(lock).items():
        assert [part.operator for part in requirement.specifier] == ["=="], requirement
        assert hashes, requirement
        assert all(re.fullmatch(r"sha256:[0-9a-f]{64}", digest) for digest in hashes), requirement


@pytest.mark.parametrize("lock", LOCKS)
def test_a_lock_names_no_index_and_no_address(lock: str) -> None:
    assert re.findall(r"https?:|--index|--extra-index|--find-links|--trusted-host| @ ", text(lock)) == []


@pytest.mark.parametrize(
    ("lock", "needed"),
    [
        ("requirements.lock", PYPROJECT["project"]["dependencies"]),
        ("requirements.lock", PYPROJECT["project"]["optional-dependencies"]["files"]),
        ("requirements-build.lock", PYPROJECT["build-system"]["requires"]),
    ],
    ids=["service", "files", "build"],
)
def test_a_lock_holds_what_the_project_needs_in_a_version_that_it_takes(lock: str, needed: list[str]) -> None:
    pins = {canonicalize_name(pin.name): pin for pin in locked(lock) if pin.marker is None or pin.marker.evaluate()}
    for requirement in map(Requirement, needed):
        (exactly,) = pins[canonicalize_name(requirement.name)].specifier
        assert requirement.specifier.contains(exactly.version), requirement


def test_the_tests_run_with_the_versions_that_are_locked() -> None:
    pins = [pin for pin in locked("requirements.lock") if pin.marker is None or pin.marker.evaluate()]
    different = [str(pin) for pin in pins if not pin.specifier.contains(version(pin.name), prereleases=True)]
    assert different == []


def needs(requirement: Requirement) -> list[Requirement]:
    """What a package needs here, with the extras that are asked for."""
    found = [Requirement(line) for line in requires(requirement.name) or ()]
    chosen = [{"extra": extra} for extra in ("", *requirement.extras)]
    return [one for one in found if one.marker is None or any(one.marker.evaluate(each) for each in chosen)]


def test_the_lock_holds_all_that_its_packages_need() -> None:
    """They are installed without looking for more."""
    names = {canonicalize_name(pin.name) for pin in locked("requirements.lock")}
    project = PYPROJECT["project"]
    waiting = [Requirement(line) for line in (*project["dependencies"], *project["optional-dependencies"]["files"])]
    seen: set[tuple[str, frozenset[str]]] = set()
    while waiting:
        requirement = waiting.pop()
        key = canonicalize_name(requirement.name), frozenset(requirement.extras)
        assert key[0] in names, requirement
        if key not in seen:
            seen.add(key)
            waiting += needs(requirement)
    assert len({name for name, _ in seen}) > 40


def test_the_build_lock_is_compiled_from_what_the_build_needs() -> None:
    assert PYPROJECT["dependency-groups"]["build"] == PYPROJECT["build-system"]["requires"]


# The container file


def instructions() -> list[tuple[str, str]]:
    """The container file's instructions, in order."""
    lines = [line for line in text("Dockerfile").splitlines() if not line.startswith("#")]
    joined = re.sub(r"\s*\\\n\s*", " ", "\n".join(lines))
    return [(line.split()[0], line.split(maxsplit=1)[1]) for line in joined.splitlines() if line]


def stages() -> list[list[tuple[str, str]]]:
    """The instructions of each stage, from its FROM on."""
    found: list[list[tuple[str, str]]] = []
    for name, rest in instructions():
        if name == "FROM":
            found.append([])
        found[-1].append((name, rest))
    return found


def of(stage: list[tuple[str, str]], name: str) -> list[str]:
    return [rest for instruction, rest in stage if instruction == name]


BUILD, RUNTIME = stages()


def test_both_stages_begin_with_one_image_of_a_python_that_the_project_takes() -> None:
    ((build, _, _), (runtime,)) = (of(stage, "FROM")[0].split() for stage in (BUILD, RUNTIME))
    assert build == runtime
    python = re.fullmatch(r"python:(3\.\d+)-slim-\w+", build)
    assert python is not None
    assert Requirement(f"python{PYPROJECT['project']['requires-python']}").specifier.contains(python[1])


def test_everything_is_installed_by_hash_from_the_locks_or_without_an_index() -> None:
    commands = [command.strip() for line in of(BUILD, "RUN") for command in line.split("&&")]
    *installs, check = [command for command in commands if command.startswith("pip ")]
    assert check.endswith(" check")
    assert len(installs) == 4
    for install in installs:
        assert "--no-deps" in install, install
        assert "--no-index" in install or "--require-hashes --only-binary :all:" in install, install
    for lock in LOCKS:
        assert any(f"--requirement {lock}" in install for install in installs)


def test_what_the_builder_copies_exists_and_is_not_ignored() -> None:
    patterns = [line for line in text(".dockerignore").splitlines() if line and not line.startswith("#")]
    assert patterns[0] == "*"
    kept = {pattern.removeprefix("!") for pattern in patterns if pattern.startswith("!")}
    copied = {source for line in of(BUILD, "COPY") for source in line.split()[:-1]}
    assert copied == kept
    assert [name for name in copied if not (ROOT / name).exists()] == []
    assert not any(fnmatch(name, pattern) for name in copied for pattern in patterns[1:])


def test_the_image_refuses_to_be_built_with_an_sqlite_that_can_corrupt_a_file() -> None:
    assert f"assert sqlite3.sqlite_version_info >= {WAL_RESET_FIXED}" in " ".join(of(RUNTIME, "RUN"))


def test_the_process_runs_as_a_user_by_number_that_is_not_root_and_owns_the_volume() -> None:
    (user,) = of(RUNTIME, "USER")
    uid, gid = map(int, user.split(":"))
    assert uid > 0 < gid
    assert of(RUNTIME, "VOLUME") == of(RUNTIME, "WORKDIR") == ["/data"]
    assert f"--owner {uid} --group {gid}" in " ".join(of(RUNTIME, "RUN"))


def environment() -> dict[str, str]:
    return dict(pair.split("=", maxsplit=1) for line in of(RUNTIME, "ENV") for pair in line.split())


def test_the_image_configures_only_what_can_be_configured_and_listens_where_it_says() -> None:
    given = {name: value for name, value in environment().items() if name.startswith("HEADIMPACT_")}
    fields = {name.removeprefix("HEADIMPACT_").lower(): value for name, value in given.items()}
    assert fields.keys() <= Settings.model_fields.keys()
    settings = Settings(**fields)  # type: ignore[arg-type] # texts, as in an environment
    assert settings.database_url == "sqlite:////data/headimpact.db"
    assert settings.host == "0.0.0.0"
    assert of(RUNTIME, "EXPOSE") == [str(settings.port)]


def test_nothing_is_written_beside_the_program() -> None:
    assert environment()["PYTHONDONTWRITEBYTECODE"] == "1"


def test_the_entry_point_is_a_command_of_the_project() -> None:
    assert [json.loads(line) for line in of(RUNTIME, "ENTRYPOINT")] == [[*PYPROJECT["project"]["scripts"]]]
    assert [json.loads(line) for line in of(RUNTIME, "CMD")] == [["serve"]]


@pytest.mark.parametrize(("status", "healthy"), [(200, True), (503, False)])
def test_the_health_check_passes_only_when_livez_answers_200(status: int, healthy: bool) -> None:
    (check,) = of(RUNTIME, "HEALTHCHECK")
    _, *arguments = json.loads(check.partition(" CMD ")[2])
    with answering(status) as (port, asked):
        # a proxy that is set for the service's own calls must not be asked for its health
        env = os.environ | {"HEADIMPACT_PORT": str(port), "http_proxy": "http://127.0.0.1:1"}
        done = subprocess.run([sys.executable, *arguments], env=env, capture_output=True, check=False)
    assert (done.returncode == 0) == healthy
    assert asked == ["/livez"]


@contextmanager
def answering(status: int) -> Iterator[tuple[int, list[str]]]:
    """A server that answers everything with one status, on a port of its own, and what it was asked for."""
    asked: list[str] = []

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            asked.append(self.path)
            self.send_response(status)
            self.end_headers()

        def log_message(self, *_: object) -> None:
            """Keep quiet."""

    with ThreadingHTTPServer(("127.0.0.1", 0), Handler) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        yield server.server_port, asked
        server.shutdown()
        thread.join()
