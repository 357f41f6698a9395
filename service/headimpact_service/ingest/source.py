"""What is read: bytes in memory, or a file on disk that is never held whole."""

from __future__ import annotations

import io
from pathlib import Path
from typing import BinaryIO

from headimpact_service.errors import Problem


class Source:
    """A file to be read, wherever it lies; a format takes its head, a stream, or all of it under a bound."""

    def __init__(self, content: bytes | Path) -> None:
        """Look at nothing but the size."""
        self.content = content
        self.size = len(content) if isinstance(content, bytes) else content.stat().st_size

    def open(self) -> BinaryIO:
        """A stream over it, from its start, to be closed by the caller."""
        return io.BytesIO(self.content) if isinstance(self.content, bytes) else self.content.open("rb")

    def head(self, count: int) -> bytes:
        """The first bytes."""
        with self.open() as stream:
            return stream.read(count)

    def read(self, limit: int) -> bytes:
        """All of it; 413 where that is more than `limit` bytes."""
        if self.size > limit:
            raise Problem("import-too-large", f"A file of this kind may have at most {limit} bytes.")
        if isinstance(self.content, bytes):
            return self.content
        return self.content.read_bytes()
