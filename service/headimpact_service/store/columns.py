"""The column types that SQLAlchemy does not have: instants as integer microseconds."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta

from sqlalchemy import JSON, BigInteger, LargeBinary, TypeDecorator
from sqlalchemy.engine import Dialect

EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
MICROSECOND = timedelta(microseconds=1)

Identifier = LargeBinary(16)
"""A UUIDv7 as 16 bytes: half of its text, in indices too."""
Digest = LargeBinary(32)
"""A SHA-256."""
Document = JSON(none_as_null=True)
"""JSON for what is read whole and never searched."""


class Instant(TypeDecorator[datetime]):
    """An aware datetime, stored as integer microseconds since 1970 in UTC: exact, sortable, the same on each engine."""

    impl = BigInteger
    cache_ok = True

    def process_bind_param(self, value: datetime | None, dialect: Dialect) -> int | None:  # noqa: ARG002 - its shape
        """Count the microseconds; a naive datetime raises TypeError."""
        return None if value is None else (value - EPOCH) // MICROSECOND

    def process_result_value(self, value: int | None, dialect: Dialect) -> datetime | None:  # noqa: ARG002 - its shape
        """The instant in UTC."""
        return None if value is None else EPOCH + timedelta(microseconds=value)
