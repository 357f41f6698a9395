"""The tables: every resource hangs on a data set, every data set (live or test) on an organisation."""

from __future__ import annotations

from sqlalchemy import (
    Boolean,
    Column,
    Double,
    ForeignKey,
    ForeignKeyConstraint,
    Index,
    Integer,
    LargeBinary,
    MetaData,
    String,
    Table,
    Text,
    UniqueConstraint,
)

from headimpact_service.store.columns import Digest, Document, Identifier, Instant

NAMING = {
    "pk": "pk_%(table_name)s",
    "uq": "uq_%(table_name)s_%(column_0_N_name)s",
    "fk": "fk_%(table_name)s_%(column_0_N_name)s",
    "ix": "ix_%(table_name)s_%(column_0_N_name)s",
}

CRITERION_COMPONENTS: dict[str, int] = {
    "peak_angular_acceleration": 3,
    "delta_angular_velocity": 3,
    "bric": 1,
    "ric": 1,
    "peak_linear_acceleration": 3,
    "hic15": 1,
    "hic36": 1,
    "si": 1,
    "hip": 1,
    "hip3d": 3,
    "gambit": 1,
    "vtcp": 1,
    "bam": 3,
}
"""The criteria that have columns. A migration froze them: a new criterion is a new migration."""

CRITERION_COLUMNS: dict[str, tuple[str, ...]] = {
    key: (key,) if components == 1 else (f"{key}_x", f"{key}_y", f"{key}_z")
    for key, components in CRITERION_COMPONENTS.items()
}
VALUE_COLUMNS: tuple[str, ...] = tuple(column for columns in CRITERION_COLUMNS.values() for column in columns)
PROBABILITY_COLUMNS: tuple[str, ...] = tuple(f"{key}_probability" for key in CRITERION_COMPONENTS)
PEAK_COLUMNS: tuple[str, ...] = (
    "brain_angle_resultant",
    "resultant_linear_acceleration_g",
    "resultant_angular_velocity_rad_s",
    "resultant_angular_acceleration_rad_s2",
)

metadata = MetaData(naming_convention=NAMING)

organisations = Table(
    "organisations",
    metadata,
    Column("id", Identifier, primary_key=True),
    Column("name", String(200), nullable=False, unique=True),
    Column("incidence", Double),
    Column("operating_points", Document, nullable=False),
    Column("settings_revision", Integer, nullable=False),
    Column("created_at", Instant, nullable=False),
)

data_sets = Table(
    "data_sets",
    metadata,
    Column("id", Identifier, primary_key=True),
    Column("organisation_id", ForeignKey("organisations.id"), nullable=False),
    Column("mode", String(8), nullable=False),
    UniqueConstraint("organisation_id", "mode"),
)

api_keys = Table(
    "api_keys",
    metadata,
    Column("id", Identifier, primary_key=True),
    Column("data_set_id", ForeignKey("data_sets.id"), nullable=False, index=True),
    Column("name", String(200), nullable=False),
    Column("sha256", Digest, nullable=False, unique=True),
    Column("shown", String(32), nullable=False),
    Column("scopes", Document, nullable=False),
    Column("created_at", Instant, nullable=False),
    Column("expires_at", Instant),
    Column("revoked_at", Instant),
)

athletes = Table(
    "athletes",
    metadata,
    Column("id", Identifier, primary_key=True),
    Column("data_set_id", ForeignKey("data_sets.id"), nullable=False),
    Column("external_id", Text),
    Column("tags", Document, nullable=False),
    Column("sport", Text),
    Column("level", Text),
    Column("position", Text),
    Column("sex", Text),
    Column("birth_year", Integer),
    Column("time_zone", Text),
    Column("consent", Text),
    Column("revision", Integer, nullable=False),
    Column("created_at", Instant, nullable=False),
    Column("updated_at", Instant, nullable=False),
    Column("deleted_at", Instant),
    # Of an athlete who turned out to be another: the row keeps its external id, so that later impacts find their way.
    Column("merged_into", Identifier),
    UniqueConstraint("data_set_id", "external_id"),
    Index(None, "data_set_id", "updated_at", "id"),
    Index(None, "data_set_id", "id"),
)
Index(
    "ix_athletes_merged_into",
    athletes.c.merged_into,
    sqlite_where=athletes.c.merged_into.is_not(None),
    postgresql_where=athletes.c.merged_into.is_not(None),
)

