"""How Alembic reaches the database: through the connection that the service hands over, or a URL for developers.

`alembic -x url=sqlite:///scratch.db revision --autogenerate -m "..."` drafts a migration against a scratch file.
"""

from __future__ import annotations

from alembic import context
from sqlalchemy import Connection, create_engine

from headimpact_service.store.tables import metadata


def run(connection: Connection) -> None:
    """Run inside the transaction that is already open on the connection."""
    context.configure(connection=connection, target_metadata=metadata)
    with context.begin_transaction():
        context.run_migrations()


given = context.config.attributes.get("connection")
if given is not None:
    run(given)
else:
    url = context.get_x_argument(as_dictionary=True).get("url", "sqlite:///headimpact.db")
    with create_engine(url).begin() as connection:
        run(connection)
