"""Times of samples that are written as dates with times of day, in every kind of table that may hold them."""

from __future__ import annotations

import datetime as dt
import re
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pyarrow as pa
import pytest
from binary_files import COLUMNS, SHEET, arrow, parquet, with_part, xlsx
from ingest_files import codes, one, read, refused, six_axis

from headimpact.errors import TraceError
from headimpact.preparation import prepare
from headimpact_service.ingest.dated import MAX_DAYS, Elapsed, elapsed_text
from headimpact_service.ingest.guarded.xlsx_file import SheetTable, _Block
from headimpact_service.ingest.mapping import Mapping
from headimpact_service.ingest.record import ImpactRecord

FIRST_NS = 1_791_036_322_113_000_000
"""2026-10-03T14:05:22.113Z."""
SAMPLES = 40
Writer = Callable[[dict[str, Sequence[Any]]], bytes]


def stamps(
    rate_hz: float = 1000.0, digits: int = 9, sep: str = "T", zone: str = "Z", after_s: float = 0.0
) -> list[str]:
    """Times of the usual samples, cut to so many digits of a second."""
    written = []
    for sample in range(SAMPLES):
        seconds, parts = divmod(FIRST_NS + round((after_s + sample / rate_hz) * 1e9), 10**9)
        day = dt.datetime.fromtimestamp(seconds, dt.UTC).strftime(f"%Y-%m-%d{sep}%H:%M:%S")
        written.append(f"{day}.{parts:09d}"[: 20 + digits] + zone)
    return written


def csv(columns: dict[str, Sequence[Any]]) -> bytes:
    rows = zip(*columns.values(), strict=True)
    return "\n".join([",".join(columns), *(",".join(map(str, row)) for row in rows)]).encode()


def sheet(columns: dict[str, Sequence[Any]]) -> bytes:
    return xlsx({"a": [list(columns), *map(list, zip(*columns.values(), strict=True))]})


def table(columns: dict[str, Sequence[Any]]) -> pa.Table:
    return pa.table({name: pa.array(list(cells)) for name, cells in columns.items()})


WRITERS: dict[str, Writer] = {
    "csv": csv,
    "xlsx": sheet,
    "parquet": lambda columns: parquet(table(columns)),
    "arrow": lambda columns: arrow(table(columns)),
    "words": lambda columns: parquet(table(columns).set_column(0, "timestamp", _encoded(columns))),
}
every_table = pytest.mark.parametrize("write", WRITERS.values(), ids=WRITERS)


def _encoded(columns: dict[str, Sequence[Any]]) -> pa.Array:
    return pa.array(columns["timestamp"]).dictionary_encode()


