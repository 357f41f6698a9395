"""What the connections of an engine are for, and the error of an address that no engine takes."""

from __future__ import annotations

from enum import Enum


class Access(Enum):
    """What a connection may do."""

    READ = "read"
    WRITE = "write"
    MIGRATE = "migrate"


class DatabaseUrlError(ValueError):
    """The database URL names nothing that the service can keep data in."""
