"""What devices report of their own peaks, and whom the published model was made from."""

from __future__ import annotations

import numpy as np
import pytest
from waveforms import burst

from headimpact.quality import check_reported_peak, check_reported_resultant, population_reason

A = burst(np.random.default_rng(3), 100, 30.0)
R = np.linalg.norm(A, axis=1)


@pytest.mark.parametrize(("factor", "noted"), [(1.0099, False), (0.9901, False), (1.0101, True), (0.9899, True)])
def test_a_reported_peak_over_1_percent_off_is_named_with_both_numbers(factor, noted):
    found = list(check_reported_peak("linear_acceleration", "g", R.max() * factor, A))
    assert bool(found) == noted
    if noted:
        assert (found[0].code, found[0].severity, found[0].signal) == (
            "vendor_peak_mismatch",
            "warning",
            "linear_acceleration",
        )
        assert f"{R.max() * factor:.5g} g" in found[0].detail
        assert f"{R.max():.5g} g" in found[0].detail


@pytest.mark.parametrize(("share", "noted"), [(0.0099, False), (0.0101, True)])
def test_a_reported_resultant_is_compared_at_every_sample(share, noted):
    off = R.copy()
    off[17] += share * R.max()
    found = list(check_reported_resultant("angular_velocity", "rad/s", off, A))
    assert bool(found) == noted
    if noted:
        assert "sample 17" in found[0].detail


def test_resultants_that_are_no_numbers_are_not_compared():
    assert list(check_reported_resultant("linear_acceleration", "g", np.full(100, np.nan), A)) == []
    assert list(check_reported_peak("linear_acceleration", "g", 3.0, np.full((5, 3), np.nan))) == []
    partly = np.where(np.arange(100) % 2, R, np.nan)
    assert list(check_reported_resultant("linear_acceleration", "g", partly, A)) == []


@pytest.mark.parametrize(
    ("sex", "age_years", "level", "reason"),
    [
        (None, None, None, None),
        ("male", 18.0, "collegiate", None),
        ("male", None, "professional", None),
        ("female", 30.0, None, "sex"),
        ("other", None, None, "sex"),
        ("male", 17.9, None, "under 18 years"),
        (None, 12.0, "professional", "under 18 years"),
        ("male", None, "High School", "a youth level of play"),
        ("male", None, "youth", "a youth level of play"),
        ("male", None, "Youth-Tackle", "a youth level of play"),
        ("male", None, "U16", "a youth level of play"),
        ("male", None, "under 18", "a youth level of play"),
        ("male", None, "U21", None),
        ("male", None, "university", None),
    ],
)
def test_who_is_outside_the_adult_men_of_the_published_model_is_told_with_the_reason(sex, age_years, level, reason):
    assert population_reason(sex, age_years, level) == reason
