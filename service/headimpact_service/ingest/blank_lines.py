"""Whether blank lines part the rows of a text into blocks, or only space them."""

from __future__ import annotations


class BlankLines:
    """The blank lines between the rows that were read so far; those before the first and behind the last say nothing.

    A wrong line ending writes one behind every row: lines part rows where some stand closer together than others.
    """

    def __init__(self) -> None:
        self._gaps: set[int] = set()
        self._since_row: int | None = None

    def blank(self) -> None:
        """A blank line."""
        if self._since_row is not None:
            self._since_row += 1

    def rows(self, count: int = 1) -> None:
        """Rows that follow each other directly."""
        if self._since_row is not None:
            self._gaps.add(self._since_row)
        if count > 1:
            self._gaps.add(0)
        self._since_row = 0

    @property
    def part_rows(self) -> bool:
        """Whether the rows stand in blocks."""
        return len(self._gaps) > 1
