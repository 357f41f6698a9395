"""Columns of times and rates beside those that are read: one sensor's own, or none of the samples'."""

from __future__ import annotations

from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from typing import Any

import numpy as np
import pytest
from binary_files import COLUMNS, npz, pa, parquet
from ingest_files import GENERIC, codes, one, outcome, read, refused, six_axis
from making import table

from headimpact.preparation import prepare
from headimpact_service.ingest.mapping import Mapping
from headimpact_service.ingest.record import ImpactRecord

SHARED, GYRO = 1.0, 0.5
SIX = list(COLUMNS)


def timed(heading: str, other: Callable[[int], Any] = lambda n: GYRO * n, first: str = "t_ms") -> str:
    """The usual table with its times, and another column of times before the gyroscope's."""
    rows = [[SHARED * n, *row[:3], other(n), *row[3:]] for n, row in enumerate(six_axis().tolist())]
    return table([first, *SIX[:3], heading, *SIX[3:]], rows)


def rates(record: ImpactRecord) -> list[float]:
    return [
        signal.sample_rate_hz or round(1.0 / float(np.diff(signal.time_s).mean()), 6)
        for _, signal in record.recording.signals()
    ]


def gyro_time(heading: str, unit: str = "ms") -> Mapping:
    return Mapping.model_validate({"angular_velocity": {"time": {"column": heading, "unit": unit}}})


@pytest.mark.parametrize(
    "heading",
    [
        "Gyro Time (ms)",
        "t_gyro_ms",
        "gyro_time_ms",
        "Time_ARS (ms)",
        "Angular Time (ms)",
        "GyroTime_ms",
        "time ang [ms]",
    ],
)
def test_times_that_name_a_sensor_are_its_own(heading: str):
    assert rates(one(timed(heading))) == [1000.0, 2000.0]


def test_each_sensor_may_have_times_and_none_be_shared():
    assert rates(one(timed("Gyro Time (ms)", first="Accel Time (ms)"))) == [1000.0, 2000.0]


@pytest.mark.parametrize(
    ("heading", "unit", "factor"),
    [("Time 2 (ms)", "ms", 1), ("t2_ms", "ms", 1), ("t_b_us", "us", 1000), ("Elapsed B (s)", "s", 0.001)],
)
def test_times_at_which_no_signal_is_read_are_refused_until_a_mapping_says_whose(
    heading: str, unit: str, factor: float
):
    text = timed(heading, lambda n: round(GYRO * n * factor, 9))
    problem = refused(text)
    assert codes(problem) == [("sample_rate_hz", "rate-differs")]
    assert f"The column {heading} says 2000 samples per second" in problem.detail
    assert rates(one(text, mapping=gyro_time(heading, unit))) == [1000.0, 2000.0]
    shared = Mapping.model_validate({"time": {"column": "t_ms", "unit": "ms"}})
    assert rates(one(text, mapping=shared)) == [1000.0, 1000.0]


def test_a_preset_s_table_with_times_of_one_sensor_is_refused_too():
    names = ["time_ms", "Ah_x", "Ah_y", "Ah_z", "time_gyro_ms", "W_x", "W_y", "W_z"]
    rows = [[SHARED * n, *row[:3], GYRO * n, *row[3:]] for n, row in enumerate(six_axis().tolist())]
    text = table(names, rows)
    assert codes(refused(text, preset="biocore")) == [("sample_rate_hz", "rate-differs")]
    assert rates(one(text, preset="biocore", mapping=gyro_time("time_gyro_ms"))) == [1000.0, 2000.0]


