"""What was deleted is known again when a file brings it once more."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0004"
down_revision = "0003"
branch_labels = None
depends_on = None


def upgrade() -> None:
    """Go to this revision."""
    op.add_column("impacts", sa.Column("deleted_content", sa.LargeBinary(length=16)))
    op.create_index(
        op.f("ix_impacts_data_set_id_deleted_content"),
        "impacts",
        ["data_set_id", "deleted_content"],
        sqlite_where=sa.text("deleted_content IS NOT NULL"),
        postgresql_where=sa.text("deleted_content IS NOT NULL"),
    )


def downgrade() -> None:
    """Go back to the revision before."""
    op.drop_index(op.f("ix_impacts_data_set_id_deleted_content"), table_name="impacts")
    op.drop_column("impacts", "deleted_content")
