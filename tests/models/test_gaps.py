"""Gaps of at most two samples are filled where that is asked for; longer ones, and any others, are refused."""

from __future__ import annotations

import numpy as np
import pytest
from waveforms import recording

from headimpact.errors import TraceError
from headimpact.gaps import fill_gaps
from headimpact.preparation import prepare
from headimpact.recording import Signal
from headimpact.scoring import score

LINE = np.stack([np.arange(20.0), 2.0 * np.arange(20.0), 5.0 - np.arange(20.0)], axis=1)


def holed(*rows: int, axis: int | slice = slice(None)) -> Signal:
    values = LINE.copy()
    values[list(rows), axis] = np.nan
    return Signal(values, "g", 1000.0)


@pytest.mark.parametrize("rows", [(5,), (5, 6), (1,), (18,), (2, 3, 5, 6, 9)])
@pytest.mark.parametrize("axis", [0, 2, slice(None)])
def test_values_of_a_short_gap_lie_on_the_line_between_its_neighbours(rows, axis):
    filled, count = fill_gaps(holed(*rows, axis=axis))
    np.testing.assert_allclose(filled.values, LINE, atol=1e-12)
    assert count == len(rows)


@pytest.mark.parametrize("rows", [(5, 6, 7), (0,), (19,), (0, 1), (18, 19)])
def test_a_longer_gap_and_one_at_an_end_stay(rows):
    filled, count = fill_gaps(holed(*rows))
    assert count == 0
    assert np.isnan(filled.values[list(rows)]).all()


def test_gaps_of_two_components_at_one_sample_are_one_missing_sample():
    assert fill_gaps(holed(5, axis=slice(0, 2)))[1] == 1


@pytest.mark.parametrize(("missing", "filled"), [((7,), True), ((7, 8), True), ((7, 8, 9), False)])
def test_samples_that_the_stamps_miss_are_put_back(missing, filled):
    kept = np.delete(np.arange(20), missing)
    found, count = fill_gaps(Signal(LINE[kept], "g", time_s=kept / 1000.0))
    assert count == (len(missing) if filled else 0)
    if filled:
        np.testing.assert_allclose(found.values, LINE, atol=1e-12)
        np.testing.assert_allclose(found.time_s, np.arange(20) / 1000.0, atol=1e-15)


def test_a_step_that_is_no_whole_number_of_samples_is_jitter_and_stays():
    stamps = np.arange(20) / 1000.0
    stamps[10:] += 0.0005
    assert fill_gaps(Signal(LINE, "g", time_s=stamps))[1] == 0


@pytest.mark.parametrize("stamps", [np.zeros(20), np.arange(20.0)[::-1], np.arange(3.0), np.full(20, np.nan)])
def test_stamps_that_are_none_are_left_to_be_refused(stamps):
    signal = Signal(LINE, "g", time_s=stamps)
    assert fill_gaps(signal) == (signal, 0)


def test_a_recording_whose_gaps_are_filled_says_how_many_and_scores_like_the_whole_one():
    whole = recording()
    values = whole.linear_acceleration.values.copy()
    values[[70, 71, 90], 1] = np.nan
    gappy = recording(linear_acceleration=Signal(values, "g", 1000.0), fill_gaps=True)
    found = score(prepare(gappy))
    (note,) = found.quality
    assert (note.code, note.severity, note.signal) == ("gaps_filled", "note", "linear_acceleration")
    assert "3 missing samples" in note.detail
    expected = score(prepare(whole)).criteria["hic15"].value
    assert found.criteria["hic15"].value == pytest.approx(expected, rel=1e-3)


def test_a_gap_is_refused_unless_filling_was_asked_for():
    values = recording().linear_acceleration.values.copy()
    values[40, 1] = np.nan
    with pytest.raises(TraceError) as refusal:
        prepare(recording(linear_acceleration=Signal(values, "g", 1000.0)))
    assert (refusal.value.code, refusal.value.channel, refusal.value.index) == ("missing-sample", "y", 40)


def test_a_gap_of_three_is_refused_at_its_first_sample_though_filling_was_asked_for():
    values = recording().angular_velocity.values.copy()
    values[40:43, 2] = np.nan
    with pytest.raises(TraceError) as refusal:
        prepare(recording(angular_velocity=Signal(values, "rad/s", 1000.0), fill_gaps=True))
    assert (refusal.value.signal, refusal.value.index) == ("angular_velocity", 40)
