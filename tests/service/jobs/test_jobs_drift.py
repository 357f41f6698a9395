"""Drift: the active model against a cohort, as its impacts happened."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta

import numpy as np
import pytest

from headimpact.calibration.drift import risk_adjusted_cusum
from headimpact.risk import LAKSARI_2020, probability_of
from headimpact_service.intake.cohorts import Selected
from headimpact_service.intake.drift import drift_document
from headimpact_service.store.cohorts import LabelledImpact
from headimpact_service.store.tables import CRITERION_COLUMNS, VALUE_COLUMNS

START = datetime(2026, 9, 1, tzinfo=UTC)


def impacts(count: int) -> tuple[list[LabelledImpact], list[float]]:
    """Impacts a day apart: harmless at first, later with more concussions than the model says."""
    generator = np.random.default_rng(4)
    found, outcomes = [], []
    first = VALUE_COLUMNS.index(CRITERION_COLUMNS["bam"][0])
    for number in range(count):
        values: list[float | None] = [1.0] * len(VALUE_COLUMNS)
        values[first : first + 3] = (generator.gamma(1.5, 0.04, 3)).tolist()
        when = START + timedelta(days=number)
        found.append(
            LabelledImpact(number.to_bytes(16, "big"), 1, None, None, "", None, None, None, when, None, tuple(values))
        )
        outcomes.append(float(number > count / 2 and generator.random() < 0.3))
    return found, outcomes


def test_the_chart_goes_with_time_whatever_the_order_of_arrival() -> None:
    found, outcomes = impacts(120)
    in_time = drift_document(Selected(found, outcomes, {}), LAKSARI_2020, 0.0055)
    order = np.random.default_rng(1).permutation(120).tolist()
    shuffled = drift_document(
        Selected([found[i] for i in order], [outcomes[i] for i in order], {}), LAKSARI_2020, 0.0055
    )
    assert in_time is not None
    assert shuffled == in_time
    backwards = risk_adjusted_cusum(np.array(outcomes)[::-1], np.full(120, np.mean(outcomes)))
    forwards = risk_adjusted_cusum(np.array(outcomes), np.full(120, np.mean(outcomes)))
    assert backwards.values[-1] != forwards.values[-1]  # the order does matter


def test_a_full_follow_up_is_held_against_the_models_own_probabilities() -> None:
    found, outcomes = impacts(120)
    document = drift_document(Selected(found, outcomes, {}), LAKSARI_2020, None)
    assert document is not None
    first = VALUE_COLUMNS.index(CRITERION_COLUMNS["bam"][0])
    curve = LAKSARI_2020.curves["bam"]
    served = [probability_of(curve.b0 + float(np.dot(curve.b, one.values[first : first + 3]))) for one in found]
    assert document["expected"] == pytest.approx(sum(served), rel=1e-12)
    assert document["expected_at"] == {"level": "model", "incidence": 0.0055}


def test_a_case_control_sample_is_held_against_the_model_at_the_samples_share() -> None:
    found, outcomes = impacts(120)
    document = drift_document(Selected(found, outcomes, {}), LAKSARI_2020, 0.0055)
    assert document is not None
    assert document["expected_at"] == {"level": "cohort", "incidence": sum(outcomes) / 120}
    shifted = drift_document(Selected(found, outcomes, {}), LAKSARI_2020, 0.02)
    assert shifted is not None
    assert shifted["expected"] == pytest.approx(document["expected"], rel=1e-12)  # the level is not the incidence's
