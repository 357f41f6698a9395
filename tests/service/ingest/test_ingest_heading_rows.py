"""What stands above a table's samples: headings, a row of units, a program's own lines; and how times are counted."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from binary_files import pa, parquet, xlsx
from ingest_files import GENERIC, codes, csv_text, one, read, refused, six_axis

from headimpact.preparation import prepare
from headimpact_service.ingest.mapping import Mapping
from headimpact_service.ingest.record import ImpactRecord

UNITS = "s,g,g,g,rad/s,rad/s,rad/s"


def samples_of(record: ImpactRecord) -> np.ndarray:
    recording = record.recording
    assert recording.linear_acceleration is not None
    assert recording.angular_velocity is not None
    return np.concatenate((recording.linear_acceleration.values, recording.angular_velocity.values), axis=1)


def with_rows(*rows: str, headings: str = GENERIC) -> str:
    """The usual table with rows of its own in place of its headings."""
    return "\n".join([*rows, *csv_text(heading=headings).splitlines()[1:]])


class TestTop:
    """What stands above the samples."""

    WORDS = "Time,Accel X,Accel Y,Accel Z,Gyro X,Gyro Y,Gyro Z"

    @pytest.mark.parametrize(
        "units",
        [UNITS, "[s],[g],[g],[g],[rad/s],[rad/s],[rad/s]", "(s),(g),(g),(g),(rad/s),(rad/s),(rad/s)", f"{UNITS},"],
    )
    def test_a_row_of_units_below_the_headings_is_one(self, units):
        record = one(with_rows(self.WORDS, units))
        expected = one(csv_text())
        assert np.array_equal(samples_of(record), samples_of(expected))
        assert record.recording.angular_velocity.unit == "rad/s"

    @pytest.mark.parametrize(
        "rows",
        [
            ("Time (s),Linear acceleration (g),,,Angular velocity (rad/s),,", ",x,y,z,x,y,z"),
            (",Linear acceleration (g),,,Angular velocity (rad/s),,", "Time (s),x,y,z,x,y,z"),
            ("Time (s),Linear acceleration,,,Angular velocity,,", ",x (g),y (g),z (g),x (rad/s),y (rad/s),z (rad/s)"),
            ("Time,Linear acceleration,,,Angular velocity,,", "s,X [g],Y [g],Z [g],X [rad/s],Y [rad/s],Z [rad/s]"),
            ("Time,Linear acceleration,,,Angular velocity,,", ",x,y,z,x,y,z", UNITS),
            ("Time (s),Linear acceleration (g),,,Angular velocity (rad/s),,", "s,X axis,Y-axis,Z_axis,x,y,z"),
            ("Mine,,,,,,", "Time (s),Linear acceleration (g),,,Angular velocity (rad/s),,", ",x,y,z,x,y,z"),
        ],
    )
    def test_a_quantity_that_stands_once_above_its_axes_is_each_one_s(self, rows):
        expected = samples_of(one(csv_text()))
        assert np.array_equal(samples_of(one(with_rows(*rows))), expected)
        cells = [[cell or None for cell in row.split(",")] for row in rows]
        samples = [[index / 1000, *row] for index, row in enumerate(six_axis().tolist())]
        assert np.array_equal(samples_of(one(xlsx({"a": [*cells, *samples]}))), expected)

    @pytest.mark.parametrize("above", ["Export of sensor 7,,,,,,", "Export,,,left,,,", "a,b,c,d,e,f,g"])
    def test_any_other_row_above_the_headings_is_none_of_theirs(self, above):
        columns = {"unit": "g", "x": "x", "y": "y", "z": "z"}
        mapping = Mapping.model_validate({"linear_acceleration": columns, "time": {"column": "Time (s)", "unit": "s"}})
        text = with_rows(above, "Time (s),x,y,z,other,another,third")
        assert one(text, mapping=mapping.model_copy(update={"skip_rows": 1})).recording.linear_acceleration is not None
        if above.startswith("Export of"):
            assert one(text, mapping=mapping).recording.linear_acceleration is not None

    def test_units_in_both_places_are_said_twice(self):
        assert samples_of(one(with_rows(GENERIC, UNITS))).shape == (40, 6)

    def test_units_that_are_not_known_are_no_row_of_units(self):
        problem = refused(with_rows(GENERIC, "V,V,V,V,V,V,V"))
        assert "Line 2 holds words in every column of numbers" in problem.detail

    def test_a_mapping_names_the_headings_above_a_row_of_units(self):
        columns = {"unit": "g", "x": "Accel X", "y": "Accel Y", "z": "-Accel Z"}
        mapping = Mapping.model_validate({"linear_acceleration": columns, "time": {"column": "Time", "unit": "s"}})
        found = one(with_rows(self.WORDS, UNITS), mapping=mapping).recording.linear_acceleration
        assert found is not None
        assert np.array_equal(found.values, six_axis()[:, :3] * [1, 1, -1])

    @pytest.mark.parametrize(
        "above",
        [
            ["Recording of 2024"],
            ["Device: X1", "Serial: 42", "Sample Rate: 1000", ""],
            ["Device,X1", "Sample Rate,1000", ""],
            ["Device,X1,,,,,", "Rate,1000,,,,,"],
            ["Head,,,,,,"],
        ],
    )
    @pytest.mark.parametrize("delimiter", [",", ";", "\t"])
    def test_words_above_the_headings_are_passed_over(self, above, delimiter):
        text = "\n".join([*above, csv_text()]).replace(",", delimiter)
        assert np.array_equal(samples_of(one(text)), samples_of(one(csv_text())))

    def test_rows_below_the_headings_are_counted_from_there(self):
        lines = csv_text().splitlines()
        lines[5] = lines[5] + ",1"
        assert "in line 6 has 8 cells" in refused("\n".join(lines)).detail
        above = ["Device: X1", "", lines[0], UNITS]
        assert "in line 9 has 8 cells" in refused("\n".join([*above, *lines[1:]])).detail

    def test_headings_may_go_on_over_lines(self):
        heading = ",".join(f'"{name.replace("_", chr(10), 1)}"' for name in GENERIC.split(","))
        lines = csv_text().splitlines()[1:]
        assert np.array_equal(samples_of(one("\n".join([heading, *lines]))), samples_of(one(csv_text())))
        lines[4] += ",1"
        assert "in line 13 has 8 cells" in refused("\n".join([heading, *lines])).detail

    def test_a_row_s_line_is_that_of_the_file_though_cells_go_on_over_lines(self):
        lines = [f'{line},"a{chr(10)}b"' for line in csv_text().splitlines()]
        lines[0] = lines[0].replace('"a\nb"', "note")
        lines[5] += ",1"
        assert "in line 11 has 9 cells" in refused("\n".join(lines)).detail

    def test_headings_that_stand_again_where_files_were_joined_are_passed_over(self):
        first, *rest = csv_text().splitlines()
        heading, lines = f"impact_id,{first}", [f"{number // 20},{line}" for number, line in enumerate(rest)]
        text = "\n".join([heading, *lines[:20], heading, *lines[20:]])
        assert [len(samples_of(record)) for record in read(text)] == [20, 20]

    def test_headings_that_stand_again_where_nothing_tells_impacts_apart_are_refused(self):
        lines = [line.partition(",")[2] for line in csv_text().splitlines()]
        problem = refused("\n".join([*lines, *lines]), sample_rate_hz=1000.0)
        assert codes(problem) == [(None, "several-impacts")]

    @pytest.mark.parametrize("other", ["t_s,ay_g,ax_g,az_g,wx_rad_s,wy_rad_s,wz_rad_s", "t,a,b,c,d,e,f"])
    def test_other_headings_among_the_samples_end_the_file(self, other):
        lines = csv_text(before={"impact_id": "1"}).splitlines()
        more = csv_text(before={"impact_id": "2"}).splitlines()[1:]
        assert "Line 42 holds words" in refused("\n".join([*lines, f"impact_id,{other}", *more])).detail

    def test_a_first_row_of_cells_that_hold_nothing_is_no_heading(self):
        lines = csv_text().splitlines()
        problem = refused("\n".join([lines[0], "NA,NA,NA,NA,NA,NA,NA", *lines[1:]]))
        assert codes(problem) == [(None, "missing-sample")]

    def test_numbers_without_headings_are_refused(self):
        problem = refused("\n".join(csv_text().splitlines()[1:]))
        assert problem.slug == "unreadable-file"


def test_times_may_be_nanoseconds():
    text = csv_text().replace("t_s", "timestamp_ns", 1)
    heading, *lines = text.splitlines()
    stamped = [f"{1_700_000_000_000_000_000 + n * 1_000_000},{line.partition(',')[2]}" for n, line in enumerate(lines)]
    record = one("\n".join([heading, *stamped]))
    assert prepare(record.recording).kinematics.sample_rate_hz == 1000.0


def test_a_column_of_times_counts_beside_the_columns_of_a_device_that_has_none():
    heading = "Time (ms),Linear Accel X (g),Linear Accel Y (g),Linear Accel Z (g)"
    heading += ",Rotational Vel X (rad/s),Rotational Vel Y (rad/s),Rotational Vel Z (rad/s)"
    heading += ",Rotational Accel X (rad/s^2),Rotational Accel Y (rad/s^2),Rotational Accel Z (rad/s^2)"
    record = one(csv_text(np.hstack([six_axis(), six_axis()[:, 3:]]), heading=heading, rate_hz=2.0))
    assert record.metadata["preset"] == "athlete_intelligence"
    assert prepare(record.recording).kinematics.sample_rate_hz == 2000.0


def test_units_below_the_headings_are_those_of_a_mapping_s_columns():
    named = {"x": "Accel X", "y": "Accel Y", "z": "Accel Z"}
    clock = {"column": "Time", "unit": "s"}
    text = with_rows(TestTop.WORDS, UNITS)

    def mapped(**fields):
        return Mapping.model_validate({"linear_acceleration": named, "time": clock} | fields)

    assert one(text, mapping=mapped()).recording.linear_acceleration.unit == "g"
    other = mapped(linear_acceleration=named | {"unit": "m/s^2"})
    assert codes(refused(text, mapping=other))[0][1] == "units-differ"
    assert codes(refused(text, mapping=mapped(time={"column": "Time", "unit": "ms"})))[0][1] == "units-differ"


@pytest.mark.parametrize("unit", ["rad s-1", "rad·s⁻¹", "rad.s-1", "rad/s"])
def test_units_may_be_written_with_exponents(unit):
    assert one(csv_text(heading=GENERIC.replace("_rad_s", f" [{unit}]"))).recording.angular_velocity.unit == "rad/s"


@pytest.mark.parametrize("unit", ["deg·s⁻¹", "º/s", "°/s", "degrees/s"])
def test_degrees_may_be_written_with_exponents(unit):
    assert one(csv_text(heading=GENERIC.replace("_rad_s", f" [{unit}]"))).recording.angular_velocity.unit == "deg/s"


def twice_timed(
    other_ms: Callable[[int], float],
    heading: str = "time_s",
    first: str = "time_ms",
    of_ms: Callable[[int], float] = lambda n: n - 10,
) -> str:
    """The usual table with two columns of times."""
    _, *lines = csv_text().splitlines()
    columns = GENERIC.partition(",")[2]
    rows = [f"{of_ms(n)},{other_ms(n) / 1000:.6f},{line.partition(',')[2]}" for n, line in enumerate(lines)]
    return "\n".join([f"{first},{heading},{columns}", *rows])


def test_two_columns_of_times_that_agree_are_one_clock():
    record = one(twice_timed(lambda n: n - 10))
    assert record.recording.pre_trigger_ms == 10.0
    assert prepare(record.recording).kinematics.sample_rate_hz == 1000.0


@pytest.mark.parametrize("other", [lambda n: 2 * (n - 10), lambda n: n - 20, lambda n: n - 10 + 5 * (n > 30)])
def test_two_columns_of_times_that_do_not_agree_are_refused(other):
    problem = refused(twice_timed(other))
    assert codes(problem) == [(None, "times-differ")]
    assert "Columns 1 and 2" in problem.detail
    chosen = Mapping.model_validate({"time": {"column": "time_ms", "unit": "ms"}})
    assert one(twice_timed(other), mapping=chosen).recording.pre_trigger_ms == 10.0


@pytest.mark.parametrize(
    ("first", "second", "read", "before"),
    [
        (lambda n: n - 10, lambda n: n, 1, 10.0),
        (lambda n: n, lambda n: n - 10, 2, 10.0),
        (lambda n: n - 10, lambda n: n + 3_600_000, 1, 10.0),
        (lambda n: n, lambda n: n + 5, 1, None),
        (lambda n: n - 50, lambda n: n, 1, None),
    ],
)
def test_of_times_from_two_origins_those_from_the_trigger_are_read(first, second, read, before):
    record = one(twice_timed(second, of_ms=first))
    assert (record.recording.pre_trigger_ms, record.recording.linear_acceleration.sample_rate_hz) == (before, 1000.0)
    (note,) = record.notes
    assert (note.code, note.severity) == ("time_origin_mismatch", "note")
    assert f"{first(0):g} ms" in note.detail
    assert f"{second(0):g} ms" in note.detail
    assert note.detail.endswith(f"column {read} was read.")


def test_origins_that_leave_the_trigger_unclear_are_both_named():
    problem = refused(twice_timed(lambda n: n - 20))
    assert "from -10 ms and from -20 ms, so that the trigger is not clear: say in a mapping" in problem.detail
    zero = Mapping.model_validate({"zero": "trigger"})
    assert codes(refused(twice_timed(lambda n: n), mapping=zero)) == [(None, "times-differ")]
    beside = Mapping.model_validate({"pre_trigger_ms": 7.5})
    assert one(twice_timed(lambda n: n), mapping=beside).recording.pre_trigger_ms == 7.5


def test_an_event_s_stamps_beside_the_samples_times_are_no_second_clock():
    record = one(twice_timed(lambda n: 1.7e12, heading="timestamp_s", first="t_ms"))
    assert record.recording.pre_trigger_ms == 10.0


@pytest.mark.parametrize(
    "heading",
    [
        "Zeit [s]",
        "elapsed (s)",
        "Elapsed Time (s)",
        "Time from trigger (s)",
        "rel_time_s",
        "Time After Impact (s)",
        "t in s",
    ],
)
def test_times_have_many_names(heading):
    record = one(csv_text(heading=GENERIC.replace("t_s", heading)))
    assert record.recording.linear_acceleration.sample_rate_hz == 1000.0
    assert (
        codes(refused(csv_text(heading=GENERIC.replace("t_s", heading)), sample_rate_hz=2000.0))[0][1] == "rate-differs"
    )


def test_units_below_headings_that_name_others_are_refused():
    problem = refused(with_rows(GENERIC, "s,m/s2,m/s2,m/s2,rad/s,rad/s,rad/s"))
    assert codes(problem)[0][1] == "units-differ"
    assert "in g and in m/s^2" in problem.detail


@pytest.mark.parametrize("rate", [1024.0, 975.0])
def test_a_rate_that_is_not_that_of_the_stamps_is_refused(rate):
    assert codes(refused(csv_text(rate_hz=rate), sample_rate_hz=1000.0)) == [("sample_rate_hz", "rate-differs")]


def test_each_sensor_may_have_its_own_column_of_one_heading():
    lines = csv_text().splitlines()[1:]
    rows = [
        ",".join([f"{n}", *line.split(",")[1:4], f"{n / 2 + 3}", *line.split(",")[4:]]) for n, line in enumerate(lines)
    ]
    record = one("\n".join(["Time (ms),ax_g,ay_g,az_g,Time (ms),wx_rad_s,wy_rad_s,wz_rad_s", *rows]))
    a, w = record.recording.linear_acceleration, record.recording.angular_velocity
    assert w.time_s[0] - a.time_s[0] == pytest.approx(0.003)
    assert w.time_s[1] - w.time_s[0] == pytest.approx(0.0005)


@pytest.mark.parametrize(
    "line",
    [
        "Sample rate (Hz),2000",
        "Sample rate,2000 Hz",
        "Sample rate (Hz): 2000",
        "Rate: 2 kHz",
        "Sample interval (ms),0.5",
        "# Sample rate (Hz),2000",
        "#Sample rate = 2000 Hz",
        "Sampling rate,2,kHz",
        "Sampling rate,2000,[Hz]",
        'Sample rate (Hz),"2,000"',
        "Sampling interval,0.5,ms",
        "Sampling interval [s]:,0.0005",
        "Abtastrate: 2000 Hz",
        "Messrate,2000,Hz",
        "Abtastintervall: 0.5 ms",
        "Fréquence d'échantillonnage (Hz),2000",
        "Frecuencia de muestreo (Hz),2000",
        "Acquisition: 2000 S/s",
    ],
)
def test_a_rate_that_is_stated_above_the_headings_is_held_against_the_sender_s(line: str):
    text = f"{line}\n{GENERIC.partition(',')[2]}\n" + "\n".join(
        row.partition(",")[2] for row in csv_text().splitlines()[1:]
    )
    assert codes(refused(text, sample_rate_hz=1000.0)) == [("sample_rate_hz", "rate-differs")]
    assert one(text, sample_rate_hz=2000.0).recording.linear_acceleration.sample_rate_hz == 2000.0


def in_sheet(*above: list[object]) -> bytes:
    rows = [line.partition(",")[2].split(",") for line in csv_text().splitlines()]
    return xlsx({"a": [*above, [], rows[0], *([float(cell) for cell in row] for row in rows[1:])]})


def in_parquet(**said: str) -> bytes:
    columns = {name: six_axis()[:, place] for place, name in enumerate(GENERIC.split(",")[1:])}
    return parquet(pa.table(columns).replace_schema_metadata(said))


@pytest.mark.parametrize(
    "data",
    [
        in_sheet(["Sample rate (Hz)", 2000]),
        in_sheet(["Sample rate: 2000 Hz"]),
        in_sheet(["Test", "T7"], ["Sampling interval", 0.5, "ms"]),
        in_parquet(sample_rate_hz="2000"),
    ],
)
def test_a_rate_that_a_sheet_or_a_files_metadata_states_is_held_against_the_senders(data: bytes):
    assert codes(refused(data, sample_rate_hz=1000.0)) == [("sample_rate_hz", "rate-differs")]
    assert one(data, sample_rate_hz=2000.0).recording.linear_acceleration.sample_rate_hz == 2000.0


@pytest.mark.parametrize(
    "line",
    [
        "Low pass frequency (Hz),300",
        "Resonant frequency (Hz),26000",
        "Line frequency (Hz),50",
        "Trigger rate (Hz),1",
        "Export rate (Hz),100",
        "Filter frequency (Hz),300",
    ],
)
def test_a_frequency_that_is_none_of_samples_is_passed_over(line: str):
    assert one(f"{line}\n{csv_text()}").recording.linear_acceleration.sample_rate_hz == 1000.0


@pytest.mark.parametrize(
    "line", ["Coordinate system,SAE J211", "# axes: sae_j211", "Axes: SAE J211/1", "Polarity,SAE J211-1"]
)
def test_axes_that_are_stated_above_the_headings_are_not_passed_over(line: str):
    text = f"{line}\n{csv_text()}"
    problem = refused(text)
    assert codes(problem) == [("axes", "axes-unclear")]
    assert "give axes beside the file" in problem.detail
    assert one(text, axes="sae_j211").recording.axes == "sae_j211"
    assert one(text, axes="anatomical").recording.axes == "anatomical"
    assert one(f"Axes,anatomical\n{csv_text()}").recording.axes == "anatomical"
