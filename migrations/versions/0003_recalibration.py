"""Labels, diagnoses, merged athletes, and what comes of them: model versions, aliases and schedules."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0003"
down_revision = "0002"
branch_labels = None
depends_on = None

_IDENTIFIER = sa.LargeBinary(length=16)


def upgrade() -> None:
    """Go to this revision."""
    op.add_column("athletes", sa.Column("merged_into", _IDENTIFIER))
    op.create_index(
        op.f("ix_athletes_merged_into"),
        "athletes",
        ["merged_into"],
        sqlite_where=sa.text("merged_into IS NOT NULL"),
        postgresql_where=sa.text("merged_into IS NOT NULL"),
    )
    op.create_table(
        "labels",
        sa.Column("impact_id", _IDENTIFIER, nullable=False),
        sa.Column("number", sa.Integer(), autoincrement=False, nullable=False),
        sa.Column("data_set_id", _IDENTIFIER, nullable=False),
        sa.Column("outcome", sa.String(length=16)),
        sa.Column("basis", sa.String(length=32)),
        sa.Column("attribution", sa.String(length=32)),
        sa.Column("event", sa.String(length=16)),
        sa.Column("labelled_by", sa.Text()),
        sa.Column("diagnosis_id", _IDENTIFIER),
        sa.Column("key_id", _IDENTIFIER),
        sa.Column("created_at", sa.BigInteger(), nullable=False),
        sa.Column("superseded_at", sa.BigInteger()),
        sa.ForeignKeyConstraint(
            ["data_set_id", "impact_id"], ["impacts.data_set_id", "impacts.id"], name=op.f("fk_labels_data_set_id")
        ),
        sa.ForeignKeyConstraint(["key_id"], ["api_keys.id"], name=op.f("fk_labels_key_id")),
        sa.PrimaryKeyConstraint("impact_id", "number", name=op.f("pk_labels")),
    )
    op.create_index(op.f("ix_labels_data_set_id_created_at"), "labels", ["data_set_id", "created_at"], unique=False)
    op.create_table(
        "diagnoses",
        sa.Column("id", _IDENTIFIER, nullable=False),
        sa.Column("data_set_id", _IDENTIFIER, nullable=False),
        sa.Column("athlete_id", _IDENTIFIER, nullable=False),
        sa.Column("session_id", sa.Text(), nullable=False),
        sa.Column("basis", sa.String(length=32), nullable=False),
        sa.Column("diagnosed_at", sa.BigInteger()),
        sa.Column("diagnosed_by", sa.Text()),
        sa.Column("impact_id", _IDENTIFIER, nullable=False),
        sa.Column("key_id", _IDENTIFIER),
        sa.Column("created_at", sa.BigInteger(), nullable=False),
        sa.ForeignKeyConstraint(["data_set_id"], ["data_sets.id"], name=op.f("fk_diagnoses_data_set_id")),
        sa.ForeignKeyConstraint(["athlete_id"], ["athletes.id"], name=op.f("fk_diagnoses_athlete_id")),
        sa.ForeignKeyConstraint(["key_id"], ["api_keys.id"], name=op.f("fk_diagnoses_key_id")),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_diagnoses")),
    )
    op.create_index(op.f("ix_diagnoses_athlete_id"), "diagnoses", ["athlete_id"], unique=False)
    op.create_table(
        "models",
        sa.Column("id", _IDENTIFIER, nullable=False),
        sa.Column("data_set_id", _IDENTIFIER, nullable=False),
        sa.Column("version", sa.String(length=100), nullable=False),
        sa.Column("document", sa.JSON(), nullable=False),
        sa.Column("report", sa.LargeBinary()),
        sa.Column("page", sa.LargeBinary()),
        sa.Column("cohort", sa.LargeBinary()),
        sa.Column("schedule", sa.String(length=100)),
        sa.Column("job_id", _IDENTIFIER),
        sa.Column("key_id", _IDENTIFIER),
        sa.Column("created_at", sa.BigInteger(), nullable=False),
        sa.ForeignKeyConstraint(["data_set_id"], ["data_sets.id"], name=op.f("fk_models_data_set_id")),
        sa.ForeignKeyConstraint(["key_id"], ["api_keys.id"], name=op.f("fk_models_key_id")),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_models")),
        sa.UniqueConstraint("data_set_id", "version", name=op.f("uq_models_data_set_id_version")),
    )
    op.create_table(
        "model_aliases",
        sa.Column("data_set_id", _IDENTIFIER, nullable=False),
        sa.Column("name", sa.String(length=16), nullable=False),
        sa.Column("revision", sa.Integer(), autoincrement=False, nullable=False),
        sa.Column("version", sa.String(length=100)),
        sa.Column("reason", sa.Text(), nullable=False),
        sa.Column("key_id", _IDENTIFIER),
        sa.Column("created_at", sa.BigInteger(), nullable=False),
        sa.Column("superseded_at", sa.BigInteger()),
        sa.ForeignKeyConstraint(["data_set_id"], ["data_sets.id"], name=op.f("fk_model_aliases_data_set_id")),
        sa.ForeignKeyConstraint(["key_id"], ["api_keys.id"], name=op.f("fk_model_aliases_key_id")),
        sa.PrimaryKeyConstraint("data_set_id", "name", "revision", name=op.f("pk_model_aliases")),
    )
    op.create_table(
        "schedules",
        sa.Column("data_set_id", _IDENTIFIER, nullable=False),
        sa.Column("name", sa.String(length=100), nullable=False),
        sa.Column("cron", sa.String(length=100), nullable=False),
        sa.Column("time_zone", sa.String(length=64), nullable=False),
        sa.Column("enabled", sa.Boolean(), nullable=False),
        sa.Column("fit", sa.JSON(), nullable=False),
        sa.Column("gates", sa.JSON(), nullable=False),
        sa.Column("promote", sa.Boolean(), nullable=False),
        sa.Column("next_due", sa.BigInteger()),
        sa.Column("last_fired", sa.BigInteger()),
        sa.Column("last_job_id", _IDENTIFIER),
        sa.Column("last_digest", sa.Text()),
        sa.Column("revision", sa.Integer(), nullable=False),
        sa.Column("key_id", _IDENTIFIER),
        sa.Column("created_at", sa.BigInteger(), nullable=False),
        sa.Column("updated_at", sa.BigInteger(), nullable=False),
        sa.ForeignKeyConstraint(["data_set_id"], ["data_sets.id"], name=op.f("fk_schedules_data_set_id")),
        sa.ForeignKeyConstraint(["key_id"], ["api_keys.id"], name=op.f("fk_schedules_key_id")),
        sa.PrimaryKeyConstraint("data_set_id", "name", name=op.f("pk_schedules")),
    )
    op.create_index(op.f("ix_schedules_next_due"), "schedules", ["next_due"], unique=False)


def downgrade() -> None:
    """Go back to the revision before."""
    op.drop_table("schedules")
    op.drop_table("model_aliases")
    op.drop_table("models")
    op.drop_table("diagnoses")
    op.drop_table("labels")
    op.drop_index(op.f("ix_athletes_merged_into"), table_name="athletes")
    op.drop_column("athletes", "merged_into")
