"""Organisations, keys, athletes, devices, impacts with their revisions, traces and scores."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0001"
down_revision = None
branch_labels = None
depends_on = None

_IDENTIFIER = sa.LargeBinary(length=16)
_DIGEST = sa.LargeBinary(length=32)
_VECTORS = ("peak_angular_acceleration", "delta_angular_velocity", "peak_linear_acceleration", "hip3d", "bam")
_CRITERIA = (
    "peak_angular_acceleration",
    "delta_angular_velocity",
    "bric",
    "ric",
    "peak_linear_acceleration",
    "hic15",
    "hic36",
    "si",
    "hip",
    "hip3d",
    "gambit",
    "vtcp",
    "bam",
)
_SCORE_NUMBERS = (
    *(f"{key}{axis}" for key in _CRITERIA for axis in (("_x", "_y", "_z") if key in _VECTORS else ("",))),
    *(f"{key}_probability" for key in _CRITERIA),
    "brain_angle_resultant",
    "resultant_linear_acceleration_g",
    "resultant_angular_velocity_rad_s",
    "resultant_angular_acceleration_rad_s2",
)


def upgrade() -> None:
    """Go to this revision."""
    op.create_table(
        "organisations",
        sa.Column("id", _IDENTIFIER, nullable=False),
        sa.Column("name", sa.String(length=200), nullable=False),
        sa.Column("incidence", sa.Double()),
        sa.Column("operating_points", sa.JSON(), nullable=False),
        sa.Column("settings_revision", sa.Integer(), nullable=False),
        sa.Column("created_at", sa.BigInteger(), nullable=False),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_organisations")),
        sa.UniqueConstraint("name", name=op.f("uq_organisations_name")),
    )
    op.create_table(
        "data_sets",
        sa.Column("id", _IDENTIFIER, nullable=False),
        sa.Column("organisation_id", _IDENTIFIER, nullable=False),
        sa.Column("mode", sa.String(length=8), nullable=False),
        sa.ForeignKeyConstraint(["organisation_id"], ["organisations.id"], name=op.f("fk_data_sets_organisation_id")),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_data_sets")),
        sa.UniqueConstraint("organisation_id", "mode", name=op.f("uq_data_sets_organisation_id_mode")),
    )
    op.create_table(
        "api_keys",
        sa.Column("id", _IDENTIFIER, nullable=False),
        sa.Column("data_set_id", _IDENTIFIER, nullable=False),
        sa.Column("name", sa.String(length=200), nullable=False),
        sa.Column("sha256", _DIGEST, nullable=False),
        sa.Column("shown", sa.String(length=32), nullable=False),
        sa.Column("scopes", sa.JSON(), nullable=False),
        sa.Column("created_at", sa.BigInteger(), nullable=False),
        sa.Column("expires_at", sa.BigInteger()),
        sa.Column("revoked_at", sa.BigInteger()),
        sa.ForeignKeyConstraint(["data_set_id"], ["data_sets.id"], name=op.f("fk_api_keys_data_set_id")),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_api_keys")),
        sa.UniqueConstraint("sha256", name=op.f("uq_api_keys_sha256")),
    )
    op.create_index(op.f("ix_api_keys_data_set_id"), "api_keys", ["data_set_id"], unique=False)
    op.create_table(
        "athletes",
        sa.Column("id", _IDENTIFIER, nullable=False),
        sa.Column("data_set_id", _IDENTIFIER, nullable=False),
        sa.Column("external_id", sa.Text()),
        sa.Column("tags", sa.JSON(), nullable=False),
        sa.Column("sport", sa.Text()),
        sa.Column("level", sa.Text()),
        sa.Column("position", sa.Text()),
        sa.Column("sex", sa.Text()),
        sa.Column("birth_year", sa.Integer()),
        sa.Column("time_zone", sa.Text()),
        sa.Column("consent", sa.Text()),
        sa.Column("revision", sa.Integer(), nullable=False),
        sa.Column("created_at", sa.BigInteger(), nullable=False),
        sa.Column("updated_at", sa.BigInteger(), nullable=False),
        sa.Column("deleted_at", sa.BigInteger()),
        sa.ForeignKeyConstraint(["data_set_id"], ["data_sets.id"], name=op.f("fk_athletes_data_set_id")),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_athletes")),
        sa.UniqueConstraint("data_set_id", "external_id", name=op.f("uq_athletes_data_set_id_external_id")),
    )
    op.create_index(op.f("ix_athletes_data_set_id_id"), "athletes", ["data_set_id", "id"], unique=False)
    op.create_index(
        op.f("ix_athletes_data_set_id_updated_at_id"), "athletes", ["data_set_id", "updated_at", "id"], unique=False
    )
    op.create_table(
        "devices",
        sa.Column("id", _IDENTIFIER, nullable=False),
        sa.Column("data_set_id", _IDENTIFIER, nullable=False),
        sa.Column("serial", sa.Text(), nullable=False),
        sa.Column("maker", sa.Text()),
        sa.Column("model", sa.Text()),
        sa.Column("firmware", sa.Text()),
        sa.Column("linear_acceleration_range_g", sa.Double()),
        sa.Column("angular_velocity_range_rad_s", sa.Double()),
        sa.Column("trigger_threshold_g", sa.Double()),
        sa.Column("mounting", sa.JSON()),
        sa.Column("metadata", sa.JSON(), nullable=False),
        sa.Column("revision", sa.Integer(), nullable=False),
        sa.Column("created_at", sa.BigInteger(), nullable=False),
        sa.Column("updated_at", sa.BigInteger(), nullable=False),
        sa.ForeignKeyConstraint(["data_set_id"], ["data_sets.id"], name=op.f("fk_devices_data_set_id")),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_devices")),
        sa.UniqueConstraint("data_set_id", "serial", name=op.f("uq_devices_data_set_id_serial")),
    )
    op.create_index(op.f("ix_devices_data_set_id_id"), "devices", ["data_set_id", "id"], unique=False)
    op.create_index(
        op.f("ix_devices_data_set_id_updated_at_id"), "devices", ["data_set_id", "updated_at", "id"], unique=False
    )
    op.create_table(
        "impacts",
        sa.Column("data_set_id", _IDENTIFIER, nullable=False),
        sa.Column("id", _IDENTIFIER, nullable=False),
        sa.Column("external_id", sa.Text()),
        sa.Column("external_id_digest", _IDENTIFIER),
        sa.Column("athlete_id", _IDENTIFIER),
        sa.Column("device_id", _IDENTIFIER),
        sa.Column("occurred_at", sa.BigInteger()),
        sa.Column("session_id", sa.Text()),
        sa.Column("activity", sa.Text()),
        sa.Column("sport", sa.Text()),
        sa.Column("position", sa.Text()),
        sa.Column("context", sa.JSON()),
        sa.Column("input_digest", _DIGEST),
        sa.Column("duplicate_of", _IDENTIFIER),
        sa.Column("revision", sa.Integer(), nullable=False),
        sa.Column("score_number", sa.Integer(), nullable=False),
        sa.Column("created_at", sa.BigInteger(), nullable=False),
        sa.Column("updated_at", sa.BigInteger(), nullable=False),
        sa.Column("deleted_at", sa.BigInteger()),
        sa.ForeignKeyConstraint(["athlete_id"], ["athletes.id"], name=op.f("fk_impacts_athlete_id")),
        sa.ForeignKeyConstraint(["data_set_id"], ["data_sets.id"], name=op.f("fk_impacts_data_set_id")),
        sa.ForeignKeyConstraint(["device_id"], ["devices.id"], name=op.f("fk_impacts_device_id")),
        sa.PrimaryKeyConstraint("data_set_id", "id", name=op.f("pk_impacts")),
        sa.UniqueConstraint(
            "data_set_id", "external_id_digest", name=op.f("uq_impacts_data_set_id_external_id_digest")
        ),
        sqlite_with_rowid=False,
    )
    op.create_index(
        op.f("ix_impacts_athlete_id_occurred_at_id"), "impacts", ["athlete_id", "occurred_at", "id"], unique=False
    )
    op.create_index(
        op.f("ix_impacts_data_set_id_input_digest_id"), "impacts", ["data_set_id", "input_digest", "id"], unique=False
    )
    op.create_index(
        op.f("ix_impacts_data_set_id_updated_at_id"), "impacts", ["data_set_id", "updated_at", "id"], unique=False
    )
    op.create_table(
        "impact_revisions",
        sa.Column("impact_id", _IDENTIFIER, nullable=False),
        sa.Column("revision", sa.Integer(), autoincrement=False, nullable=False),
        sa.Column("data_set_id", _IDENTIFIER, nullable=False),
        sa.Column("athlete_id", _IDENTIFIER),
        sa.Column("content_digest", _DIGEST, nullable=False),
        sa.Column("input_digest", _DIGEST, nullable=False),
        sa.Column("document", sa.JSON(), nullable=False),
        sa.Column("key_id", _IDENTIFIER),
        sa.Column("created_at", sa.BigInteger(), nullable=False),
        sa.Column("superseded_at", sa.BigInteger()),
        sa.Column("trace", sa.LargeBinary(), nullable=False),
        sa.ForeignKeyConstraint(["athlete_id"], ["athletes.id"], name=op.f("fk_impact_revisions_athlete_id")),
        sa.ForeignKeyConstraint(
            ["data_set_id", "impact_id"],
            ["impacts.data_set_id", "impacts.id"],
            name=op.f("fk_impact_revisions_data_set_id_impact_id"),
        ),
        sa.ForeignKeyConstraint(["key_id"], ["api_keys.id"], name=op.f("fk_impact_revisions_key_id")),
        sa.PrimaryKeyConstraint("impact_id", "revision", name=op.f("pk_impact_revisions")),
    )
    op.create_index(
        "ix_impact_revisions_superseded_athlete_id",
        "impact_revisions",
        ["athlete_id"],
        unique=False,
        sqlite_where=sa.text("superseded_at IS NOT NULL"),
        postgresql_where=sa.text("superseded_at IS NOT NULL"),
    )
    op.create_table(
        "scores",
        sa.Column("impact_id", _IDENTIFIER, nullable=False),
        sa.Column("number", sa.Integer(), autoincrement=False, nullable=False),
        sa.Column("revision", sa.Integer(), nullable=False),
        sa.Column("state", sa.String(length=16), nullable=False),
        sa.Column("model", sa.Text(), nullable=False),
        sa.Column("incidence", sa.Double(), nullable=False),
        sa.Column("service_version", sa.Text(), nullable=False),
        sa.Column("input_digest", _DIGEST, nullable=False),
        *(sa.Column(name, sa.Double()) for name in _SCORE_NUMBERS),
        sa.Column("quality_codes", sa.Text(), nullable=False),
        sa.Column("details", sa.JSON(), nullable=False),
        sa.Column("provenance", sa.JSON(), nullable=False),
        sa.Column("created_at", sa.BigInteger(), nullable=False),
        sa.ForeignKeyConstraint(
            ["impact_id", "revision"],
            ["impact_revisions.impact_id", "impact_revisions.revision"],
            name=op.f("fk_scores_impact_id_revision"),
        ),
        sa.PrimaryKeyConstraint("impact_id", "number", name=op.f("pk_scores")),
    )
    if op.get_bind().dialect.name == "sqlite":
        _tell_the_planner()


def _tell_the_planner() -> None:
    """Say what a large organisation's data look like.

    Without figures SQLite takes every index for equally selective and reads a whole data set in search of one
    athlete's impacts; what it measures itself in a young database would mislead it as well.
    """
    op.execute("ANALYZE sqlite_schema")  # makes the table of figures
    for index, figures in (
        ("impacts", "1000000 100000 1"),
        ("sqlite_autoindex_impacts_2", "1000000 100000 1"),
        ("ix_impacts_data_set_id_updated_at_id", "1000000 100000 1 1"),
        ("ix_impacts_data_set_id_input_digest_id", "1000000 100000 2 1"),
        ("ix_impacts_athlete_id_occurred_at_id", "1000000 500 2 1"),
    ):
        insert = sa.text("INSERT INTO sqlite_stat1 (tbl, idx, stat) VALUES ('impacts', :index, :figures)")
        op.execute(insert.bindparams(index=index, figures=figures))


def downgrade() -> None:
    """Go back to an empty database."""
    for table in (
        "scores",
        "impact_revisions",
        "impacts",
        "devices",
        "athletes",
        "api_keys",
        "data_sets",
        "organisations",
    ):
        op.drop_table(table)
