"""Columns of text that are looked up when they are asked for are the lists that they stand for."""

from __future__ import annotations

import io
from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from headimpact_service.errors import Problem
from headimpact_service.ingest.blocks import lie_in_long_blocks
from headimpact_service.ingest.cells import LineCells, Stacked, Words, is_written_number
from headimpact_service.ingest.csv_format import CsvTable
from headimpact_service.ingest.dts_header import A_NUMBER
from headimpact_service.ingest.lines_above import rates_stated

cells = st.lists(st.sampled_from(["", "a", "b", "Ω"]), max_size=12)


def forms(texts: list[str]) -> list[Sequence[str]]:
    """The same cells in every form, the last column of a line and another one."""
    lines = [f"x;{text};y\n" for text in texts]
    ends = [f"x;{text}\r\n" for text in texts]
    half = len(texts) // 2
    return [
        Words.of(texts),
        LineCells(lines, ";", 1),
        LineCells(ends, ";", 1),
        Stacked([texts[:half], Words.of(texts[half:])]),
        Stacked([LineCells(lines[:half], ";", 1), [], LineCells(lines[half:], ";", 1)]),
    ]


@given(texts=cells, start=st.integers(0, 12), count=st.integers(0, 12))
def test_every_form_has_the_cells_of_its_list(texts: list[str], start: int, count: int):
    for form in forms(texts):
        assert len(form) == len(texts)
        assert list(form) == texts
        assert [form[row] for row in range(len(texts))] == texts
        part = form[start : start + count]
        assert list(part) == texts[start : start + count]
        assert [part[row] for row in range(len(part))] == texts[start : start + count]


def test_words_are_kept_once():
    words = Words.of(["a", "b", "a", "a"])
    np.testing.assert_array_equal(words.places, [0, 1, 0, 0])
    assert words.known == ["a", "b"]
    assert Words.of(words) is words


def test_a_row_that_is_not_there_is_an_error():
    for form in forms(["a"])[:3]:
        with pytest.raises(IndexError):
            form[1]


@pytest.mark.parametrize("long", ["1" * 100_000, "0." + "0" * 100_000, "1." + "1" * 100_000])
def test_a_cell_of_many_digits_is_told_in_one_pass(long: str) -> None:
    """In as many passes as it has digits, it would take hours."""
    assert is_written_number(long)
    for other in (f"{long}x", f"{long} Hz"):
        assert not is_written_number(other)
        assert not lie_in_long_blocks([other, other])
        assert np.isinf(csv_number(other))
        assert not A_NUMBER.fullmatch(other)
        assert list(rates_stated([[f"Note {other}"]], sentences=True)) == []


def test_a_longer_cell_is_called_what_it_is() -> None:
    with pytest.raises(Problem) as caught:
        csv_number("1" * 140_000 + "x")
    assert caught.value.detail == "Line 2 has a cell of more than 131072 characters."


def csv_number(cell: str) -> float:
    [values] = [block.numbers[0] for block in CsvTable(io.BytesIO(f"a,b\n{cell},2\n".encode())).blocks([0], [])]
    return float(values[0])
