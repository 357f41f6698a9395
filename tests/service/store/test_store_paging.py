"""Cursors are opaque and belong to one list."""

from __future__ import annotations

from datetime import UTC, datetime

import pytest
from hypothesis import given
from hypothesis import strategies as st

from headimpact_service.errors import Problem
from headimpact_service.store.paging import Position, decode_cursor, encode_cursor

POSITION = Position(datetime(2026, 11, 20, 19, 4, 5, 123456, tzinfo=UTC), bytes(range(16)))


@given(
    st.datetimes(min_value=datetime(1970, 1, 1), timezones=st.just(UTC)),  # noqa: DTZ001 - hypothesis adds the zone
    st.binary(min_size=16, max_size=16),
    st.text(st.characters()),
)
def test_a_cursor_is_read_back(updated_at: datetime, raw: bytes, of: str) -> None:
    assert decode_cursor(encode_cursor(Position(updated_at, raw), of), of) == Position(updated_at, raw)


def test_a_cursor_of_another_list_is_refused() -> None:
    with pytest.raises(Problem) as caught:
        decode_cursor(encode_cursor(POSITION, "impacts"), "athletes")
    assert caught.value.slug == "bad-cursor"


def test_an_altered_cursor_is_refused() -> None:
    cursor = encode_cursor(POSITION, "impacts")
    swapped = "B" if cursor[20] == "A" else "A"
    with pytest.raises(Problem) as caught:
        decode_cursor(cursor[:20] + swapped + cursor[21:], "impacts")
    assert caught.value.slug == "bad-cursor"


@given(st.text())
def test_what_is_no_cursor_is_a_problem(text: str) -> None:
    with pytest.raises(Problem) as caught:
        decode_cursor(text, "impacts")
    assert caught.value.slug == "bad-cursor"


@pytest.mark.parametrize("microseconds", ["7f" * 8, "ff" * 8])
def test_an_instant_out_of_range_is_a_problem(microseconds: str) -> None:
    from base64 import urlsafe_b64decode, urlsafe_b64encode

    raw = bytearray(urlsafe_b64decode(encode_cursor(POSITION, "impacts") + "=="))
    raw[4:12] = bytes.fromhex(microseconds)
    with pytest.raises(Problem):
        decode_cursor(urlsafe_b64encode(raw).decode(), "impacts")