devices = Table(
    "devices",
    metadata,
    Column("id", Identifier, primary_key=True),
    Column("data_set_id", ForeignKey("data_sets.id"), nullable=False),
    Column("serial", Text, nullable=False),
    Column("maker", Text),
    Column("model", Text),
    Column("firmware", Text),
    Column("linear_acceleration_range_g", Double),
    Column("angular_velocity_range_rad_s", Double),
    Column("trigger_threshold_g", Double),
    Column("mounting", Document),
    Column("metadata", Document, nullable=False),
    Column("revision", Integer, nullable=False),
    Column("created_at", Instant, nullable=False),
    Column("updated_at", Instant, nullable=False),
    UniqueConstraint("data_set_id", "serial"),
    Index(None, "data_set_id", "updated_at", "id"),
    Index(None, "data_set_id", "id"),
)

impacts = Table(
    "impacts",
    metadata,
    # The rows lie in the order of the list: what would be two more indices to write with every impact.
    Column("data_set_id", ForeignKey("data_sets.id"), primary_key=True),
    Column("id", Identifier, primary_key=True),
    Column("external_id", Text),
    # What is unique is a digest of the external id: it outlives an erasure, so a redelivery cannot undo one.
    Column("external_id_digest", LargeBinary(16)),
    Column("athlete_id", ForeignKey("athletes.id")),
    Column("device_id", ForeignKey("devices.id")),
    Column("occurred_at", Instant),
    Column("session_id", Text),
    Column("activity", Text),
    Column("sport", Text),
    Column("position", Text),
    Column("context", Document),
    Column("input_digest", Digest),
    Column("duplicate_of", Identifier),
    Column("revision", Integer, nullable=False),
    # The number of the score that stands for the impact: a column here is one index less than a flag there.
    Column("score_number", Integer, nullable=False),
    Column("created_at", Instant, nullable=False),
    Column("updated_at", Instant, nullable=False),
    Column("deleted_at", Instant),
    UniqueConstraint("data_set_id", "external_id_digest"),
    Index(None, "data_set_id", "updated_at", "id"),
    Index(None, "data_set_id", "input_digest", "id"),
    Index(None, "athlete_id", "occurred_at", "id"),
    sqlite_with_rowid=False,
)

# Digests of what was delivered and is no longer an impact's present content, since it was corrected or deleted: a file
# that brings the same again brings nothing new.
former_contents = Table(
    "former_contents",
    metadata,
    Column("data_set_id", ForeignKey("data_sets.id"), primary_key=True),
    Column("digest", LargeBinary(16), primary_key=True),
    Column("impact_id", Identifier, primary_key=True, index=True),
    sqlite_with_rowid=False,
)

impact_revisions = Table(
    "impact_revisions",
    metadata,
    Column("impact_id", Identifier, primary_key=True),
    Column("revision", Integer, primary_key=True, autoincrement=False),
    Column("data_set_id", Identifier, nullable=False),
    Column("athlete_id", ForeignKey("athletes.id")),
    Column("content_digest", Digest, nullable=False),
    Column("input_digest", Digest, nullable=False),
    Column("document", Document, nullable=False),
    Column("key_id", ForeignKey("api_keys.id")),
    Column("created_at", Instant, nullable=False),
    Column("superseded_at", Instant),
    # Last, so that reading the rest does not touch the pages that it overflows to.
    Column("trace", LargeBinary, nullable=False),
    ForeignKeyConstraint(["data_set_id", "impact_id"], ["impacts.data_set_id", "impacts.id"]),
)
# Erasing an athlete must find the revisions that a correction moved to somebody else, and only those: as a partial
# index it costs nothing until there is one.
Index(
    "ix_impact_revisions_superseded_athlete_id",
    impact_revisions.c.athlete_id,
    sqlite_where=impact_revisions.c.superseded_at.is_not(None),
    postgresql_where=impact_revisions.c.superseded_at.is_not(None),
)

scores = Table(
    "scores",
    metadata,
    Column("impact_id", Identifier, primary_key=True),
    Column("number", Integer, primary_key=True, autoincrement=False),
    Column("revision", Integer, nullable=False),
    Column("state", String(16), nullable=False),
    Column("model", Text, nullable=False),
    Column("incidence", Double, nullable=False),
    Column("service_version", Text, nullable=False),
    Column("input_digest", Digest, nullable=False),
    *(Column(name, Double) for name in (*VALUE_COLUMNS, *PROBABILITY_COLUMNS, *PEAK_COLUMNS)),
    Column("quality_codes", Text, nullable=False),
    Column("details", Document, nullable=False),
    Column("provenance", Document, nullable=False),
    Column("created_at", Instant, nullable=False),
    ForeignKeyConstraint(["impact_id", "revision"], ["impact_revisions.impact_id", "impact_revisions.revision"]),
)