@pytest.mark.parametrize("form", ["lists", "rows", "npz"])
def test_it_is_the_same_in_every_format(form: str):
    values, steps = six_axis(), np.arange(40)
    columns: dict[str, Any] = {"t_ms": SHARED * steps, "t2_ms": GYRO * steps} | dict(zip(SIX, values.T, strict=True))
    data = {
        "rows": lambda: parquet(pa.table(columns)),
        "lists": lambda: parquet(pa.table({name: [column] for name, column in columns.items()})),
        "npz": lambda: npz(**columns),
    }[form]()
    assert codes(refused(data)) == [("sample_rate_hz", "rate-differs")]
    assert rates(one(data, mapping=gyro_time("t2_ms"))) == [1000.0, 2000.0]


@pytest.mark.parametrize(
    "other",
    [
        lambda n: 12.5,  # the time of a peak
        lambda n: 1.7e12 + n,  # the same clock, counted from 1970
        lambda n: 1.7e12 + 1.01 * n,  # another clock, which is slower
        lambda n: "" if n else 3.0,
        lambda n: "13:04:05",
        lambda n: [5.0, 4.0][n % 2],
    ],
)
def test_what_is_no_other_clock_of_the_samples_is_passed_over(other: Callable[[int], Any]):
    assert rates(one(timed("Event Time (ms)", other))) == [1000.0, 1000.0]


@pytest.mark.parametrize(
    "heading", ["gyro_sample_rate_hz", "angular_velocity_sample_rate_hz", "Sampling Frequency (Hz)"]
)
def test_a_rate_at_which_no_signal_is_read_is_refused(heading: str):
    def with_rate(rate: float) -> str:
        return table(["t_ms", *SIX, heading], [[n, *row, rate] for n, row in enumerate(six_axis().tolist())])

    problem = refused(with_rate(2000))
    assert codes(problem) == [("sample_rate_hz", "rate-differs")]
    assert heading in problem.detail
    assert rates(one(with_rate(1000))) == [1000.0, 1000.0]
    own = Mapping.model_validate({"angular_velocity": {"sample_rate_hz": 2000}})
    assert rates(one(with_rate(2000), mapping=own)) == [1000.0, 2000.0]


@pytest.mark.parametrize(("said", "code"), [("1", None), ("2", "rate-differs"), ("", None), ("fast", None)])
def test_a_rate_may_be_in_kilohertz_or_no_number(said: str, code: str | None):
    rows = [[n, *row, said] for n, row in enumerate(six_axis().tolist())]
    text = table(["t_ms", *SIX, "Sampling rate [kHz]"], rows)
    if code is None:
        assert rates(one(text)) == [1000.0, 1000.0]
    else:
        assert codes(refused(text)) == [("sample_rate_hz", code)]


def test_rates_of_each_sensor_in_a_row_an_impact_are_not_mixed_up():
    lists = dict(zip(SIX, ([column.tolist()] for column in six_axis().T), strict=True))
    columns: dict[str, Any] = {"sample_rate_hz": [1600.0], "gyro_sample_rate_hz": [2000.0]} | lists
    assert codes(refused(parquet(pa.table(columns)))) == [("sample_rate_hz", "rate-differs")]
    own = Mapping.model_validate({"angular_velocity": {"sample_rate_hz": 2000}})
    assert rates(one(parquet(pa.table(columns)), mapping=own)) == [1600.0, 2000.0]


NAMED: dict[str, Any] = {
    "linear_acceleration": {"unit": "g", "x": "HX", "y": "HY", "z": "HZ"},
    "angular_velocity": {"unit": "rad/s", "x": "RX", "y": "RY", "z": "RZ"},
}


@pytest.mark.parametrize(("heading", "scale"), [("Time (ms)", 1.0), ("t_s", 0.001), ("time_us", 1000.0)])
def test_a_mapping_of_signals_leaves_the_file_s_own_times_in_force(heading: str, scale: float):
    rows = [[round((n - 10) * scale, 9), *row] for n, row in enumerate(six_axis().tolist())]
    text = table([heading, "HX", "HY", "HZ", "RX", "RY", "RZ"], rows)
    record = one(text, mapping=Mapping.model_validate(NAMED))
    assert rates(record) == [1000.0, 1000.0]
    assert record.recording.pre_trigger_ms == 10.0
    assert codes(refused(text, mapping=Mapping.model_validate(NAMED), sample_rate_hz=2000.0)) == [
        ("sample_rate_hz", "rate-differs")
    ]
    without = Mapping.model_validate(NAMED | {"time": None})
    assert rates(one(text, mapping=without, sample_rate_hz=2000.0)) == [2000.0, 2000.0]


