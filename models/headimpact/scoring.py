"""Scoring: from prepared kinematics to criteria, probabilities and quality notes.

One path serves one impact and batches of them, so that both give the same numbers to the last bit.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from scipy.special import expit

from headimpact.criteria import CRITERIA, Criterion, Evaluation, evaluate, missing_reason, present_signals
from headimpact.criteria.extra import EXTRA_CRITERIA, ExtraCriterion
from headimpact.criteria.windows import IntArray
from headimpact.errors import UnknownCriterion
from headimpact.filtering import AppliedFilter
from headimpact.kinematics import FloatArray, HeadKinematics, largest, squared_norm
from headimpact.preparation import Preparation
from headimpact.quality import QualityNote, check_truncation, check_units
from headimpact.recording import SIGNALS
from headimpact.risk import LAKSARI_2020, RiskModel

# Impacts per block: large enough to spread NumPy's cost per call, small enough to stay in the processor's cache.
BLOCK = 256

CONVENTIONS: Mapping[str, str] = {
    "maxima": "at_samples",
    "hic_window": "inclusive",
    "windows": "start_and_end_on_samples",
    "integration": "trapezoidal",
    "brain_model": "exact_for_piecewise_linear_angular_acceleration",
    "peaks": "resultant_at_head_cg_after_filtering",
    "probability_sign": "p = 1/(1+exp(b0+b.x))",
}

Components = tuple[float, float, float]


NO_RISKS: Mapping[str, float] = {}


class CriterionScore(NamedTuple):
    """One criterion of one impact: `value` and `probability` are None, with the `reason`, where it cannot be had."""

    key: str
    value: float | Components | None
    unit: str
    probability: float | None = None
    linear_predictor: float | None = None
    window_ms: tuple[float, float] | None = None
    reason: str | None = None
    risks: Mapping[str, float] = NO_RISKS


@dataclass(frozen=True, slots=True)
class BrainAngle:
    """Largest brain angles [rad] by axis and of the resultant, and when each axis peaked [ms]."""

    components: Components
    resultant: float
    time_of_peak_ms: Components


@dataclass(frozen=True, slots=True)
class Peaks:
    """Peak resultants at the head's centre of gravity after filtering."""

    linear_acceleration_g: float | None
    angular_velocity_rad_s: float | None
    angular_acceleration_rad_s2: float | None


@dataclass(frozen=True, slots=True)
class ImpactScore:
    """Everything computed about one impact."""

    model: str
    incidence: float
    criteria: Mapping[str, CriterionScore]
    extra_criteria: Mapping[str, CriterionScore]
    brain_angle: BrainAngle | None
    peaks: Peaks
    quality: tuple[QualityNote, ...]
    filters: tuple[AppliedFilter, ...]
    angular_velocity_source: str | None
    angular_acceleration_source: str | None
    conventions: Mapping[str, str] = field(default_factory=lambda: CONVENTIONS)


def score(
    preparation: Preparation,
    model: RiskModel = LAKSARI_2020,
    *,
    incidence: float | None = None,
    extra_criteria: Sequence[str] = (),
) -> ImpactScore:
    """Score one impact.

    Parameters
    ----------
    preparation
        The impact, from :func:`headimpact.preparation.prepare`.
    model
        The risk model; the published one unless given.
    incidence
        Concussions per impact to serve probabilities at (0 to 1, exclusive); the model's own unless given.
    extra_criteria
        Names from :data:`headimpact.criteria.extra.EXTRA_CRITERIA`.

    Raises
    ------
    UnknownCriterion
        A name in `extra_criteria` is none of ours.
    """
    extras = _extra(extra_criteria)
    table = _Table(evaluate(preparation.kinematics), model, incidence, impacts=1)
    return table.score(0, preparation, extras)


