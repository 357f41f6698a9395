"""What a table says of an impact in each of its rows: it must be the same in all, or they are several impacts."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from ingest_files import codes, csv_text, one, read, refused

from headimpact_service.ingest import csv_format
from headimpact_service.ingest.cells import LineCells, Stacked, Words
from headimpact_service.ingest.mapping import Mapping
from headimpact_service.ingest.record import ImpactRecord
from headimpact_service.ingest.steady import changed_rows

CELLS = st.lists(st.lists(st.sampled_from(["a", "b", "ab", ""]), min_size=4, max_size=4), min_size=1, max_size=12)


def as_columns(rows: Sequence[Sequence[str]], kind: str) -> dict[int, Sequence[str]]:
    lines = [",".join(row) + "\n" for row in rows]
    if kind == "lines":
        return {column: LineCells(lines, ",", column) for column in range(4)}
    cells = {column: [row[column] for row in rows] for column in range(4)}
    return {column: Words.of(told) if kind == "words" else told for column, told in cells.items()}


@given(CELLS, st.sets(st.integers(0, 3), min_size=1), st.integers(1, 12), st.sampled_from(["lines", "words", "lists"]))
def test_every_row_that_differs_from_the_one_above_is_marked(
    rows: list[list[str]], columns: set[int], cut: int, kind: str
) -> None:
    differs = [any(rows[i][c] != rows[i - 1][c] for c in columns) for i in range(1, len(rows))]
    whole = changed_rows(as_columns(rows, kind), sorted(columns), len(rows))
    assert whole.tolist() == [False, *differs]
    parts = [as_columns(part, kind) for part in (rows[:cut], rows[cut:]) if part]
    stacked = {column: Stacked([part[column] for part in parts]) for column in range(4)}
    found = changed_rows(stacked, sorted(columns), len(rows))
    assert all(mark for mark, expected in zip(found[1:], differs, strict=True) if expected)
    assert [bool(m) for i, m in enumerate(found[1:], 1) if i != cut] == [
        m for i, m in enumerate(differs, 1) if i != cut
    ]


def labelled(heading: str, *cells: str, at: int = 20, behind: bool = False) -> str:
    """The usual table of 40 rows with one more column, which says something else from some row on."""
    first, *lines = csv_text().splitlines()
    told = [cells[min(number // at, len(cells) - 1)] for number in range(len(lines))]
    pairs = [(first, heading), *zip(lines, told, strict=True)]
    return "\n".join(",".join(pair if behind else pair[::-1]) for pair in pairs)


@pytest.mark.parametrize("behind", [False, True], ids=["first column", "last column"])
@pytest.mark.parametrize(
    ("heading", "cells"),
    [
        ("player_id", ("p-1", "p-2")),
        ("device", ("d-1", "d-2")),
        ("session_id", ("s-1", "s-2")),
        ("axes", ("anatomical", "sae_j211")),
        ("filter", ("paper", "none")),
        ("sex", ("m", "f")),
        ("occurred_at", ("2026-11-20T19:00:00Z", "2026-11-20T19:00:05Z")),
    ],
)
def test_rows_of_several_impacts_that_nothing_tells_apart_are_refused(
    heading: str, cells: tuple[str, str], behind: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(csv_format, "ROWS_AT_ONCE", 7)
    problem = refused(labelled(heading, *cells, behind=behind))
    assert codes(problem) == [(None, "several-impacts")]
    assert "impact_id" in problem.detail


@pytest.mark.parametrize("behind", [False, True])
def test_with_a_column_that_tells_them_apart_each_says_its_own(behind: bool) -> None:
    text = labelled("player_id,impact_id", "p-1,1", "p-2,2", behind=behind)
    found = [record for record in read(text) if isinstance(record, ImpactRecord)]
    assert [record.athlete_external_id for record in found] == ["p-1", "p-2"]


def test_a_cell_that_only_some_rows_fill_says_it_of_its_impact() -> None:
    assert one(labelled("player_id", "", "p-1")).athlete_external_id == "p-1"
    assert one(labelled("axes", "", "sae_j211", "", at=1)).recording.axes == "sae_j211"
    assert one(labelled("player_id", "p-1", "", at=1)).athlete_external_id == "p-1"
    assert one(labelled("player_id", "p-1 ", "p-1")).athlete_external_id == "p-1"


def test_times_that_go_on_with_the_samples_are_those_of_one_impact() -> None:
    times = [f"2026-11-20T19:00:00.{number:03}Z" for number in range(40)]
    assert one(labelled("occurred_at", *times, at=1)).occurred_at.isoformat() == "2026-11-20T19:00:00+00:00"
    turned = ("2026-11-20T19:00:00Z", "2026-11-20T19:00:01Z")
    assert one(labelled("occurred_at", *turned)).occurred_at.second == 0


def test_blanks_around_a_name_are_none_of_it() -> None:
    record = one(labelled("impact_id", "W-1", "W-1 "))
    assert (record.external_id, record.recording.linear_acceleration.values.shape) == (None, (40, 3))


def test_an_impact_whose_cells_of_a_signal_are_all_empty_has_no_such_signal() -> None:
    heading, *lines = labelled("impact_id", "1", "2").splitlines()
    empty = [",".join([*line.split(",")[:5], "", "", ""]) for line in lines[20:]]
    whole, lacking = read("\n".join([heading, *lines[:20], *empty]))
    assert [name for name, _ in whole.recording.signals()] == ["linear_acceleration", "angular_velocity"]
    assert [name for name, _ in lacking.recording.signals()] == ["linear_acceleration"]
    for cells in (["", "", "1.0"], ["x", "x", "x"], ["n/a", "?", ""]):
        other = [",".join([*line.split(",")[:5], *cells]) for line in lines[20:]]
        assert codes(read("\n".join([heading, *lines[:20], *other]))[1]) == [(None, "missing-sample")]


def test_a_name_that_only_the_first_row_of_its_impact_has_is_refused() -> None:
    merged = ["1", *[""] * 19, "2", *[""] * 19]
    problem: Any = refused(labelled("impact_id", *merged, at=1))
    assert "Row 2 below the headings leaves out" in problem.detail
    nameless = one(labelled("impact_id", ""))
    assert (nameless.external_id, nameless.recording.linear_acceleration.values.shape) == (None, (40, 3))


@pytest.mark.parametrize("nothing", ["NA", "nan", "#N/A", "null", " "])
def test_what_stands_for_nothing_is_no_name(nothing: str) -> None:
    record = one(labelled("player_id,device,occurred_at,sex", f"{nothing},{nothing},{nothing},{nothing}"))
    assert (record.athlete_external_id, record.device_serial, record.occurred_at) == (None, None, None)
    merged = ["1", *[nothing] * 19, "2", *[nothing] * 19]
    assert "leaves out what tells impacts apart" in refused(labelled("impact_id", *merged, at=1)).detail


def test_a_filter_that_is_none_is_not_nothing() -> None:
    assert one(labelled("filter", "none")).recording.low_pass.name == "none"


def untimed_rows(*empty: int, key: str | None = None) -> str:
    """The usual table without times, some of its rows without a value, as a lost sample is saved."""
    heading, *lines = (line.partition(",")[2] for line in csv_text().splitlines())
    rows = [",,,,," if number in empty else line for number, line in enumerate(lines)]
    if key is not None:
        heading, rows = f"impact_id,{heading}", [f"{key if row[0] != ',' else ''},{row}" for row in rows]
    return "\n".join([heading, *rows])


def test_a_row_of_empty_cells_is_a_lost_sample_between_others_and_nothing_at_the_end() -> None:
    assert codes(refused(untimed_rows(20), sample_rate_hz=1000.0)) == [(None, "missing-sample")]
    assert "empty cells stand between" in refused(untimed_rows(20, key="1"), sample_rate_hz=1000.0).detail
    for text in (untimed_rows(38, 39), untimed_rows(38, 39, key="1"), untimed_rows(0)):
        count = 38 if text.endswith(",") else 39
        assert one(text, sample_rate_hz=1000.0).recording.linear_acceleration.values.shape == (count, 3)


def test_rows_of_empty_cells_may_part_impacts() -> None:
    first, second = untimed_rows(key="1"), untimed_rows(key="2").split("\n", 1)[1]
    found = read("\n".join([first, ",,,,,,", ",,,,,,", second]), sample_rate_hz=1000.0)
    assert [record.recording.linear_acceleration.values.shape for record in found] == [(40, 3), (40, 3)]


def test_quoted_decimal_commas_among_points_are_no_empty_cells() -> None:
    heading, *lines = csv_text().splitlines()
    cells = [line.split(",") for line in lines]
    mixed = [",".join([*row[:4], *(f'"{cell}"'.replace(".", ",") for cell in row[4:])]) for row in cells]
    assert codes(refused("\n".join([heading, *mixed]))) == [(None, "missing-sample")]


def test_comments_below_the_headings_are_passed_over() -> None:
    heading, *lines = csv_text().splitlines()
    assert one("\n".join([heading, *lines[:20], "# half way", *lines[20:], "# end"])).recording.linear_acceleration


def test_a_corrupt_first_row_that_is_left_out_may_hold_nothing() -> None:
    heading, *lines = csv_text().splitlines()
    first = lines[0].split(",")[0] + ",,NaN,,,,"
    record = one("\n".join([heading, first, *lines[1:]]), mapping=Mapping.model_validate({"drop_rows": 1}))
    assert record.recording.linear_acceleration.values.shape == (39, 3)


def test_a_window_of_rows_is_looked_through_once_for_all_its_impacts() -> None:
    places = np.repeat([0, 1, 0], [3, 4, 5])
    assert changed_rows({0: Words(places, ["a", "b"])}, [0], 12).nonzero()[0].tolist() == [3, 7]
