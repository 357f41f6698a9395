"""What was corrected, too, is known again when a file brings it once more."""

from __future__ import annotations

from hashlib import blake2b

import sqlalchemy as sa
from alembic import op

revision = "0005"
down_revision = "0004"
branch_labels = None
depends_on = None


def upgrade() -> None:
    """Go to this revision."""
    former = op.create_table(
        "former_contents",
        sa.Column("data_set_id", sa.LargeBinary(length=16), nullable=False),
        sa.Column("digest", sa.LargeBinary(length=16), nullable=False),
        sa.Column("impact_id", sa.LargeBinary(length=16), nullable=False),
        sa.ForeignKeyConstraint(
            ["data_set_id"], ["data_sets.id"], name=op.f("fk_former_contents_data_set_id_data_sets")
        ),
        sa.PrimaryKeyConstraint("data_set_id", "digest", "impact_id", name=op.f("pk_former_contents")),
        sqlite_with_rowid=False,
    )
    op.create_index(op.f("ix_former_contents_impact_id"), "former_contents", ["impact_id"])
    conn = op.get_bind()
    conn.execute(
        sa.text(
            "INSERT INTO former_contents (data_set_id, digest, impact_id) "
            "SELECT data_set_id, deleted_content, id FROM impacts WHERE deleted_content IS NOT NULL"
        )
    )
    corrected = conn.execute(
        sa.text(
            "SELECT DISTINCT data_set_id, content_digest, impact_id FROM impact_revisions "
            "WHERE superseded_at IS NOT NULL"
        )
    ).all()
    rows = [
        {
            "data_set_id": data_set_id,
            "digest": blake2b(content, key=data_set_id, digest_size=16).digest(),
            "impact_id": impact_id,
        }
        for data_set_id, content, impact_id in corrected
    ]
    if rows:
        op.bulk_insert(former, rows)
    op.drop_index(op.f("ix_impacts_data_set_id_deleted_content"), table_name="impacts")
    op.drop_column("impacts", "deleted_content")


def downgrade() -> None:
    """Go back to the revision before."""
    op.add_column("impacts", sa.Column("deleted_content", sa.LargeBinary(length=16)))
    op.create_index(
        op.f("ix_impacts_data_set_id_deleted_content"),
        "impacts",
        ["data_set_id", "deleted_content"],
        sqlite_where=sa.text("deleted_content IS NOT NULL"),
        postgresql_where=sa.text("deleted_content IS NOT NULL"),
    )
    op.get_bind().execute(
        sa.text(
            "UPDATE impacts SET deleted_content = (SELECT digest FROM former_contents "
            "WHERE former_contents.impact_id = impacts.id LIMIT 1) WHERE deleted_at IS NOT NULL"
        )
    )
    op.drop_index(op.f("ix_former_contents_impact_id"), table_name="former_contents")
    op.drop_table("former_contents")