def test_a_mapping_of_signals_leaves_the_file_s_names_in_force():
    headings = ["external_id", "athlete_id", "occurred_at", "t_ms", "HX", "HY", "HZ", "RX", "RY", "RZ"]
    rows = [
        [name, athlete, "2026-11-20T19:04:05Z", n, *row]
        for name, athlete in (("e-1", "p-17"), ("e-2", "p-18"))
        for n, row in enumerate(six_axis().tolist())
    ]
    found = read(table(headings, rows), mapping=Mapping.model_validate(NAMED))
    assert [(record.external_id, record.athlete_external_id) for record in found] == [("e-1", "p-17"), ("e-2", "p-18")]
    assert {str(record.occurred_at) for record in found} == {"2026-11-20 19:04:05+00:00"}


def test_rates_of_both_sensors_that_the_shared_times_gainsay_are_refused():
    own = {"linear_acceleration": {"sample_rate_hz": 2000}, "angular_velocity": {"sample_rate_hz": 2000}}
    rows = [[n, *row] for n, row in enumerate(six_axis().tolist())]
    text = table(["t_ms", *SIX], rows)
    problem = refused(text, mapping=Mapping.model_validate(own))
    assert codes(problem) == [("sample_rate_hz", "rate-differs")]
    assert rates(one(text, mapping=Mapping.model_validate(own | {"time": None}))) == [2000.0, 2000.0]
    own["angular_velocity"]["sample_rate_hz"] = 1000
    assert rates(one(text, mapping=Mapping.model_validate(own))) == [2000.0, 1000.0]


@pytest.mark.parametrize("stamp", ["inf", "-inf", "1e400"])
def test_times_that_run_to_infinity_are_a_fault_of_the_impact(stamp: str):
    rows = [[stamp if n in {20, 21} else n, *row] for n, row in enumerate(six_axis().tolist())]
    assert codes(refused(table(["t_ms", *SIX], rows))) == [(None, "missing-sample")]


@pytest.mark.parametrize(
    ("first", "second"),
    [
        ("Time (ms)", "Time from Trigger (ms)"),
        ("t_ms", "Relative Time (ms)"),
        ("Elapsed (ms)", "time since trigger_ms"),
    ],
)
@pytest.mark.parametrize("swapped", [False, True])
def test_times_from_the_trigger_count_whatever_they_are_called(first: str, second: str, swapped: bool):
    columns = {first: lambda n: n, second: lambda n: n - 10}
    names = sorted(columns, reverse=swapped)
    rows = [[*(columns[name](n) for name in names), *row] for n, row in enumerate(six_axis().tolist())]
    record = one(table([*names, *SIX], rows))
    assert record.recording.pre_trigger_ms == 10.0
    assert rates(record) == [1000.0, 1000.0]
    assert [note.code for note in record.notes] == ["time_origin_mismatch"]


def test_a_clock_that_counts_from_1970_beside_the_times_is_no_finding():
    record = one(timed("timestamp_ms", lambda n: 1.7e12 + n))
    assert record.notes == ()
    assert record.recording.pre_trigger_ms is None


@pytest.mark.parametrize("first", ["t_ms", "Time (ms)"])
def test_a_data_frame_s_second_column_of_one_name_is_the_second_sensor_s(first: str):
    assert rates(one(timed(f"{first}.1", first=first))) == [1000.0, 2000.0]


