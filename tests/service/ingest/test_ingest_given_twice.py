"""A channel that a laboratory's file gives twice: both are named where they differ, in every format."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from ingest_files import half_sine, one, zipped
from laboratory import DTS_COLUMNS, ISO_CODES, SAMPLES, channel, channels, dts, iso_mme
from test_ingest_nhtsa import curve, ev5, files, row, rows

DTS_X, ISO_X = (next(code for code in codes if "ACX" in code) for codes in (DTS_COLUMNS, ISO_CODES))


def dts_twice(factor: float) -> str:
    """An export with one more column under the code of the x acceleration."""
    again = "A CODE TO CHANGE"
    columns = DTS_COLUMNS | {again: ("g", 30.0 * factor)}
    return dts(columns).replace(again, DTS_X)


def iso_mme_twice(factor: float, code: str = "11HEAD0000H3ACXA", **changes: str) -> bytes:
    """A set with a second channel of the x acceleration, from the other of the two places that mean the centre."""
    second = channel(code, "g", half_sine(SAMPLES, 30.0 * factor).tolist(), **changes)
    return iso_mme(channels(ISO_CODES) | {code: second})


def nhtsa_twice(factor: float, **changes: str) -> bytes:
    """A crash test with one more curve of the x acceleration."""
    header = ev5(*rows(), row(7, "AC", "XL", **changes))
    return zipped(files(header=header, **{"v10999/v10999.007": curve(factor)}))


@pytest.mark.parametrize(
    ("twice", "told"),
    [
        (dts_twice, f"{DTS_X} (channel 4) and {DTS_X} (channel 7) say that they are the same channel and differ by up"),
        (iso_mme_twice, f"{ISO_X} (channel 001) and 11HEAD0000H3ACXA (channel 007) say that they are the same channel"),
        (nhtsa_twice, "linear_acceleration x (curve 001) and linear_acceleration x (curve 007) say that they are the"),
    ],
)
class TestTwice:
    def test_values_that_differ_are_noted_with_both_names_and_the_one_that_was_read(
        self, twice: Callable[[float], str | bytes], told: str
    ):
        [note] = one(twice(0.5)).notes
        assert (note.code, note.severity) == ("channel_given_twice", "warning")
        assert (note.signal, note.channel) == ("linear_acceleration", "x")
        assert told in note.detail
        read = told.partition(" and ")[0]
        assert note.detail.endswith(f"{read} was read.")

    def test_equal_values_draw_no_note(self, twice: Callable[[float], str | bytes], told: str):
        assert told
        assert one(twice(1.0)).notes == ()


def test_channels_of_unlike_length_differ():
    short = channel("11HEAD0000H3ACXA", "g", half_sine(SAMPLES - 1, 30.0).tolist())
    notes = one(iso_mme(channels() | {"11HEAD0000H3ACXA": short})).notes
    [note] = [note for note in notes if note.code == "channel_given_twice"]
    assert "differ (60 samples in g and 59 samples in g)" in note.detail


def test_what_a_choice_is_known_for_draws_no_note():
    assert one(iso_mme_twice(0.5, "11HEADCG00H3ACXC")).notes == ()  # another filter
    failed = one(iso_mme_twice(0.5, Data_status="channel failed"))
    assert (failed.notes, failed.unscorable) == ((), ())
    assert one(nhtsa_twice(2.0, mark="R")).notes == ()
    assert one(nhtsa_twice(2.0, status="CF")).notes == ()


def test_a_second_channel_that_cannot_be_read_contradicts_nothing():
    assert one(iso_mme_twice(0.5, "11HEADCG00T3ACXA", Unit="furlongs")).notes == ()
