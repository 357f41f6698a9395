"""Identifiers are opaque, ordered in time, and read back."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from headimpact_service.store import ids


@given(st.binary(min_size=16, max_size=16))
def test_an_identifier_is_read_back(raw: bytes) -> None:
    text = ids.encode("imp", raw)
    assert len(text) == 30
    assert ids.decode("imp", text) == raw


@given(st.lists(st.binary(min_size=16, max_size=16), min_size=2, max_size=9))
def test_text_sorts_as_the_bytes_do(raw: list[bytes]) -> None:
    assert sorted(ids.encode("imp", each) for each in raw) == [ids.encode("imp", each) for each in sorted(raw)]


def test_later_identifiers_are_greater() -> None:
    made = [ids.new() for _ in range(2000)]
    assert made == sorted(set(made))
    assert {raw[6] >> 4 for raw in made} == {7}


@pytest.mark.parametrize(
    "text",
    [
        "",
        "imp",
        "imp_",
        "ath_" + "0" * 26,
        "imp_" + "0" * 25,
        "imp_" + "0" * 27,
        "imp_8" + "0" * 25,
        "imp_" + "u" * 26,
        "imp_" + "0" * 25 + "O",
        "imp_" + "0" * 26 + "\n",
        "imp_" + "\u0660" * 26,
    ],
)
def test_what_is_none_of_ours_is_none(text: str) -> None:
    assert ids.decode("imp", text) is None