@pytest.mark.parametrize(
    "heading", ["t_ms_2", "Time (ms)_1", "Time (ms) 2", "t_ms_y", "tg_ms", "gyro_ms", "gyrotime_ms", "Clock Gyro (ms)"]
)
def test_times_are_seen_wherever_the_unit_stands(heading: str):
    assert codes(refused(timed(heading))) == [("sample_rate_hz", "rate-differs")]
    assert rates(one(timed(heading), mapping=gyro_time(heading))) == [1000.0, 2000.0]


@pytest.mark.parametrize(
    "heading", ["Mag Time (ms)", "baro_time_ms", "High-G Time (ms)", "Video time (ms)", "vel_x_m_s"]
)
def test_what_is_of_no_signal_is_no_clock(heading: str):
    assert rates(one(timed(heading, lambda n: 10.0 * n))) == [1000.0, 1000.0]


@pytest.mark.parametrize(
    ("heading", "is_rate"),
    [
        ("gyro_fs", True),
        ("fs_gyro", True),
        ("gyro_rate_hz", True),
        ("Gyro Rate", True),
        ("gyro_hz", True),
        ("samples_per_second", True),
        ("SampleFreq", True),
        ("ODR", True),
        ("Sampling (Hz)", True),
        ("Video Sample Rate (Hz)", False),
        ("Mag Sample Rate (Hz)", False),
        ("Original sample rate", False),
        ("Filter Frequency (Hz)", False),
        ("gyro_fs_dps", False),
    ],
)
def test_columns_of_rates_are_those_of_the_samples(heading: str, is_rate: bool):
    rows = [[*row, 1000, 2000] for row in six_axis().tolist()]
    text = table([*SIX, "fs", heading], rows)
    if is_rate:
        assert codes(refused(text)) == [("sample_rate_hz", "rate-differs")]
    else:
        assert rates(one(text)) == [1000.0, 1000.0]
    assert rates(one(text, mapping=Mapping.model_validate({"time": None}))) == [1000.0, 1000.0]


def test_without_a_rate_of_that_name_a_gyroscope_s_fs_is_its_full_scale():
    rows = [[*row, 2000] for row in six_axis().tolist()]
    assert rates(one(table([*SIX, "gyro_fs"], rows), sample_rate_hz=1000.0)) == [1000.0, 1000.0]


def stamped(step_ms: float) -> Callable[[int], str]:
    """Dates with times of day, a sample each."""
    first = datetime(2026, 10, 3, 14, 5, 22, tzinfo=UTC)
    return lambda n: (first + timedelta(milliseconds=step_ms * n)).isoformat(timespec="microseconds")


@pytest.mark.parametrize("heading", ["gyro_timestamp", "Gyro Time", "timestamp_gyro"])
def test_dates_that_name_a_sensor_are_its_own_times(heading: str):
    rows = [[stamped(1.0)(n), *row[:3], stamped(0.5)(n), *row[3:]] for n, row in enumerate(six_axis().tolist())]
    assert rates(one(table(["timestamp", *SIX[:3], heading, *SIX[3:]], rows))) == [1000.0, 2000.0]


@pytest.mark.parametrize("heading", ["t2", "recorded_at", "Timestamp (UTC)", "Date"])
@pytest.mark.parametrize("form", ["csv", "parquet"])
def test_dates_at_which_no_signal_is_read_are_refused(heading: str, form: str):
    def written(step_ms: float) -> str | bytes:
        columns: dict[str, list[Any]] = {"t_ms": [SHARED * n for n in range(40)]}
        columns |= dict(zip(SIX, six_axis().T.tolist(), strict=True))
        columns[heading] = [stamped(step_ms)(n) for n in range(40)]
        if form == "csv":
            return table(list(columns), list(zip(*columns.values(), strict=True)))
        columns[heading] = [datetime.fromisoformat(text) for text in columns[heading]]
        return parquet(pa.table(columns))

    assert codes(refused(written(0.5))) == [("sample_rate_hz", "rate-differs")]
    assert rates(one(written(1.0))) == [1000.0, 1000.0]


