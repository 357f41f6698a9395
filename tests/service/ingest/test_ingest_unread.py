"""Columns that no layout reads and that tell that the rows of a table are several impacts."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pytest
from binary_files import COLUMNS
from ingest_files import codes, csv_text, one, read, refused, six_axis
from making import table

from headimpact.preparation import prepare
from headimpact_service.errors import Problem
from headimpact_service.ingest.mapping import Mapping
from headimpact_service.ingest.record import ImpactRecord

SAMPLES = 40


def untimed(heading: str, cells: Sequence[object], records: int = 3) -> str:
    """The usual table without times, as often as there are records, with one more column."""
    first, *lines = (line.partition(",")[2] for line in csv_text().splitlines())
    rows = lines * records
    return "\n".join([f"{heading},{first}", *(f"{cell},{row}" for cell, row in zip(cells, rows, strict=True))])


def each(*names: object) -> list[object]:
    return [name for name in names for _ in range(SAMPLES)]


def shape(record: ImpactRecord) -> int:
    return int(record.recording.linear_acceleration.values.shape[0])


@pytest.mark.parametrize(
    ("heading", "cells"),
    [
        *((name, each(1, 2, 3)) for name in ("Impact", "Impact #", "Impact No.", "impactNumber", "Event ID", "hit_id")),
        *(
            (name, each(*names))
            for name in ("case", "No", "Nr.", "seq", "clip", "MG", "Helmet", "set", "series", "condition", "week")
            for names in ((1, 2, 3), ("imp0", "imp1", "imp2"), (1.0, 2.0, 3.0))
        ),
        *(
            (name, each(*names))
            for name in ("k", "label", "Auswahl")
            for names in ((7, 8, 9), ("c", "a", "b"), (0, 1, 2))
        ),
        ("k", [7] * 50 + [8] * 40 + [9] * 30),
        ("index", each("a", "b", "c")),
        ("n", [*range(SAMPLES)] * 3),
        ("", [*range(SAMPLES)] * 3),
        ("trigger", each(1, 2, 3)),
        ("uuid", each("a3", "b7", "c1")),
        ("Wearer", each("A", "B", "A")),
        ("file name", each("a.csv", "b.csv", "c.csv")),
        ("Sample", [*range(SAMPLES)] * 3),
        ("Sample Number", [float(n) for n in range(SAMPLES)] * 3),
        ("index", [*range(1, SAMPLES + 1)] * 3),
        ("Impact Time", each("10:01:01", "10:02:02", "10:03:03")),
        ("Timestamp", each("2024-05-06T12:13:14Z", "2024-05-06T12:15:14Z", "2024-05-06T12:17:14Z")),
        ("Date Time", each("2024/05/06 12:13:14", "2024/05/06 12:13:34", "2024/05/06 12:17:14")),
        ("Time", each("37:10.6", "38:10.6", "39:12.0")),
        ("Time", each("37:10.6", "41:12.1", "41:12.1")),
        ("Time", [f"{n / 1000:.3f}" for n in range(SAMPLES)] * 3),
        ("t", [*range(SAMPLES)] * 3),
        ("Date", each("20.11.2026 19:04:05", "20.11.2026 19:09:11", "20.11.2026 19:09:11")),
        ("Date", each("11/20/2026 7:04 PM", "11/20/2026 7:09 PM", "11/20/2026 7:09 PM")),
        ("Date", each("11/20/2026", "11/21/2026", "11/21/2026")),
        ("Timestamp", each("1700000000", "1700000300", "1700000300")),
        ("Impact", ["1", *[""] * 39, "2", *[""] * 39, "3", *[""] * 39]),
    ],
)
def test_rows_that_an_unread_column_tells_apart_are_refused(heading: str, cells: Sequence[object]) -> None:
    problem = refused(untimed(heading, cells), sample_rate_hz=1000.0)
    assert codes(problem) == [(None, "several-impacts")]
    assert "Column 1 " in problem.detail
    assert "empty group_by" in problem.detail


@pytest.mark.parametrize(
    ("heading", "cells"),
    [
        ("Impact", each(1)),
        ("id", [f"{n:03}" for n in range(SAMPLES)]),
        ("Seq", range(7, 7 + 2 * SAMPLES, 2)),
        ("Impact Force N", np.sin(np.arange(SAMPLES) / 9).round(2).tolist()),
        ("Sample", range(SAMPLES)),
        ("Frame", range(100, 100 + 2 * SAMPLES, 2)),
        ("Timestamp", [f"2024-05-06T12:13:14.{n:03}Z" for n in range(SAMPLES)]),
        ("Timestamp", ["2024-05-06T12:13:14Z"] * 20 + ["2024-05-06T12:13:15Z"] * 20),
        ("Time of day", [f"10:01:01.{n:03}" for n in range(SAMPLES)]),
        ("Clock", [f"37:10.{n:03}" for n in range(SAMPLES)]),
        ("Time", ["20.11.2026 19:04:05"] * 20 + ["20.11.2026 19:04:06"] * 20),
        ("Time", ["11/20/2026 7:04 PM"] * 20 + ["11/20/2026 7:05 PM"] * 20),
        ("Timestamp", ["1700000000"] * 20 + ["1700000001"] * 20),
        ("temperature", [20 + n // 10 for n in range(SAMPLES)]),
        ("Sensor Temp", [20 + n // 10 for n in range(SAMPLES)]),
        ("Event Flag", [int(n > 9) for n in range(SAMPLES)]),
        ("Is Impact", [str(n > 9).lower() for n in range(SAMPLES)]),
        ("Sensor Saturated", [int(n > 9) for n in range(SAMPLES)]),
        ("phase", ["pre"] * 10 + ["impact"] * 12 + ["post"] * 18),
        ("label", ["pre"] * 10 + ["impact"] * 20 + ["pre"] * 10),
        ("phase", [0] * 10 + [1] * 12 + [2] * 18),
        ("k", [0] * 10 + [1] * 30),
        ("status", [0] * 20 + [1] * 20),
        ("triggered", ["no"] * 20 + ["yes"] * 20),
        ("heart rate", [72] * 40),
        ("altitude", [round(54.1 + n // 10 / 10, 1) for n in range(SAMPLES)]),
        ("counts", np.rint(900 * np.sin(np.arange(SAMPLES) / 9)).astype(int).tolist()),
        ("", [""] * SAMPLES),
        ("notes", ["hard hit", *[""] * 39]),
        ("Device Event", ["T" if n == 9 else "N" for n in range(SAMPLES)]),
        ("Player", [*[""] * 39, "A"]),
    ],
)
def test_one_impact_stays_one(heading: str, cells: Sequence[object]) -> None:
    assert shape(one(untimed(heading, cells, records=1), sample_rate_hz=1000.0)) == SAMPLES


def long(heading: str, names: Sequence[object], lengths: Sequence[int], column: bool = True) -> str:
    """A table without times of one impact below the other, with what each is called in all its rows or in the first."""
    names_of_rows = [
        name if column or row == 0 else "" for name, length in zip(names, lengths, strict=True) for row in range(length)
    ]
    first, *_ = untimed(heading, range(SAMPLES), records=1).splitlines()
    rows = [",".join(map(repr, row)) for length in lengths for row in six_axis(length).tolist()]
    return "\n".join([first, *(f"{name},{row}" for name, row in zip(names_of_rows, rows, strict=True))])


EQUAL, UNEQUAL, ODD = (100, 100, 100), (100, 98, 99), (64, 100, 156)


@pytest.mark.parametrize(
    ("heading", "names", "lengths"),
    [
        *((name, names, EQUAL) for name in ("Trial", "Test", "Impact") for names in ((3.1, 3.2, 3.3), (1.1, 1.2, 2.1))),
        ("Trial", (12.01, 12.02, 12.03), (30, 40, 35)),
        *(("HIC", (12.5, 33.1, 44.9), lengths) for lengths in (EQUAL, UNEQUAL)),
        ("HIC", (12.5, 33.1), (100, 100)),
        *((name, ("turf", "mat", "sand"), UNEQUAL) for name in ("Surface", "Kennung")),
        *(
            (name, (1, 2, 3), lengths)
            for name in ("Trigger #", "trigger_count", "Active Event")
            for lengths in (UNEQUAL, ODD)
        ),
        ("event_status", (1, 2, 3), UNEQUAL),
        *(("PLA (g)", (44.1, 52.2, 60.3), lengths) for lengths in (EQUAL, UNEQUAL, ODD)),
        ("PLA (g)", (44.1, 52.2), (40, 50)),
        ("Peak G", (44, 52, 60), EQUAL),
    ],
)
def test_a_value_an_impact_parts_the_rows(heading: str, names: Sequence[object], lengths: Sequence[int]) -> None:
    text = long(heading, names, lengths)
    problem = refused(text, sample_rate_hz=1000.0)
    assert codes(problem) == [(None, "several-impacts")]
    assert f'group_by (["{heading}"]' in problem.detail
    assert shape(one(text, sample_rate_hz=1000.0, mapping=Mapping(group_by=[]))) == sum(lengths)
    found = read(text, sample_rate_hz=1000.0, mapping=Mapping(group_by=[heading]))
    assert [shape(record) for record in found] == list(lengths)


@pytest.mark.parametrize("heading", ["Impact", "Event ID", "Event", "Hit #", "Trial", "Test No", "Versuch", "Choc"])
@pytest.mark.parametrize("names", [range(SAMPLES), range(SAMPLES, 0, -1), [f"ev-{n}" for n in range(SAMPLES)]])
def test_a_row_an_impact_is_no_record(heading: str, names: Sequence[object]) -> None:
    text = untimed(heading, names, records=1)
    assert codes(refused(text, sample_rate_hz=1000.0)) == [(None, "several-impacts")]
    assert shape(one(text, sample_rate_hz=1000.0, mapping=Mapping(group_by=[]))) == SAMPLES


def test_days_that_differ_are_not_of_one_impact() -> None:
    days = [f"2026-10-{1 + n // 2:02}" for n in range(SAMPLES)]
    assert codes(refused(untimed("Date", days, records=1), sample_rate_hz=1000.0)) == [(None, "several-impacts")]


@pytest.mark.parametrize("heading", ["Aufprall", "Stoß", "Choc", "Golpe", "Rep", "Zone"])
def test_two_numbers_of_unequal_lengths_part_the_rows(heading: str) -> None:
    text = long(heading, (1, 2), (100, 99))
    assert codes(refused(text, sample_rate_hz=1000.0)) == [(None, "several-impacts")]


@pytest.mark.parametrize("heading", ["Impact #", "Impact", "Event", "Event ID", "Hit No", "Trial"])
def test_numbers_of_impacts_part_rows_whose_times_go_on(heading: str) -> None:
    first, *lines = csv_text(np.vstack([six_axis(SAMPLES), six_axis(SAMPLES)])).splitlines()
    text = "\n".join([f"{heading},{first}", *(f"{1 + n // SAMPLES},{line}" for n, line in enumerate(lines))])
    assert codes(refused(text)) == [(None, "several-impacts")]
    assert shape(one(text, mapping=Mapping(group_by=[]))) == 2 * SAMPLES
    assert len(read(text, mapping=Mapping(group_by=[heading]))) == 2
    flagged = "\n".join([f"{heading},{first}", *(f"{int(n > 9)},{line}" for n, line in enumerate(lines))])
    assert shape(one(flagged)) == 2 * SAMPLES


def test_a_peak_in_the_first_row_of_each_impact_parts_the_rows() -> None:
    problem = refused(long("PLA (g)", (44.1, 52.2, 60.3), EQUAL, column=False), sample_rate_hz=1000.0)
    assert codes(problem) == [(None, "several-impacts")]


@pytest.mark.parametrize(
    ("heading", "cells"),
    [
        ("phase", [0] * 64 + [1] * 100 + [2] * 156),
        ("trigger", [0] * 64 + [1] * 100 + [2] * 156),
        ("Event Flag", [0] * 160 + [1] * 160),
        ("Active Event", [0] * 160 + [1] * 160),
        ("Trigger #", [0] * 32 + [1] * 288),
        ("label", ["pre"] * 64 + ["impact"] * 100 + ["post"] * 156),
        ("speed", [5.5] * 120 + [5.6] * 200),
        ("speed", [round(5.5 + n // 40 / 10, 1) for n in range(320)]),
        ("Impact Speed", [round(5.5 + n // 16 / 10, 1) for n in range(320)]),
        ("PLA (g)", [0.0] * 20 + [n / 2 for n in range(120)] + [60.0] * 180),
        ("PLA (g)", [44.5, *[""] * 319]),
    ],
)
def test_what_changes_within_one_long_impact_leaves_it_one(heading: str, cells: Sequence[object]) -> None:
    first, *_ = untimed(heading, range(SAMPLES), records=1).splitlines()
    rows = [",".join(map(repr, row)) for row in six_axis(320).tolist()]
    text = "\n".join([first, *(f"{cell},{row}" for cell, row in zip(cells, rows, strict=True))])
    assert shape(one(text, sample_rate_hz=3200.0)) == 320


def test_the_sender_may_say_that_they_are_one_or_what_tells_them_apart() -> None:
    text = untimed("Event", each(1, 2, 3))
    assert shape(one(text, sample_rate_hz=1000.0, mapping=Mapping(group_by=[]))) == 3 * SAMPLES
    assert (
        shape(one(untimed("Event", each(1), records=1), sample_rate_hz=1e3, mapping=Mapping(group_by=["Event"]))) == 40
    )


def test_a_column_that_parts_the_rows_like_impacts_is_named_with_both_remedies() -> None:
    halves = ["pre"] * 20 + ["post"] * 20
    problem = refused(untimed("phase", halves, records=1), sample_rate_hz=1000.0)
    assert problem.detail == (
        "Column 1 (phase) does not say the same in all rows of the impact that begins in row 1 below the headings: if "
        'they are several impacts, tell them apart by a column impact_id or a mapping\'s group_by (["phase"], if that '
        "tells them apart); if they are one, say so by an empty group_by."
    )
    assert shape(one(untimed("phase", halves, records=1), sample_rate_hz=1e3, mapping=Mapping(group_by=[]))) == SAMPLES
    found = read(untimed("k", each(7, 8, 9)), sample_rate_hz=1e3, mapping=Mapping(group_by=["k"]))
    assert [shape(record) for record in found] == [SAMPLES] * 3


def test_what_a_column_is_called_tells_nothing_where_something_else_tells_impacts_apart() -> None:
    text = untimed("impact_id,label", [f"1,{'pre' if n < 20 else 'post'}" for n in range(SAMPLES)], records=1)
    assert shape(one(text, sample_rate_hz=1000.0)) == SAMPLES
    first, *lines = csv_text().splitlines()
    marked = [f"{number // 20},{line}" for number, line in enumerate(lines)]
    assert shape(one("\n".join([f"case,{first}", *marked]))) == SAMPLES


def test_a_mapping_of_the_signals_alone_keeps_the_guard() -> None:
    columns = {"unit": "g", "x": "ax_g", "y": "ay_g", "z": "az_g"}
    mapping = Mapping.model_validate({"linear_acceleration": columns, "sample_rate_hz": 1000.0})
    problem = refused(untimed("Event", each(1, 2, 3)), mapping=mapping)
    assert codes(problem) == [(None, "several-impacts")]


def test_times_that_differ_are_those_of_several_impacts_though_the_sender_gives_one() -> None:
    told = ("2026-11-20T19:00:00Z", "2026-11-20T19:01:00Z", "2026-11-20T19:02:00Z")
    problem = refused(untimed("occurred_at", each(*told)), sample_rate_hz=1000.0, occurred_at="2026-11-20T19:00:00Z")
    assert codes(problem) == [(None, "several-impacts")]
    broken = untimed("occurred_at", each("37:10.6"), records=1)
    found = one(broken, sample_rate_hz=1000.0, occurred_at="2026-11-20T19:00:00Z")
    assert found.occurred_at is not None


def counted(heading: str, numbers: Sequence[int]) -> str:
    """One impact whose rows are those samples of it that are numbered."""
    first, *lines = untimed(heading, range(SAMPLES), records=1).splitlines()
    return "\n".join([first, *(lines[number] for number in numbers)])


@pytest.mark.parametrize("heading", ["Sample", "Frame", "Sample Num", "index", "impact_id,Sample"])
def test_numbers_of_samples_that_leave_some_out_are_refused_with_what_helps(heading: str) -> None:
    text = counted(heading, [n for n in range(SAMPLES) if n != 15])
    if "," in heading:
        text = text.replace("\n", "\ni1,")
    problem = refused(text, sample_rate_hz=1000.0)
    assert codes(problem) == [(None, "sample-order")]
    name = heading.rpartition(",")[2]
    assert f"({name}) goes on from 14 to 16" in problem.detail
    assert f'{{"sample_number": "{name}"}}' in problem.detail
    filled = one(text, sample_rate_hz=1000.0, fill_gaps=True, mapping=Mapping(sample_number=[name]))
    assert [note.code for note in prepare(filled.recording).notes if note.code == "gaps_filled"]
    assert codes(refused(text, sample_rate_hz=1000.0, fill_gaps=True)) == [(None, "sample-order")]


@pytest.mark.parametrize(
    ("heading", "named"),
    [("", False), *((name, True) for name in ("Unnamed: 0", "tick", "No", "Nr", "Seq", "ID", "record"))],
)
def test_numbers_of_rows_that_were_lost_are_seen_whatever_they_are_called(heading: str, named: bool) -> None:
    problem = refused(counted(heading, [n for n in range(SAMPLES) if n != 15]), sample_rate_hz=1000.0)
    assert codes(problem) == [(None, "sample-order")]
    assert ("sample_number" in problem.detail) is named


def test_a_gap_that_cannot_be_filled_is_refused_without_that_remedy() -> None:
    problem = refused(counted("Sample", [*range(15), *range(19, SAMPLES)]), sample_rate_hz=1000.0)
    assert "from 14 to 19" in problem.detail
    assert "fill_gaps" not in problem.detail
    every_other = refused(counted("Sample", [n for n in range(0, SAMPLES, 2) if n != 20]), sample_rate_hz=1000.0)
    assert "from 18 to 22" in every_other.detail
    assert "fill_gaps" not in every_other.detail


def test_a_column_that_counts_something_else_is_passed_over_where_the_sender_says_so() -> None:
    text = counted("Point", [n for n in range(SAMPLES) if n != 15])
    assert shape(one(text, sample_rate_hz=1000.0, mapping=Mapping(group_by=[]))) == SAMPLES - 1


@pytest.mark.parametrize("timed", [False, True])
@pytest.mark.parametrize(
    ("heading", "cells"), [("Player", ("PA", "PB")), ("Session", ("s1", "s2")), ("File", ("a", "b"))]
)
def test_numbers_of_impacts_that_start_again_with_a_player_are_not_joined(
    heading: str, cells: tuple[str, str], timed: bool
) -> None:
    first, *lines = csv_text(np.vstack([six_axis(SAMPLES), six_axis(SAMPLES)])).splitlines()
    names, rows = (first, lines) if timed else (first.partition(",")[2], [line.partition(",")[2] for line in lines])
    told = [f"{cells[number // SAMPLES]},1,{row}" for number, row in enumerate(rows)]
    text = "\n".join([f"{heading},impact_id,{names}", *told])
    problem = refused(text, sample_rate_hz=1000.0)
    assert codes(problem) == [(None, "several-impacts")]
    found = read(text, sample_rate_hz=1000.0, mapping=Mapping(group_by=[heading, "impact_id"]))
    assert [shape(record) for record in found] == [SAMPLES, SAMPLES]


def test_samples_that_are_counted_anew_within_a_named_impact_are_several() -> None:
    text = untimed("impact_id,Sample", [f"1,{n}" for n in range(SAMPLES)] * 2, records=2)
    assert codes(refused(text, sample_rate_hz=1000.0)) == [(None, "several-impacts")]
    apart = [f"{k},{n}" for k in (1, 2) for n in range(SAMPLES)]
    assert [shape(record) for record in read(untimed("impact_id,Sample", apart, records=2), sample_rate_hz=1000.0)] == [
        40,
        40,
    ]


@pytest.mark.parametrize(
    ("heading", "field"), [("Player", "athlete"), ("Device ID", "device"), ("session_id", "session_id")]
)
def test_rows_of_two_players_are_refused_unless_the_column_is_not_read(heading: str, field: str) -> None:
    text = untimed(heading, each("A", "B", "A"))
    problem = refused(text, sample_rate_hz=1000.0)
    assert codes(problem) == [(None, "several-impacts")]
    assert f'{{"{field}": null, "group_by": []}}' in problem.detail
    unread = Mapping.model_validate({field: None, "group_by": []})
    assert shape(one(text, sample_rate_hz=1000.0, mapping=unread)) == 3 * SAMPLES


def test_a_number_of_each_row_is_no_device_where_the_sender_says_so() -> None:
    text = untimed("impact_id,Serial Number", [f"1,{n}" for n in range(SAMPLES)], records=1)
    assert '({"device": null} in a mapping)' in refused(text, sample_rate_hz=1000.0).detail
    assert shape(one(text, sample_rate_hz=1000.0, mapping=Mapping(device=None))) == SAMPLES


def test_times_that_go_on_are_of_one_person() -> None:
    first, *lines = csv_text().splitlines()
    told = [f"{'PA' if number < 20 else 'PB'},{line}" for number, line in enumerate(lines)]
    assert codes(refused("\n".join([f"Player,{first}", *told]))) == [(None, "several-impacts")]
    marked = [f"{int(number == 9)},{line}" for number, line in enumerate(lines)]
    assert shape(one("\n".join([f"Event,{first}", *marked]))) == SAMPLES


@pytest.mark.parametrize("heading", ["Impact", "Event", "Trial", "filename", "case", "impact_no"])
def test_times_that_begin_anew_name_the_column_that_parts_them(heading: str) -> None:
    first, *lines = csv_text(six_axis(SAMPLES)).splitlines()
    told = [f"{name},{line}" for name in ("a1", "a2", "a3") for line in lines]
    problem = refused("\n".join([f"{heading},{first}", *told]))
    assert codes(problem) == [(None, "several-impacts")]
    assert f"begin anew at sample {SAMPLES} " in problem.detail
    assert f'group_by (["{heading}"]' in problem.detail
    found = read("\n".join([f"{heading},{first}", *told]), mapping=Mapping(group_by=[heading]))
    assert [shape(record) for record in found] == [SAMPLES] * 3


def test_times_that_begin_anew_beside_nothing_that_parts_them_say_so_too() -> None:
    first, *lines = csv_text(six_axis(SAMPLES)).splitlines()
    problem = refused("\n".join([first, *lines, *lines]))
    assert codes(problem) == [(None, "several-impacts")]
    assert problem.detail.endswith("by a column impact_id or a mapping's group_by.")
    lists = "\n".join([first, *lines[:20], lines[18], *lines[20:]])  # one time that goes back is no other impact
    assert shape(one(lists)) == SAMPLES + 1


def keyed(heading: str, cell: Callable[[int], Any], timed: bool) -> bytes:
    """Three impacts with their ids, and a column that changes within each."""
    rows = [
        [name, *([n] if timed else []), *row, cell(n)]
        for name in ("i0", "i1", "i2")
        for n, row in enumerate(six_axis().tolist())
    ]
    return table(["impact_id", *(["t_ms"] if timed else []), *COLUMNS, heading], rows)


@pytest.mark.parametrize("timed", [True, False])
@pytest.mark.parametrize(
    "heading", ["Impact Phase", "Device RSSI", "Player HR", "Test Load (N)", "Run Speed", "sensor_raw_x"]
)
def test_what_changes_within_impacts_that_have_ids_is_of_the_samples(heading: str, timed: bool):
    beside = {} if timed else {"sample_rate_hz": 1000.0}
    found = read(keyed(heading, lambda n: n // 20, timed), **beside)
    assert [record.recording.linear_acceleration.values.shape for record in found] == [(40, 3)] * 3


@pytest.mark.parametrize("timed", [True, False])
def test_the_way_that_is_named_for_a_column_of_the_samples_beside_ids_works(timed: bool):
    beside = {} if timed else {"sample_rate_hz": 1000.0}
    text = keyed("hit zone", lambda n: "ab"[n // 20], timed)
    problem = read(text, **beside)[0]
    assert isinstance(problem, Problem)
    assert codes(problem) == [(None, "several-impacts")]
    assert '{"group_by": ["impact_id"]}' in problem.detail
    assert "empty group_by" not in problem.detail
    found = read(text, mapping=Mapping.model_validate({"group_by": ["impact_id"]}), **beside)
    assert [record.recording.linear_acceleration.values.shape for record in found] == [(40, 3)] * 3


@pytest.mark.parametrize("timed", [True, False])
def test_rows_with_several_ids_are_not_one_impact_whatever_is_said(timed: bool):
    beside = {} if timed else {"sample_rate_hz": 1000.0}
    problem = refused(keyed("x1", lambda n: 1, timed), mapping=Mapping.model_validate({"group_by": []}), **beside)
    assert codes(problem) == [(None, "several-impacts")]
    assert "Column 1 (impact_id)" in problem.detail


@pytest.mark.parametrize(
    ("heading", "cells"),
    [
        ("Event Time", ["19:05:06", "19:05:07", "19:05:08"]),
        ("Impact Time (s)", [1.5, 2.1, 2.4]),
        ("Speed (m/s)", [3.5, 4.5, 5.5]),
        ("Impact Force", [1, 2, 3]),
        ("Test Temp", [20.5, 21.5, 22.5]),
    ],
)
def test_what_is_measured_once_an_impact_parts_the_rows(heading: str, cells: list[Any]):
    rows = [[cell, *row] for cell in cells for row in six_axis(60).tolist()]
    problem = refused(table([heading, *COLUMNS], rows), sample_rate_hz=1000.0)
    assert codes(problem) == [(None, "several-impacts")]


@pytest.mark.parametrize("heading", ["Temp", "Battery", "Speed (m/s)"])
def test_what_a_slow_sensor_measures_parts_nothing(heading: str):
    rows = [[20.5 + n // 20, *row] for n, row in enumerate(six_axis(100).tolist())]
    assert shape(one(table([heading, *COLUMNS], rows), sample_rate_hz=1000.0)) == 100


class TestNamesAndTimes:
    """What is read of an impact, of samples without times."""

    @pytest.mark.parametrize("heading", ["impact_id", "external_id"])
    def test_a_name_that_comes_back_is_not_taken_for_the_same_impact(self, heading: str) -> None:
        problem = refused(untimed(heading, each(1, 2, 1)), sample_rate_hz=1000.0)
        assert problem.slug == "unreadable-file"
        assert "In row 81 below the headings an impact begins again" in problem.detail

    def test_with_times_its_rows_may_stand_apart(self) -> None:
        heading, *lines = csv_text().splitlines()
        parts = [f"{name},{line}" for part in (lines[:20], lines[20:]) for name in ("a", "b") for line in part]
        found = read("\n".join([f"impact_id,{heading}", *parts]))
        assert [shape(record) for record in found] == [40, 40]

    def test_rows_that_take_turns_have_an_order(self) -> None:
        _, *lines = (line.partition(",")[2] for line in csv_text().splitlines())
        first = csv_text().splitlines()[0].partition(",")[2]
        rows = [f"{name},{line}" for line in lines for name in ("a", "b")]
        assert [shape(record) for record in read("\n".join([f"impact_id,{first}", *rows]), sample_rate_hz=1000.0)] == [
            40,
            40,
        ]

    @pytest.mark.parametrize("apart", ["10:00:00.110Z", "10:00:00.450Z", "10:00:01Z"])
    def test_times_that_stay_for_many_rows_are_those_of_impacts(self, apart: str) -> None:
        told = each("2026-11-20T10:00:00Z", f"2026-11-20T{apart}")
        text = untimed("occurred_at", told, records=2)
        assert codes(refused(text, sample_rate_hz=1000.0)) == [(None, "several-impacts")]
        assert shape(one(text, mapping=Mapping.model_validate({"group_by": []}), sample_rate_hz=1000.0)) == 80

    @pytest.mark.parametrize("heading", ["athlete", "device", "session_id", "occurred_at"])
    def test_what_half_of_the_rows_say_parts_them(self, heading: str) -> None:
        said = "2026-11-20T10:00:00Z" if heading == "occurred_at" else "one"
        text = untimed(heading, each(said, ""), records=2)
        assert codes(refused(text, sample_rate_hz=1000.0)) == [(None, "several-impacts")]
        once = untimed(heading, [said, *[""] * 39], records=1)
        assert shape(one(once, sample_rate_hz=1000.0)) == 40

    @pytest.mark.parametrize("words", [("NA", "null"), ("missing", "-")])
    def test_two_words_for_nothing_are_no_name(self, words: tuple[str, str]) -> None:
        problem = refused(untimed("impact_id", each(*words), records=2), sample_rate_hz=1000.0)
        assert "give each impact a name" in problem.detail