def score_many(
    preparations: Sequence[Preparation],
    model: RiskModel = LAKSARI_2020,
    *,
    incidence: float | None = None,
    extra_criteria: Sequence[str] = (),
) -> list[ImpactScore]:
    """Score many impacts, those of equal length, rate and signals together. Equal to :func:`score` bit for bit."""
    extras = _extra(extra_criteria)
    scores: list[ImpactScore | None] = [None] * len(preparations)
    for block in _blocks(preparations):
        table = _Table(evaluate(_stacked([preparations[i].kinematics for i in block])), model, incidence, len(block))
        for row, i in enumerate(block):
            scores[i] = table.score(row, preparations[i], extras)
    return [found for found in scores if found is not None]


def _extra(names: Sequence[str]) -> list[ExtraCriterion]:
    unknown = [name for name in names if name not in EXTRA_CRITERIA]
    if unknown:
        raise UnknownCriterion(f"Extra criteria are: {', '.join(EXTRA_CRITERIA)}.")
    return [EXTRA_CRITERIA[name] for name in names]


def _blocks(preparations: Sequence[Preparation]) -> Iterable[list[int]]:
    alike: dict[tuple[object, ...], list[int]] = defaultdict(list)
    for i, preparation in enumerate(preparations):
        k = preparation.kinematics
        alike[k.samples, k.sample_rate_hz, present_signals(k)].append(i)
    for members in alike.values():
        for first in range(0, len(members), BLOCK):
            yield members[first : first + BLOCK]


def _stacked(motions: Sequence[HeadKinematics]) -> HeadKinematics:
    """A block of impacts, time first."""
    first = motions[0]

    def stack(name: str) -> FloatArray | None:
        if getattr(first, name) is None:
            return None
        return np.stack([getattr(motion, name) for motion in motions], axis=2)

    return HeadKinematics(
        first.sample_rate_hz, stack("linear_acceleration_g"), stack("angular_velocity"), stack("angular_acceleration")
    )


class _Table:
    """Values and probabilities of a block, row by impact, and the scores read from it."""

    def __init__(self, evaluation: Evaluation, model: RiskModel, incidence: float | None, impacts: int) -> None:
        self._model = model
        self._incidence = model.incidence if incidence is None else incidence
        self._evaluation = evaluation
        self._missing = _missing_signals(evaluation.kinematics)
        values = _tabulated(evaluation, impacts)
        predictors = _linear_predictors(values, model, model.incidence_shift(incidence))
        probabilities = expit(-predictors)
        self._values: list[list[list[float]]] = values.tolist()
        self._predictors: list[list[float]] = predictors.tolist()
        self._probabilities: list[list[float]] = probabilities.tolist()
        self._windows = {
            key: (_rows(start, impacts), _rows(stop, impacts)) for key, (start, stop) in evaluation.windows.items()
        }
        self._peaks = _peak_rows(evaluation.kinematics, impacts)
        self._angles = _angle_rows(evaluation.brain_angle, impacts)

    def score(self, row: int, preparation: Preparation, extras: Sequence[ExtraCriterion]) -> ImpactScore:
        kinematics = preparation.kinematics
        criteria = {
            criterion.key: self._criterion(row, column, criterion, kinematics)
            for column, criterion in enumerate(CRITERIA)
        }
        return ImpactScore(
            model=self._model.version,
            incidence=self._incidence,
            criteria=criteria,
            extra_criteria={extra.key: _extra_score(extra, kinematics) for extra in extras},
            brain_angle=self._brain_angle(row, criteria["bam"], kinematics),
            peaks=Peaks(*(None if rows is None else rows[row] for rows in self._peaks)),
            quality=preparation.notes + tuple(self._notes(row, preparation)),
            filters=preparation.filters,
            angular_velocity_source=preparation.angular_velocity_source,
            angular_acceleration_source=preparation.angular_acceleration_source,
        )

    def _criterion(self, row: int, column: int, criterion: Criterion, kinematics: HeadKinematics) -> CriterionScore:
        key = criterion.key
        reason = self._missing.get(key)
        if reason is not None:
            return CriterionScore(key, None, criterion.unit, reason=reason)
        x, y, z = self._values[row][column]
        value = (x, y, z) if criterion.components == 3 else x
        window = self._window(row, key, kinematics) if key in self._windows else None
        if key not in self._model.curves:
            reason = f"Model {self._model.version} has no curve for it."
            return CriterionScore(key, value, criterion.unit, window_ms=window, reason=reason)
        return CriterionScore(
            key, value, criterion.unit, self._probabilities[row][column], self._predictors[row][column], window
        )

    def _window(self, row: int, key: str, kinematics: HeadKinematics) -> tuple[float, float] | None:
        starts, stops = self._windows[key]
        start, stop = starts[row], stops[row]
        return None if start == stop else (kinematics.time_ms(start), kinematics.time_ms(stop))

    def _brain_angle(self, row: int, bam: CriterionScore, kinematics: HeadKinematics) -> BrainAngle | None:
        if self._angles is None or not isinstance(bam.value, tuple):
            return None
        resultants, samples = self._angles
        x, y, z = (kinematics.time_ms(sample) for sample in samples[row])
        return BrainAngle(bam.value, resultants[row], (x, y, z))

    def _notes(self, row: int, preparation: Preparation) -> Iterable[QualityNote]:
        angle_peaks = None if self._angles is None else self._angles[1][row]
        yield from check_units(preparation.kinematics)
        yield from check_truncation(preparation.kinematics, angle_peaks, preparation.pre_trigger_known)