@pytest.mark.parametrize("heading", ["datetime", "Timestamp (UTC)", "recorded_at", "Date"])
def test_a_rate_is_held_against_dates_of_any_name(heading: str):
    rows = [[stamped(0.5)(n), *row] for n, row in enumerate(six_axis().tolist())]
    text = table([heading, *SIX], rows)
    assert codes(refused(text, sample_rate_hz=1000.0)) == [("sample_rate_hz", "rate-differs")]
    assert rates(one(text, sample_rate_hz=2000.0)) == [2000.0, 2000.0]


@pytest.mark.parametrize(
    "line", ["Sample rate (Hz),2000", "Sampling Frequency,2000,Hz", "fs,2000", "Sampling rate [kHz],2"]
)
def test_a_rate_that_a_line_above_the_headings_states_is_held_against_the_one_beside_the_file(line: str):
    below = table(SIX, six_axis().tolist())
    text = f"Device,MG 7\n{line}\n".encode() + below
    problem = refused(text, sample_rate_hz=1000.0)
    assert codes(problem) == [("sample_rate_hz", "rate-differs")]
    assert "The line" in problem.detail
    assert rates(one(text, sample_rate_hz=2000.0)) == [2000.0, 2000.0]
    filtered = b"Device,MG 7\nFilter frequency (Hz),300\n" + below
    assert rates(one(filtered, sample_rate_hz=1000.0)) == [1000.0, 1000.0]


@pytest.mark.parametrize("heading", ["Event Time (s)", "t2", "Time since trigger (s)"])
def test_numbers_that_are_beyond_all_times_are_an_answer_and_no_error(heading: str):
    for other in (lambda n: 1e305 * (n + 1), lambda n: -1e306 + 1e304 * n, lambda n: 1e-300 * n):
        for item in outcome(timed(heading, other)):
            assert isinstance(item, ImpactRecord) or item.status == 422


@pytest.mark.parametrize(
    "heading", ["Gyro dt (ms)", "dt_ms", "Sample interval (ms)", "gyro_period_ms", "sampling step ms"]
)
def test_a_period_at_which_no_signal_is_read_is_refused(heading: str):
    rows = [[n, *row, 0.5] for n, row in enumerate(six_axis().tolist())]
    assert codes(refused(table(["t_ms", *SIX, heading], rows))) == [("sample_rate_hz", "rate-differs")]
    rows = [[*row[:-1], 1.0] for row in rows]
    assert rates(one(table(["t_ms", *SIX, heading], rows))) == [1000.0, 1000.0]


@pytest.mark.parametrize("heading", ["sps", "gyro_sps", "Abtastrate (Hz)", "Logging rate", "Gyro Samples per second"])
def test_more_words_for_rates_are_known(heading: str):
    rows = [[n, *row, 2000] for n, row in enumerate(six_axis().tolist())]
    assert codes(refused(table(["t_ms", *SIX, heading], rows))) == [("sample_rate_hz", "rate-differs")]


@pytest.mark.parametrize(
    "heading", ["t_rel_ms", "Time re trigger (ms)", "Trigger Time (ms)", "Time after contact (ms)"]
)
def test_times_that_name_the_trigger_count_from_it(heading: str):
    record = one(timed(heading, lambda n: n - 10))
    assert record.recording.pre_trigger_ms == 10.0
    assert [note.code for note in record.notes] == ["time_origin_mismatch"]


def test_lists_of_samples_that_are_called_a_rate_are_no_rate():
    lists = dict(zip(SIX, ([column.tolist()] for column in six_axis().T), strict=True))
    columns: dict[str, Any] = {
        "t_ms": [[float(n) for n in range(40)]],
        "Gyro Rate (Hz)": [[float(n) for n in range(40)]],
    }
    assert rates(one(parquet(pa.table(columns | lists)))) == [1000.0, 1000.0]