def columns(times: Sequence[str], heading: str = "timestamp", **others: Sequence[Any]) -> dict[str, Sequence[Any]]:
    """The usual samples beside times, as often as there are times for."""
    values = np.tile(six_axis(), (len(times) // SAMPLES, 1))
    return {heading: times, **others} | {name: column.tolist() for name, column in zip(COLUMNS, values.T, strict=True)}


def rate_of(record: ImpactRecord) -> float | None:
    return record.recording.linear_acceleration.sample_rate_hz


@every_table
@pytest.mark.parametrize("sep", ["T", " "])
@pytest.mark.parametrize("zone", ["Z", "+02:00", ""])
def test_times_with_their_dates_are_those_of_the_samples(write: Writer, sep: str, zone: str):
    record = one(write(columns(stamps(sep=sep, zone=zone))))
    assert rate_of(record) == 1000.0
    assert (record.occurred_at, record.recording.pre_trigger_ms) == (None, None)
    np.testing.assert_array_equal(record.recording.linear_acceleration.values, six_axis()[:, :3])


CLOCKS = ["%H:%M:%S.%f", "%I:%M:%S.%f %p", "%m/%d/%Y %I:%M:%S.%f %p", "%d.%m.%Y %H:%M:%S.%f", "%M:%S.%f"]
NOON = dt.datetime(2026, 11, 20, 11, 59, 59, 990_000, dt.UTC)
"""So that the half of the day changes within an impact."""


def clock(form: str, rate_hz: float = 2000.0, first: dt.datetime = NOON) -> list[str]:
    """Times of the usual samples as a clock shows them."""
    return [(first + dt.timedelta(microseconds=sample * 1e6 / rate_hz)).strftime(form) for sample in range(SAMPLES)]


@every_table
@pytest.mark.parametrize("form", CLOCKS[:-1])
def test_times_of_day_are_those_of_the_samples(write: Writer, form: str):
    record = one(write(columns(clock(form))))
    assert (rate_of(record), record.occurred_at, record.recording.pre_trigger_ms) == (2000.0, None, None)


def test_minutes_and_seconds_are_those_of_the_samples():
    assert rate_of(one(csv(columns(clock("%M:%S.%f", first=NOON.replace(second=3)))))) == 2000.0


def test_thousandths_may_stand_behind_a_colon():
    times = [f"13:04:05:{sample:03}" for sample in range(SAMPLES)]
    assert rate_of(one(csv(columns(times)))) == 1000.0


def test_an_impact_may_go_on_behind_midnight_where_days_are_written():
    first = dt.datetime(2026, 11, 20, 23, 59, 59, 990_000, dt.UTC)
    assert rate_of(one(csv(columns(clock("%d.%m.%Y %H:%M:%S.%f", first=first))))) == 2000.0


@every_table
def test_a_clock_without_a_date_goes_on_behind_midnight(write: Writer):
    first = dt.datetime(2026, 11, 20, 23, 59, 59, 990_000, dt.UTC)
    assert rate_of(one(write(columns(clock("%H:%M:%S.%f", first=first))))) == 2000.0


@pytest.mark.parametrize("step_h", [-3, -20, -22])
def test_a_clock_that_falls_by_less_than_a_day_begins_anew(step_h: int):
    times = clock("%H:%M:%S.%f", first=dt.datetime(2026, 11, 20, 23, 10, tzinfo=dt.UTC))
    times[SAMPLES // 2 :] = [f"{23 + step_h:02}{text[2:]}" for text in times[SAMPLES // 2 :]]
    assert codes(refused(csv(columns(times)))) == [(None, "several-impacts")]


@every_table
@pytest.mark.parametrize("begins", [0.0, -0.01, 86_400.0 - 0.01, 3 * 86_400.0])
def test_times_that_have_passed_are_read_with_their_days(write: Writer, begins: float):
    passed = [dt.timedelta(seconds=begins + n / 2000) for n in range(SAMPLES)]
    assert rate_of(one(write(columns([elapsed_text(time) for time in passed])))) == 2000.0


def test_a_file_has_so_many_days_at_most():
    elapsed = Elapsed()
    days = [f"1/1/{year} 1:00:00.5" for year in range(MAX_DAYS + 2)]
    assert [np.isfinite(elapsed.microseconds(day)) for day in days] == [True] * (MAX_DAYS + 1) + [False]


@every_table
@pytest.mark.parametrize("form", CLOCKS)
def test_a_time_of_day_that_stays_is_the_impact_s(write: Writer, form: str):
    assert rate_of(one(write(columns(clock(form)[:1] * SAMPLES)), sample_rate_hz=1000.0)) == 1000.0


@pytest.mark.parametrize(
    "cell", ["24:00:00.001", "13:61:00.001", "13:04:60.001", "13:04:05.001 PM", "20.11.2026 04:05.001"]
)
def test_what_no_clock_shows_is_no_time(cell: str):
    times = clock("%H:%M:%S.%f")
    times[20] = cell
    assert codes(refused(csv(columns(times)))) == [(None, "missing-sample")]


@every_table
def test_they_are_read_as_a_column_of_parquet_s_own_type_is(write: Writer):
    written = one(write(columns(stamps(3200.0, digits=6))))
    typed = [dt.datetime.fromisoformat(text) for text in stamps(3200.0, digits=6)]
    expected = one(parquet(table(columns(typed))))
    np.testing.assert_allclose(
        written.recording.linear_acceleration.time_s, expected.recording.linear_acceleration.time_s, rtol=0, atol=1e-12
    )
    assert rate_of(written) is None
    assert (written.occurred_at, written.recording.pre_trigger_ms, written.notes) == (
        (expected.occurred_at, expected.recording.pre_trigger_ms, expected.notes)
    )


@every_table
def test_their_nanoseconds_count(write: Writer):
    times = [f"{text[:26]}{(7 * sample) % 1000:03}Z" for sample, text in enumerate(stamps())]
    times[7] = times[7].replace(".120000", ".120031")  # so that they jitter, and stay stamps
    exact = np.array([int(text[20:29]) for text in times]) / 1e9
    stamps_s = one(write(columns(times))).recording.linear_acceleration.time_s
    np.testing.assert_allclose(stamps_s, exact - exact[0], rtol=0, atol=1e-12)


@every_table
def test_impacts_of_one_table_each_have_their_own(write: Writer):
    later = stamps(2000.0, after_s=4e6)
    found = read(write(columns([*stamps(), *later], impact_id=["a"] * SAMPLES + ["b"] * SAMPLES)))
    assert [rate_of(record) for record in found if isinstance(record, ImpactRecord)] == [1000.0, 2000.0]


@every_table
def test_a_first_time_of_whole_seconds_may_leave_its_digits_out(write: Writer):
    times = stamps(digits=3, after_s=0.887)
    assert times[0].endswith(".000Z")
    assert rate_of(one(write(columns([times[0].replace(".000", ""), *times[1:]])))) == 1000.0


@every_table
@pytest.mark.parametrize("digits", [1, 2])
def test_times_that_stand_still_for_want_of_digits_are_refused(write: Writer, digits: int):
    with pytest.raises(TraceError, match="must increase from sample to sample"):
        prepare(one(write(columns(stamps(digits=digits)))).recording)


@every_table
@pytest.mark.parametrize("cell", ["soon", "2026-10-03T14:05:61.113Z", ""])
def test_a_cell_that_is_no_time_is_named(write: Writer, cell: str):
    times = stamps()
    times[20] = cell
    problem = refused(write(columns(times)))
    assert codes(problem) == [(None, "missing-sample")]
    assert "Column 1 (timestamp) has a cell that is not a time with its date, at sample 20" in problem.detail


@every_table
def test_times_of_whole_seconds_are_none_of_samples(write: Writer):
    whole = [text.partition(".")[0] + "Z" for text in stamps()]
    assert codes(refused(write(columns(whole)))) == [("sample_rate_hz", "rate-missing")]
    assert rate_of(one(write(columns(whole)), sample_rate_hz=3200.0)) == 3200.0


@every_table
def test_a_time_that_all_rows_share_is_the_impact_s(write: Writer):
    assert rate_of(one(write(columns(stamps()[:1] * SAMPLES)), sample_rate_hz=2000.0)) == 2000.0


@every_table
def test_a_time_that_all_rows_share_does_not_make_one_impact_of_several(write: Writer):
    several = columns(stamps()[:1] * 2 * SAMPLES, Impact=["1"] * SAMPLES + ["2"] * SAMPLES)
    assert codes(refused(write(several), sample_rate_hz=1000.0)) == [(None, "several-impacts")]


def test_a_rate_beside_them_must_be_theirs():
    text = csv(columns(stamps()))
    assert rate_of(one(text, sample_rate_hz=1001.0)) == 1001.0
    assert codes(refused(text, sample_rate_hz=3200.0)) == [("sample_rate_hz", "rate-differs")]
    without = Mapping.model_validate({"time": None})
    assert rate_of(one(text, sample_rate_hz=3200.0, mapping=without)) == 3200.0


@pytest.mark.parametrize("heading", ["Time", "t", "Time Stamp", "Zeit", "t_ms", "Time (sec)"])
def test_they_bear_any_name_of_times_whatever_unit_that_names(heading: str):
    assert rate_of(one(csv(columns(stamps(), heading)))) == 1000.0


def test_another_name_is_one_if_a_mapping_says_so():
    text = csv(columns(stamps(), "recorded"))
    assert codes(refused(text)) == [("sample_rate_hz", "rate-missing")]
    for unit in ("us", "s"):
        mapping = Mapping.model_validate({"time": {"column": "recorded", "unit": unit}})
        assert rate_of(one(text, mapping=mapping)) == 1000.0


def test_a_device_s_own_column_of_times_may_hold_them():
    rows = np.hstack([six_axis()[:, 3:], six_axis()[:, :3]]).tolist()
    headings = ["t_s", *(f"G{axis}_rad_s" for axis in "XYZ"), *(f"A{axis}_g" for axis in "XYZ")]
    text = "\n".join(
        [",".join(headings), *(",".join([when, *map(str, row)]) for when, row in zip(stamps(), rows, strict=True))]
    )
    record = one(text, preset="headsport")
    assert (rate_of(record), record.metadata["preset"]) == (1000.0, "headsport")


def test_times_in_a_unit_come_before_dates():
    both = columns(stamps()[:1] * SAMPLES, "Time", time_ms=range(-10, 30))
    record = one(csv(both))
    assert (rate_of(record), record.recording.pre_trigger_ms) == (1000.0, 10.0)


def test_no_date_is_the_trigger():
    times = stamps(after_s=-5.0)
    assert one(csv(columns(times))).recording.pre_trigger_ms is None
    problem = refused(csv(columns(times)), mapping=Mapping.model_validate({"zero": "trigger"}))
    assert codes(problem) == [(None, "time-zero")]


def test_two_sensors_have_their_own_on_one_clock():
    own = [stamps(), stamps(after_s=0.0105)]
    rows = zip(own[0], *six_axis().T[:3].tolist(), own[1], *six_axis().T[3:].tolist(), strict=True)
    text = "\n".join(["t,ax_g,ay_g,az_g,t,wx_rad_s,wy_rad_s,wz_rad_s", *(",".join(map(str, row)) for row in rows)])
    recording = one(text).recording
    begin = recording.angular_velocity.time_s[0] - recording.linear_acceleration.time_s[0]
    assert begin == pytest.approx(0.0105, abs=1e-12)


def test_cells_of_a_workbook_s_own_type_are_read():
    book = sheet(columns([text[:23] for text in stamps()]))
    typed = rb'<c r="\1" t="d"><v>\2</v></c>'
    written = rb'<c r="(A[0-9]+)" t="inlineStr"><is><t>(2026[^<]*)</t></is></c>'
    assert rate_of(one(with_part(book, SHEET, lambda part: re.sub(written, typed, part)))) == 1000.0


def test_a_workbook_s_midnight_is_a_time():
    day = dt.datetime(2026, 10, 3, tzinfo=dt.UTC).replace(tzinfo=None)
    cells = [day - dt.timedelta(milliseconds=1), day.date(), day + dt.timedelta(milliseconds=1)]
    block = _Block([0], ["time"], [""], [[cell] for cell in cells])
    table = SheetTable([block], [], [])
    assert table.dated == {0}
    [read_columns] = table.blocks([0], [])
    np.testing.assert_allclose(read_columns.numbers[0], [0.0, 1000.0, 2000.0])