def _missing_signals(kinematics: HeadKinematics) -> dict[str, str]:
    """Why each criterion that cannot be had cannot: by key."""
    present = present_signals(kinematics)
    if len(present) == len(SIGNALS):
        return {}
    absent = {criterion.key: set(criterion.needs) - present for criterion in CRITERIA}
    return {key: missing_reason(names) for key, names in absent.items() if names}


def _tabulated(evaluation: Evaluation, impacts: int) -> FloatArray:
    """Values as impacts x criteria x 3, zero where a criterion has one component or none."""
    values = np.zeros((impacts, len(CRITERIA), 3))
    for column, criterion in enumerate(CRITERIA):
        found = evaluation.values.get(criterion.key)
        if found is not None:
            if criterion.components == 3:
                values[:, column] = found.T
            else:
                values[:, column, 0] = found
    return values


def _linear_predictors(values: FloatArray, model: RiskModel, shift: float) -> FloatArray:
    b0, b = model.coefficients
    terms = values * b
    total: FloatArray = terms[..., 0] + terms[..., 1]
    total += terms[..., 2]
    total += b0
    total += shift
    return total


def _rows(found: FloatArray | IntArray, impacts: int) -> list[Any]:
    """One entry per impact of something evaluated on one impact or on a block."""
    return [found.tolist()] if impacts == 1 and found.ndim == 0 else found.tolist()


def _peak_rows(kinematics: HeadKinematics, impacts: int) -> tuple[list[float] | None, ...]:
    """Peak resultants of linear acceleration, angular velocity and angular acceleration, one per impact."""
    k = kinematics
    return (
        None if k.linear_acceleration_g is None else _rows(k.peak_linear_acceleration_g, impacts),
        None if k.angular_velocity is None else _rows(k.peak_angular_velocity, impacts),
        None if k.angular_acceleration is None else _rows(k.peak_angular_acceleration, impacts),
    )


def _angle_rows(history: FloatArray | None, impacts: int) -> tuple[list[float], list[list[int]]] | None:
    """Peak resultant brain angle of each impact, and the sample at which each axis peaks."""
    if history is None:
        return None
    resultants = _rows(np.sqrt(largest(squared_norm(history))), impacts)
    samples = np.abs(history).argmax(axis=0)
    return resultants, [samples.tolist()] if history.ndim == 2 else samples.T.tolist()


def _extra_score(extra: ExtraCriterion, kinematics: HeadKinematics) -> CriterionScore:
    missing = set(extra.needs) - present_signals(kinematics)
    if missing:
        return CriterionScore(extra.key, None, extra.unit, reason=missing_reason(missing))
    found = extra.evaluate(kinematics)
    return CriterionScore(extra.key, found.value, extra.unit, risks=found.risks)