@pytest.mark.parametrize("lost", [1, 14, 50, 85, 98])
@pytest.mark.parametrize(("rate_hz", "digits"), [(1000, 0), (1000, 3), (2000, 1), (500, 0), (3200, 4)])
def test_a_rate_does_not_make_up_for_a_lost_sample(lost: int, rate_hz: int, digits: int):
    times = [f"{sample * 1000 / rate_hz - 10:.{digits}f}" for sample in range(100)]
    lines = [",".join([time, *map(str, row)]) for time, row in zip(times, six_axis(100).tolist(), strict=True)]
    heading = GENERIC.replace("t_s", "t_ms")
    assert rates(one("\n".join([heading, *lines]), sample_rate_hz=float(rate_hz))) == [rate_hz] * 2
    without = "\n".join([heading, *lines[:lost], *lines[lost + 1 :]])
    assert codes(refused(without, sample_rate_hz=float(rate_hz))) == [("sample_rate_hz", "rate-differs")]
    stated = Mapping.model_validate({"sample_rate_hz": rate_hz})
    assert codes(refused(without, mapping=stated)) == [("sample_rate_hz", "rate-differs")]
    column = [f"{line},{rate_hz}" for line in without.split("\n")[1:]]
    in_rows = "\n".join([f"{heading},sample_rate_hz", *column])
    assert codes(refused(in_rows)) == [("sample_rate_hz", "rate-differs")]


@pytest.mark.parametrize(("said", "noted"), [(30, True), (10, False)])
def test_times_that_go_through_zero_at_another_time_than_the_trigger_are_noted(said: int, noted: bool):
    rows = [[sample - 10, *row] for sample, row in enumerate(six_axis(100).tolist())]
    record = one(table(["t_ms", *SIX], rows), mapping=Mapping.model_validate({"pre_trigger_ms": said}))
    assert record.recording.pre_trigger_ms == said
    assert [note.code for note in record.notes] == ["time_origin_mismatch"] * noted


@pytest.mark.parametrize(("rate_hz", "digits"), [(1600.0, 1), (3200.0, 1), (1000.0, 0), (1666.0, 1)])
@pytest.mark.parametrize("missing", [(30,), (30, 31), (30, 60)])
def test_a_gap_among_rounded_stamps_beside_a_rate_is_filled_where_that_is_asked(rate_hz, digits, missing):
    kept = [n for n in range(100) if n not in missing]
    samples = six_axis(100)
    rows = [f"{round(n * 1000.0 / rate_hz, digits)},{','.join(map(repr, samples[n].tolist()))}" for n in kept]
    text = "\n".join(["t_ms,ax_g,ay_g,az_g,wx_rad_s,wy_rad_s,wz_rad_s", *rows])
    assert codes(refused(text, sample_rate_hz=rate_hz)) == [("sample_rate_hz", "rate-differs")]
    found = prepare(one(text, sample_rate_hz=rate_hz, fill_gaps=True).recording)
    assert found.motion.samples == 100
    assert found.motion.sample_rate_hz == pytest.approx(rate_hz, rel=1e-9)
    assert {note.code for note in found.notes} >= {"gaps_filled"}


def test_a_longer_gap_among_rounded_stamps_is_refused_as_before():
    kept = [n for n in range(100) if n not in range(30, 33)]
    samples = six_axis(100)
    rows = [f"{round(n / 1.6, 1)},{','.join(map(repr, samples[n].tolist()))}" for n in kept]
    text = "\n".join(["t_ms,ax_g,ay_g,az_g,wx_rad_s,wy_rad_s,wz_rad_s", *rows])
    assert codes(refused(text, sample_rate_hz=1600.0, fill_gaps=True)) == [("sample_rate_hz", "rate-differs")]