labels = Table(
    "labels",
    metadata,
    Column("impact_id", Identifier, primary_key=True),
    Column("number", Integer, primary_key=True, autoincrement=False),
    Column("data_set_id", Identifier, nullable=False),
    # Null where the label was taken back.
    Column("outcome", String(16)),
    Column("basis", String(32)),
    Column("attribution", String(32)),
    Column("event", String(16)),
    Column("labelled_by", Text),
    Column("diagnosis_id", Identifier),
    Column("key_id", ForeignKey("api_keys.id")),
    Column("created_at", Instant, nullable=False),
    Column("superseded_at", Instant),
    ForeignKeyConstraint(["data_set_id", "impact_id"], ["impacts.data_set_id", "impacts.id"]),
    Index(None, "data_set_id", "created_at"),
)
"""What was said of an impact, one row each time: the last, which nothing superseded, counts."""

diagnoses = Table(
    "diagnoses",
    metadata,
    Column("id", Identifier, primary_key=True),
    Column("data_set_id", ForeignKey("data_sets.id"), nullable=False),
    Column("athlete_id", ForeignKey("athletes.id"), nullable=False, index=True),
    Column("session_id", Text, nullable=False),
    Column("basis", String(32), nullable=False),
    Column("diagnosed_at", Instant),
    Column("diagnosed_by", Text),
    Column("impact_id", Identifier, nullable=False),
    Column("key_id", ForeignKey("api_keys.id")),
    Column("created_at", Instant, nullable=False),
)

models = Table(
    "models",
    metadata,
    Column("id", Identifier, primary_key=True),
    Column("data_set_id", ForeignKey("data_sets.id"), nullable=False),
    Column("version", String(100), nullable=False),
    Column("document", Document, nullable=False),
    # Deflated; what a fit found out, its page, and who was in its cohort.
    Column("report", LargeBinary),
    Column("page", LargeBinary),
    Column("cohort", LargeBinary),
    Column("schedule", String(100)),
    Column("job_id", Identifier),
    Column("key_id", ForeignKey("api_keys.id")),
    Column("created_at", Instant, nullable=False),
    UniqueConstraint("data_set_id", "version"),
)

model_aliases = Table(
    "model_aliases",
    metadata,
    Column("data_set_id", ForeignKey("data_sets.id"), primary_key=True),
    Column("name", String(16), primary_key=True),
    Column("revision", Integer, primary_key=True, autoincrement=False),
    Column("version", String(100)),
    Column("reason", Text, nullable=False),
    Column("key_id", ForeignKey("api_keys.id")),
    Column("created_at", Instant, nullable=False),
    Column("superseded_at", Instant),
)
"""What each alias meant, one row each time; the last, which nothing superseded, is what it means."""

schedules = Table(
    "schedules",
    metadata,
    Column("data_set_id", ForeignKey("data_sets.id"), primary_key=True),
    Column("name", String(100), primary_key=True),
    Column("cron", String(100), nullable=False),
    Column("time_zone", String(64), nullable=False),
    Column("enabled", Boolean, nullable=False),
    Column("fit", Document, nullable=False),
    Column("gates", Document, nullable=False),
    Column("promote", Boolean, nullable=False),
    Column("next_due", Instant, index=True),
    Column("last_fired", Instant),
    Column("last_job_id", Identifier),
    # Of the cohort of the last fit that this schedule made: the same again teaches nothing.
    Column("last_digest", Text),
    Column("revision", Integer, nullable=False),
    Column("key_id", ForeignKey("api_keys.id")),
    Column("created_at", Instant, nullable=False),
    Column("updated_at", Instant, nullable=False),
)

jobs = Table(
    "jobs",
    metadata,
    Column("id", Identifier, primary_key=True),
    Column("data_set_id", ForeignKey("data_sets.id"), nullable=False),
    Column("key_id", ForeignKey("api_keys.id")),
    Column("kind", String(32), nullable=False),
    Column("idempotency_key", Text),
    Column("request_hash", Digest),
    Column("arguments", Document, nullable=False),
    Column("state", String(16), nullable=False),
    # A run is one attempt of one process; its number keeps an older run, still alive somewhere, from writing.
    Column("run", Integer, nullable=False),
    # Runs that got to work and did not end, since the job last got on.
    Column("crashes", Integer, nullable=False),
    Column("not_before", Instant),
    Column("done", Integer, nullable=False),
    Column("total", Integer),
    Column("result", Document),
    # The part of the result that may be long: lists do not read it.
    Column("details", Document),
    Column("problem", Document),
    Column("created_at", Instant, nullable=False),
    Column("updated_at", Instant, nullable=False),
    Column("started_at", Instant),
    Column("finished_at", Instant),
    UniqueConstraint("data_set_id", "idempotency_key"),
    Index(None, "data_set_id", "id"),
    Index(None, "finished_at"),
)

job_chunks = Table(
    "job_chunks",
    metadata,
    Column("job_id", ForeignKey("jobs.id"), primary_key=True),
    Column("number", Integer, primary_key=True, autoincrement=False),
    Column("outcome", Document, nullable=False),
)
"""What each part of an unfinished job came to, committed with what that part wrote: the mark that it is done."""
