"""ISO-MME sets: which channels make a head, what is missing, and what their laboratory says of them."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from ingest_files import RECORDINGS, codes, half_sine, needs_recordings, one, outcome, read, refused, statuses, zipped
from laboratory import FIRST_S, INTERVAL_S, ISO_CODES, SAMPLES, channel, channels, iso_mme, text

from headimpact.cut_offs import PAPER
from headimpact.preparation import prepare
from headimpact_service.ingest.iso_codes import head_code
from headimpact_service.ingest.mapping import Mapping
from headimpact_service.ingest.record import ImpactRecord
from headimpact_service.ingest.spelling import unit_spelled

AX = "11HEADCG00H3ACXA"


def peaks(record: ImpactRecord, signal: str) -> list[float]:
    values = getattr(record.recording, signal).values
    return [float(column[np.abs(column).argmax()]) for column in values.T]


def notes(record: ImpactRecord, code: str) -> list[str]:
    return [note.detail for note in record.notes if note.code == code]


def changed(**changes: object) -> bytes:
    held = channels()
    unit = str(changes.pop("of_unit", "g"))
    held[AX] = channel(AX, unit, half_sine(SAMPLES, 30.0).tolist(), **changes)
    return iso_mme(held)


@pytest.mark.parametrize("folder", ["", "T1/", "a/b/"])
@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "latin-1", "cp1252"])
def test_a_set_is_read_wherever_it_lies_and_however_its_text_is_encoded(folder, encoding):
    record = one(iso_mme(folder=folder, encoding=encoding))
    recording = record.recording
    assert peaks(record, "linear_acceleration") == pytest.approx([30.0, -12.0, 7.5])
    assert peaks(record, "angular_velocity") == pytest.approx([8.0, 20.0, -4.0])
    assert (recording.linear_acceleration.unit, recording.angular_velocity.unit) == ("g", "rad/s")
    assert recording.linear_acceleration.sample_rate_hz == 1000.0
    assert (recording.axes, recording.pre_trigger_ms, recording.low_pass) == ("sae_j211", 10.0, PAPER)
    assert record.metadata["laboratory"] == "Prüfzentrum"
    assert record.metadata["test_number"] == "T1"
    assert (record.notes, record.unscorable) == ((), ())
    assert prepare(recording).kinematics.samples == SAMPLES


def test_a_channel_whose_file_says_no_code_is_what_the_list_calls_it():
    record = one(changed(channel_code="x"))
    assert peaks(record, "linear_acceleration") == pytest.approx([30.0, -12.0, 7.5])
    assert record.notes == ()


def test_what_was_filtered_before_is_kept_in_the_source():
    metadata = one(iso_mme()).metadata
    assert metadata["filtered_before"]["linear_acceleration_x"] == "CFC1000"
    assert metadata["channels"]["angular_velocity_z"] == "11HEAD0000H3AVZA"
    assert (metadata["test_object"], metadata["position"]) == ("1", "1")


@pytest.mark.parametrize("line_end", ["\n", "\r\n", "\r"])
def test_any_line_end_will_do(line_end):
    held = {code: content.replace("\r\n", line_end) for code, content in channels().items()}
    assert peaks(one(iso_mme(held)), "angular_velocity") == pytest.approx([8.0, 20.0, -4.0])


def test_an_ellipsis_of_windows_text_ends_no_line():
    held = channels() | {AX: channel(AX, "g", half_sine(SAMPLES, 30.0).tolist(), comments="warm … 22 °C: ok")}
    assert peaks(one(iso_mme(held, encoding="cp1252")), "linear_acceleration")[0] == 30.0


class TestUnits:
    @pytest.mark.parametrize(
        ("signal", "written", "unit"),
        [
            ("linear_acceleration", "m/(s*s)", "m/s^2"),
            ("linear_acceleration", "m/s^2", "m/s^2"),
            ("linear_acceleration", "m/s²", "m/s^2"),
            ("linear_acceleration", "m/s**2", "m/s^2"),
            ("linear_acceleration", "G", "g"),
            ("linear_acceleration", "G's", "g"),
            ("linear_acceleration", "mm/s^2", None),
            ("linear_acceleration", "deg/s", None),
            ("linear_acceleration", "", None),
            ("linear_acceleration", None, None),
            ("angular_velocity", "deg/s", "deg/s"),
            ("angular_velocity", "°/s", "deg/s"),
            ("angular_velocity", "DPS", "deg/s"),
            ("angular_velocity", "rad/s", "rad/s"),
            ("angular_velocity", "1/s", None),
            ("angular_acceleration", "rad/(s*s)", "rad/s^2"),
            ("angular_acceleration", "rad/s^2", "rad/s^2"),
            ("angular_acceleration", "deg/s**2", "deg/s^2"),
        ],
    )
    def test_a_unit_is_read_however_it_is_written_and_never_guessed(self, signal, written, unit):
        assert unit_spelled(signal, written) == unit

    def test_a_unit_that_is_none_of_the_signal_s_is_422_and_names_the_channel(self):
        problem = refused(changed(of_unit="km/h"))
        assert codes(problem) == [(None, "unit-missing")]
        assert AX in problem.detail
        assert "km/h" not in problem.detail

    def test_axes_in_different_units_are_refused(self):
        assert codes(refused(changed(of_unit="m/(s*s)"))) == [(None, "units-differ")]


class TestCodes:
    @pytest.mark.parametrize(
        ("code", "found"),
        [
            ("11HEADCG0000ACXP", ("linear_acceleration", "x")),
            ("d1head0000h3avza", ("angular_velocity", "z")),
            ("13HEAD00CGWSAAYD", ("angular_acceleration", "y")),
            ("11HEAD0000H3ACRA", ("linear_acceleration", "r")),
            ("11HEADRI00H3ACXA", None),
            ("11HEAD00REH3ACXA", None),
            ("11CHST0000H3ACXA", None),
            ("11HEAD0000H3DSXA", None),
            ("11HEAD0000H3ACX", None),
            ("11HEAD0000H3ACXAA", None),
            ("", None),
        ],
    )
    def test_only_acceleration_and_rotation_at_the_centre_of_gravity_of_a_head_count(self, code, found):
        parsed = head_code(code)
        assert (None if parsed is None else (parsed.signal, parsed.axis)) == found

    def test_heads_in_several_positions_are_several_impacts(self):
        passenger = {"13" + code[2:]: (unit, 2 * peak) for code, (unit, peak) in ISO_CODES.items()}
        first, second = read(iso_mme(channels() | channels(passenger)))
        assert peaks(first, "linear_acceleration")[0] == 30.0
        assert peaks(second, "linear_acceleration")[0] == 60.0
        assert [first.metadata["position"], second.metadata["position"]] == ["1", "3"]

    def test_of_several_filters_the_weakest_that_has_all_axes_is_taken(self):
        strong = {code[:15] + "C": (unit, 0.5 * peak) for code, (unit, peak) in ISO_CODES.items()}
        raw = {AX[:15] + "0": ("g", 90.0)}
        record = one(iso_mme(channels() | channels(strong) | channels(raw)))
        assert peaks(record, "linear_acceleration") == pytest.approx([30.0, -12.0, 7.5])

    def test_what_is_said_to_be_at_the_centre_of_gravity_goes_before_what_is_only_the_head_s(self):
        only = {
            code[:6] + "00" + code[8:]: (unit, 2.0 * peak) for code, (unit, peak) in ISO_CODES.items() if "CG" in code
        }
        for held in (channels() | channels(only), channels(only) | channels()):
            record = one(iso_mme(held))
            assert peaks(record, "linear_acceleration") == pytest.approx([30.0, -12.0, 7.5])
            assert len(notes(record, "channel_given_twice")) == 3
        partly = {code: said for code, said in channels().items() if code != AX}
        whole = one(iso_mme(partly | channels(only)))
        assert peaks(whole, "linear_acceleration") == pytest.approx([60.0, -24.0, 15.0])

    def test_beside_a_test_of_another_kind_it_is_not_read_in_part(self):
        both = {"a/v1.EV5": "x", "a/v1.001": "x", "b/test.mme": "x", "b/channel/t.001": "x", "b/channel/t.chn": "x"}
        assert "send each in an archive of its own" in refused(zipped(both)).detail

    def test_a_set_without_a_head_says_so(self):
        problem = refused(iso_mme({"11CHST0000H3ACXA": channel("11CHST0000H3ACXA", "g", [0.0, 1.0, 0.0])}))
        assert "no channel at a head's centre of gravity" in problem.detail


class TestTimes:
    def referring(self, unit: str = "ms", stamps: list[object] | None = None, **changes: object) -> bytes:
        times = [i - 10.0 for i in range(SAMPLES)] if stamps is None else stamps
        reference = "11TIRS000000TI00"
        plain = {"time_of_first_sample": None, "sampling_interval": None, "reference_channel": "explicit"}
        held = channels(**(plain | {"reference_channel_name": reference} | changes))
        clock = text({"Channel code": reference, "Unit": unit}, times)
        return iso_mme({reference: clock} | held)

    @pytest.mark.parametrize(("unit", "factor"), [("s", 1e-3), ("ms", 1.0), ("µs", 1e3)])
    def test_times_may_be_those_of_a_reference_channel(self, unit, factor):
        record = one(self.referring(unit, [(i - 10.0) * factor for i in range(SAMPLES)]))
        assert record.recording.pre_trigger_ms == pytest.approx(10.0)
        assert record.recording.angular_velocity.sample_rate_hz == pytest.approx(1000.0)

    def test_jitter_of_the_reference_is_kept_to_be_resampled(self):
        jittered = [i - 10.0 + 0.05 * (i % 2) for i in range(SAMPLES)]
        recording = one(self.referring("ms", jittered)).recording
        assert recording.linear_acceleration.sample_rate_hz is None
        assert "resampled" in [note.code for note in prepare(recording).notes]

    @pytest.mark.parametrize(
        ("file", "code"),
        [
            (lambda self: self.referring("h"), "unit-missing"),
            (lambda self: self.referring("ms", [0.0, 1.0, 2.0]), "stamp-count"),
            (lambda self: self.referring("ms", ["NOVALUE"] + [float(i) for i in range(SAMPLES - 1)]), "stamp-count"),
            (lambda self: self.referring("ms", [0.0] * SAMPLES), "time-not-increasing"),
            (lambda self: self.referring(sampling_interval=0.0, time_of_first_sample=0.0), None),
            (lambda self: changed(sampling_interval=None), "time-missing"),
            (lambda self: changed(time_of_first_sample="NOVALUE"), "time-missing"),
        ],
    )
    def test_times_that_cannot_be_told_are_refused(self, file, code):
        [item] = outcome(file(self))
        assert isinstance(item, ImpactRecord) if code is None else codes(item) == [(None, code)]

    def test_a_test_s_local_time_is_placed_by_the_zone_beside_the_file(self):
        info = {"Test date": "2026-05-14", "Time of test": "10:32:45"}
        assert one(iso_mme(**info)).occurred_at is None
        placed = one(iso_mme(**info), time_zone="Europe/Berlin").occurred_at
        assert placed.isoformat() == "2026-05-14T08:32:45+00:00"


class TestMissing:
    @pytest.mark.parametrize(("code", "severity"), [("11CHST0000H3DSXP", "note"), ("11HEAD0000H3AAXA", "warning")])
    def test_a_channel_that_is_listed_but_absent_is_named(self, code, severity):
        record = one(iso_mme(listed=[code]))
        (note,) = record.notes
        assert (note.code, note.severity) == ("channel_missing", severity)
        assert f"{code} (channel 007)" in note.detail

    def test_of_many_absent_channels_the_head_s_come_first_and_the_rest_is_counted(self):
        listed = [f"11CHST00{n:02d}H3DSXP" for n in range(30)] + ["11HEAD0000H3AAXA"]
        (detail,) = notes(one(iso_mme(listed=listed)), "channel_missing")
        assert detail.startswith("The set lists 11HEAD0000H3AAXA")
        assert "and 21 more" in detail

    def test_a_signal_that_lacks_an_axis_is_left_out_with_a_warning(self):
        held = channels()
        del held["11HEAD0000H3AVYA"]
        record = one(iso_mme(held))
        assert record.recording.angular_velocity is None
        assert "angular velocity has x, z but not y" in notes(record, "channel_missing")[0]
        assert record.unscorable == ()

    def test_a_head_of_which_no_signal_is_whole_is_kept_unscorable(self):
        record = one(iso_mme({AX: channels()[AX]}))
        assert record.unscorable == (
            "The head's linear acceleration has x but not y, z: no signal has its three axes.",
        )
        assert peaks(record, "linear_acceleration")[0] == 30.0
        assert np.isnan(record.recording.linear_acceleration.values[:, 1:]).all()

    def test_novalue_is_422_with_channel_and_sample(self):
        wave = [*half_sine(SAMPLES, 30.0).tolist()]
        held = channels() | {AX: channel(AX, "g", [*wave[:20], "NOVALUE", *wave[21:]])}
        problem = refused(iso_mme(held))
        assert codes(problem) == [(None, "missing-sample")]
        assert problem.detail == (
            "The linear acceleration x has no value at sample 20: fill_gaps fills gaps of at most 2 samples."
        )

    def test_novalue_is_filled_where_that_is_asked_for(self):
        wave = [*half_sine(SAMPLES, 30.0).tolist()]
        held = channels() | {AX: channel(AX, "g", [*wave[:20], "NOVALUE", *wave[21:]])}
        record = one(iso_mme(held), fill_gaps=True)
        assert prepare(record.recording).notes[0].code == "gaps_filled"

    @pytest.mark.parametrize(
        "status",
        [
            "Channel failed",
            "Meaningless data",
            "No data",
            "System failed",
            "failed",
            "meaningless",
            "Invalid",
            "not ok",
        ],
    )
    def test_a_channel_that_its_laboratory_disowns_is_never_scored(self, status):
        record = one(changed(data_status=status))
        assert [AX in reason and status.lower() in reason for reason in record.unscorable] == [True]

    @pytest.mark.parametrize("status", ["Questionable data", "questionable", "defekt"])
    def test_a_channel_of_which_its_laboratory_says_something_else_is_scored_with_a_warning(self, status):
        record = one(changed(data_status=status))
        assert record.unscorable == ()
        assert AX in notes(record, "questionable_data")[0]
        assert status.lower() in notes(record, "questionable_data")[0]

    @pytest.mark.parametrize("status", ["OK", "good", "NOVALUE", "", "Linearised data", "scaled  data"])
    def test_a_channel_that_its_laboratory_lets_stand_is_no_finding(self, status):
        record = one(changed(data_status=status))
        assert (record.unscorable, record.notes) == ((), ())

    def test_a_count_that_differs_from_the_header_s_is_noted(self):
        assert (
            "60 samples where its header says 61"
            in notes(one(changed(number_of_samples=61)), "sample_count_mismatch")[0]
        )


def test_a_supplied_resultant_is_compared_with_the_three_axes():
    waves = np.stack([half_sine(SAMPLES, peak) for peak in (30.0, -12.0, 7.5)])
    resultant = np.linalg.norm(waves, axis=0)
    code = "11HEADCG00H3ACRA"
    right = one(iso_mme(channels() | {code: channel(code, "g", resultant.tolist())}))
    assert right.notes == ()
    wrong = one(iso_mme(channels() | {code: channel(code, "g", (1.1 * resultant).tolist())}))
    assert [note.code for note in wrong.notes] == ["vendor_peak_mismatch"]


@pytest.mark.parametrize(
    ("code", "unit", "factor", "changes", "noted"),
    [
        ("11HEADCG00H3ACRA", "m/s2", 1.1 * 9.80665, {}, True),
        ("11HEADCG00H3ACRA", "m/s2", 9.80665, {}, False),
        ("11HEADCG00H3ACRC", "g", 1.1, {}, False),  # of axes that were filtered otherwise
        ("11HEADCG00H3ACRA", "g", 1.1, {"Data status": "channel failed"}, False),
    ],
)
def test_a_resultant_of_its_own_samples_is_compared_in_their_unit(
    code: str, unit: str, factor: float, changes: dict[str, str], noted: bool
):
    waves = np.stack([half_sine(SAMPLES, peak) for peak in (30.0, -12.0, 7.5)])
    sent = channel(code, unit, (factor * np.linalg.norm(waves, axis=0)).tolist(), **changes)
    record = one(iso_mme(channels() | {code: sent}))
    assert [note.code for note in record.notes] == (["vendor_peak_mismatch"] if noted else [])


def test_a_full_scale_in_the_headers_tells_clipping():
    held = channels(channel_amplitude_class="200")
    assert one(iso_mme(held)).recording.linear_acceleration.declared_range == 200.0


@pytest.mark.parametrize("body", ["1,5", "abc", "nan", "inf", "1_0", "0x10", "--3"])
def test_a_line_that_is_no_number_is_refused(body):
    held = channels() | {AX: channel(AX, "g", ["0.0", body, "1.0"])}
    assert codes(refused(iso_mme(held))) == [(None, "missing-sample")]


@pytest.mark.parametrize("count", [0, 2, 20_001])
def test_too_few_and_too_many_samples_are_refused(count):
    held = channels() | {AX: channel(AX, "g", ["0.0"] * count)}
    assert codes(refused(iso_mme(held))) == [(None, "sample-count")]


def test_what_a_desktop_puts_into_an_archive_is_passed_over():
    files = {f"T1/Channel/T1.{n:03d}": content for n, content in enumerate(channels().values(), start=1)}
    files |= {"T1/T1.mme": text({"Test number": "T1"})}
    twins = {f"__MACOSX/{path.rpartition('/')[0]}/._{path.rpartition('/')[2]}": "\0\5\x16\7Mac OS X" for path in files}
    beside = {"T1/.DS_Store": "\0\0\0\1Bud1", "T1/Channel/._T1.002": "\0\5\x16\7", "T1/Thumbs.db": "?"}
    assert peaks(one(zipped(files | twins | beside)), "linear_acceleration")[0] == 30.0


def test_a_mapping_or_another_preset_is_refused():
    for options in ({"preset": "swa"}, {"mapping": Mapping()}):
        assert "takes no mapping" in refused(iso_mme(), **options).detail
    assert one(iso_mme(), preset="iso_mme").metadata["preset"] == "iso_mme"


def test_a_set_without_its_list_or_its_test_file_is_read_by_its_channels():
    files = {f"T1/Channel/T1.{n:03d}": content for n, content in enumerate(channels().values(), start=1)}
    assert peaks(one(zipped(files | {"T1/T1.mme": text({"Test number": "T1"})})), "linear_acceleration")[0] == 30.0
    listed = text({f"Name of channel {n:03d}": code for n, code in enumerate(ISO_CODES, start=1)})
    assert peaks(one(zipped(files | {"T1/Channel/T1.chn": listed})), "linear_acceleration")[0] == 30.0


@given(st.dictionaries(st.integers(0, 400), st.binary(max_size=3), min_size=1, max_size=6), st.integers(0, 5))
@settings(max_examples=60, deadline=None)
def test_any_damage_to_a_channel_is_read_or_refused(damage, which):
    held = {code: content.encode() for code, content in channels().items()}
    code = list(held)[which]
    data = bytearray(held[code])
    for place, junk in damage.items():
        data[place : place + len(junk)] = junk
    damaged = {c: content.decode("latin-1") for c, content in (held | {code: bytes(data)}).items()}
    assert statuses(outcome(iso_mme(damaged, encoding="latin-1"))) <= {413, 415, 422}


class TestWhichTimes:
    """Of the times that a set gives, those that count."""

    TIMES = "11TIRS000000TI00"

    def timed(self, **changes: object) -> bytes:
        times = [FIRST_S + n * INTERVAL_S / 2 for n in range(SAMPLES)]
        held = channels(reference_channel="explicit", reference_channel_name=self.TIMES, **changes)
        return iso_mme(held | {self.TIMES: channel(self.TIMES, "s", times)})

    def test_the_channel_of_times_that_a_header_refers_to_counts_more_than_an_interval_beside_it(self):
        assert one(self.timed()).recording.linear_acceleration.sample_rate_hz == 2000.0
        told = one(self.timed(sampling_interval=None, time_of_first_sample=None)).recording
        assert (told.linear_acceleration.sample_rate_hz, told.pre_trigger_ms) == (2000.0, 10.0)

    def test_without_a_first_time_the_trigger_is_not_known(self):
        recording = one(iso_mme(channels(time_of_first_sample=None))).recording
        assert (recording.linear_acceleration.sample_rate_hz, recording.pre_trigger_ms) == (1000.0, None)

    def test_a_first_time_that_only_some_channels_say_is_refused(self):
        held = channels() | {AX: channel(AX, "g", half_sine(SAMPLES).tolist(), time_of_first_sample=None)}
        assert codes(refused(iso_mme(held))) == [(None, "time-missing")]

    @pytest.mark.parametrize(
        "change", [{"time_of_first_sample": "-10 ms"}, {"sampling_interval": "0,001"}, {"sampling_interval": 1000}]
    )
    def test_a_time_that_cannot_be_read_is_refused(self, change):
        assert codes(refused(iso_mme(channels(**change)))) == [(None, "time-form")]

    def test_the_sender_may_give_the_rate_that_the_headers_do_not(self):
        held = channels(sampling_interval=None)
        assert codes(refused(iso_mme(held))) == [(None, "time-missing")]
        recording = one(iso_mme(held), sample_rate_hz=1000.0).recording
        assert (recording.linear_acceleration.sample_rate_hz, recording.pre_trigger_ms) == (1000.0, 10.0)


class TestTogether:
    """Channels that do not fit together."""

    @pytest.mark.parametrize(
        ("changes", "code"),
        [
            ({"sampling_interval": 0.002}, "rates-differ"),
            ({"time_of_first_sample": 5.0}, "no-overlap"),
        ],
    )
    def test_the_axes_of_one_signal_must_share_rate_and_time(self, changes, code):
        assert codes(refused(changed(**changes))) == [(None, code)]

    def test_signals_of_unlike_rates_that_begin_together_keep_their_rates(self):
        slow = {code: pair for code, pair in ISO_CODES.items() if "AV" in code}
        record = one(iso_mme(channels() | channels(slow, sampling_interval=0.0005)))
        assert record.recording.linear_acceleration.sample_rate_hz == 1000.0
        assert record.recording.angular_velocity.sample_rate_hz == 2000.0
        assert record.recording.pre_trigger_ms == 10.0

    def test_signals_of_unlike_rates_that_begin_apart_keep_their_times(self):
        late = {code: pair for code, pair in ISO_CODES.items() if "AV" in code}
        record = one(iso_mme(channels() | channels(late, sampling_interval=0.0005, time_of_first_sample=0.0)))
        a, w = record.recording.linear_acceleration, record.recording.angular_velocity
        assert w.time_s[0] - a.time_s[0] == pytest.approx(0.01)
        assert prepare(record.recording).kinematics.time_ms(0) == pytest.approx(0.0, abs=1e-9)

    def test_the_channels_of_a_signal_are_cut_to_what_they_share_and_the_other_signal_stays_whole(self):
        record = one(changed(time_of_first_sample=-0.005))
        assert record.recording.linear_acceleration.values.shape[0] == SAMPLES - 5
        assert record.recording.angular_velocity.values.shape[0] == SAMPLES
        assert record.recording.pre_trigger_ms == 10.0
        assert prepare(record.recording).kinematics.time_ms(0) == pytest.approx(-5.0, abs=1e-9)
        assert [n.channel for n in record.notes if n.code == "sample_count_mismatch"] == ["x", "y", "z"]

    @pytest.mark.parametrize(("apart", "read"), [(0.05, True), (0.5, False), (1.5, False), (1.0, True)])
    def test_axes_between_whose_samples_another_lies_are_refused(self, apart: float, read: bool):
        held = channels()
        later = FIRST_S + apart * INTERVAL_S
        held[AX] = channel(AX, "g", half_sine(SAMPLES, 30.0).tolist(), time_of_first_sample=f"{later:.6f}")
        if read:
            assert one(iso_mme(held)).recording.linear_acceleration is not None
        else:
            problem = refused(iso_mme(held))
            assert [error.code for error in problem.errors] == ["rates-differ"]
            assert "0.5 of a step between those of another axis" in problem.detail

    def test_a_channel_that_ends_early_cuts_no_other_signal_and_what_it_hides_is_said(self):
        ay = next(code for code in ISO_CODES if "ACY" in code)
        short = half_sine(SAMPLES, -12.0)[:12].tolist()
        record = one(iso_mme(channels() | {ay: channel(ay, "g", short)}))
        assert record.recording.linear_acceleration.values.shape[0] == 12
        assert record.recording.angular_velocity.values.shape[0] == SAMPLES
        said = [(n.code, n.signal, n.channel) for n in record.notes]
        assert said == [
            ("sample_count_mismatch", "linear_acceleration", "x"),
            ("peak_cut_off", "linear_acceleration", "x"),
            ("sample_count_mismatch", "linear_acceleration", "z"),
            ("peak_cut_off", "linear_acceleration", "z"),
        ]
        found = [(n.code, n.signal) for n in prepare(record.recording).notes]
        assert ("peak_cut_off", "angular_velocity") in found

    def test_signals_of_one_rate_that_begin_apart_are_scored_where_they_overlap(self):
        late = {code: pair for code, pair in ISO_CODES.items() if "AV" in code}
        record = one(iso_mme(channels() | channels(late, time_of_first_sample=0.02)))
        assert record.recording.linear_acceleration.values.shape[0] == SAMPLES
        assert record.recording.pre_trigger_ms == 10.0
        assert prepare(record.recording).kinematics.time_ms(0) == pytest.approx(20.0, abs=1e-9)

    def test_a_resultant_alone_is_no_head(self):
        code = "11HEADCG00H3ACRA"
        assert codes(refused(iso_mme({code: channel(code, "g", [0.0, 1.0, 0.0])}))) == [(None, "no-signal")]

    def test_more_heads_than_an_import_may_hold_are_413(self):
        passenger = {"13" + code[2:]: pair for code, pair in ISO_CODES.items()}
        items = outcome(iso_mme(channels() | channels(passenger)), max_impacts=1)
        assert statuses(items) == {413}


@needs_recordings
def test_the_public_fixture_is_read_its_absent_channel_named_and_why_it_has_no_score():
    folder = RECORDINGS / "iso_mme_fixture"
    files = {f"test/{path.relative_to(folder)}": path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    record = one(zipped(files))
    linear = record.recording.linear_acceleration
    assert (linear.unit, linear.sample_rate_hz, linear.values.shape) == ("g", 10_000.0, (20, 3))
    assert peaks(record, "linear_acceleration")[0] == 42.0
    assert record.recording.pre_trigger_ms == 0.5
    assert "11CHST0000H3DSXP (channel 003)" in notes(record, "channel_missing")[0]
    assert record.unscorable == ("The head's linear acceleration has x but not y, z: no signal has its three axes.",)
    assert record.metadata["laboratory"] == "Crash-Prüfzentrum Köln GmbH"
