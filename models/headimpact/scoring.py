"""Scoring: from prepared kinematics to criteria, probabilities and quality notes.

One path serves one impact and batches of them, so that both give the same numbers to the last bit.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from math import isnan
from typing import NamedTuple

import numpy as np
from scipy.special import expit

from headimpact.criteria import CRITERIA, Criterion, Evaluation, evaluate, missing_reason
from headimpact.criteria.extra import EXTRA_CRITERIA, ExtraCriterion
from headimpact.cut_offs import AppliedFilter
from headimpact.errors import UnknownCriterion
from headimpact.kinematics import FloatArray, HeadKinematics, Motion
from headimpact.preparation import Preparation, blocks_of
from headimpact.quality import QualityNote, check_truncation, check_units
from headimpact.recording import SIGNALS, SignalName
from headimpact.risk import LAKSARI_2020, RiskModel

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

AT_REST_RAD = 1e-12
"""Up to here a brain angle is the rounding of a filter: that of a gyroscope's offset is at 1e-15."""

NORMAL_975 = 1.959963984540054
"""The 97.5th percentile of the standard normal distribution."""


NO_RISKS: Mapping[str, float] = {}


class CriterionScore(NamedTuple):
    """One criterion of one impact: `value` and `probability` are None, with the `reason`, where it cannot be had.

    `probability_interval` is the 95 % interval that a fitted model's covariance leaves; None for a published one.
    """

    key: str
    value: float | Components | None
    unit: str
    probability: float | None = None
    linear_predictor: float | None = None
    window_ms: tuple[float, float] | None = None
    reason: str | None = None
    risks: Mapping[str, float] = NO_RISKS
    probability_interval: tuple[float, float] | None = None


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
    return _Table(preparation.motion, model, incidence).score(0, preparation, extras)


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
    for block in blocks_of(preparations):
        table = _Table(block.motion, model, incidence)
        for row, i in enumerate(block.members):
            scores[i] = table.score(row, preparations[i], extras)
    return [found for found in scores if found is not None]


def _extra(names: Sequence[str]) -> list[ExtraCriterion]:
    unknown = [name for name in names if name not in EXTRA_CRITERIA]
    if unknown:
        raise UnknownCriterion(f"Extra criteria are: {', '.join(EXTRA_CRITERIA)}.")
    return [EXTRA_CRITERIA[name] for name in names]


class _Table:
    """Values and probabilities of a block, row by impact, and the scores read from it."""

    def __init__(self, motion: Motion, model: RiskModel, incidence: float | None) -> None:
        evaluation = evaluate(motion)
        self._motion = motion
        self._model = model
        self._incidence = model.incidence if incidence is None else incidence
        self._missing = _missing_signals(motion.signals)
        values = _tabulated(evaluation)
        predictors = _linear_predictors(values, model, model.incidence_shift(incidence))
        self._values: list[list[list[float]]] = values.tolist()
        self._predictors: list[list[float]] = predictors.tolist()
        self._probabilities: list[list[float]] = expit(-predictors).tolist()
        self._intervals = _intervals(values, predictors, model)
        self._windows = {key: (start.tolist(), stop.tolist()) for key, (start, stop) in evaluation.windows.items()}
        self._peaks: dict[str, list[float]] = dict(zip(motion.signals, motion.peaks.tolist(), strict=True))
        self._resultants, self._angle_peaks = _angle_rows(evaluation)
        self._acceleration_peaks = _acceleration_peaks(motion)

    def score(self, row: int, preparation: Preparation, extras: Sequence[ExtraCriterion]) -> ImpactScore:
        criteria = {criterion.key: self._criterion(row, column, criterion) for column, criterion in enumerate(CRITERIA)}
        return ImpactScore(
            model=self._model.version,
            incidence=self._incidence,
            criteria=criteria,
            extra_criteria={extra.key: _extra_score(extra, preparation.kinematics) for extra in extras},
            brain_angle=self._brain_angle(row, criteria["bam"]),
            peaks=Peaks(*(None if name not in self._peaks else self._peaks[name][row] for name in SIGNALS)),
            quality=preparation.notes + tuple(self._notes(row, preparation)),
            filters=preparation.filters,
            angular_velocity_source=preparation.angular_velocity_source,
            angular_acceleration_source=preparation.angular_acceleration_source,
        )

    def _criterion(self, row: int, column: int, criterion: Criterion) -> CriterionScore:
        key = criterion.key
        reason = self._missing.get(key)
        if reason is not None:
            return CriterionScore(key, None, criterion.unit, reason=reason)
        x, y, z = self._values[row][column]
        value = (x, y, z) if criterion.components == 3 else x
        window = self._window(row, key) if key in self._windows else None
        if key not in self._model.curves:
            reason = f"Model {self._model.version} has no curve for it."
            return CriterionScore(key, value, criterion.unit, window_ms=window, reason=reason)
        return CriterionScore(
            key,
            value,
            criterion.unit,
            self._probabilities[row][column],
            self._predictors[row][column],
            window,
            probability_interval=self._interval(row, column),
        )

    def _interval(self, row: int, column: int) -> tuple[float, float] | None:
        if self._intervals is None:
            return None
        low, high = self._intervals[row][column]
        return None if isnan(low) else (low, high)

    def _window(self, row: int, key: str) -> tuple[float, float] | None:
        starts, stops = self._windows[key]
        start, stop = starts[row], stops[row]
        return None if start == stop else (self._motion.time_ms(start), self._motion.time_ms(stop))

    def _brain_angle(self, row: int, bam: CriterionScore) -> BrainAngle | None:
        if self._angle_peaks is None or not isinstance(bam.value, tuple):
            return None
        x, y, z = map(self._motion.time_ms, self._angle_peaks[row])
        return BrainAngle(bam.value, self._resultants[row], (x, y, z))

    def _notes(self, row: int, preparation: Preparation) -> Iterable[QualityNote]:
        a, alpha = self._peaks.get("linear_acceleration"), self._peaks.get("angular_acceleration")
        if a is not None and alpha is not None:
            yield from check_units(*(preparation.filtered_peaks or (a[row], alpha[row])))
        yield from check_truncation(
            self._motion,
            None if a is None or a[row] == 0 else self._acceleration_peaks[row],
            None if self._angle_peaks is None else self._angle_peaks[row],
            pre_trigger_known=preparation.pre_trigger_known,
        )


@lru_cache(maxsize=16)
def _missing_signals(present: tuple[SignalName, ...]) -> dict[str, str]:
    """Why each criterion that cannot be had cannot: by key."""
    absent = {criterion.key: set(criterion.needs) - set(present) for criterion in CRITERIA}
    return {key: missing_reason(names) for key, names in absent.items() if names}


def _tabulated(evaluation: Evaluation) -> FloatArray:
    """Values as impacts x criteria x 3, zero where a criterion has one component or none."""
    values = np.zeros((evaluation.motion.impacts, len(CRITERIA), 3))
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


def _intervals(values: FloatArray, predictors: FloatArray, model: RiskModel) -> list[list[list[float]]] | None:
    """The interval of each probability, impacts x criteria x 2; None where the model gives none.

    The variance of a linear predictor is x'Vx, summed term by term so that a batch rounds as each impact alone does.
    """
    covariances = model.covariances
    if covariances is None:
        return None
    x = [np.ones(values.shape[:2]), values[..., 0], values[..., 1], values[..., 2]]
    variance = np.zeros(values.shape[:2])
    for i in range(4):
        for j in range(4):
            variance += x[i] * covariances[:, i, j] * x[j]
    half = NORMAL_975 * np.sqrt(np.maximum(variance, 0.0))
    return np.stack((expit(-(predictors + half)), expit(-(predictors - half))), axis=-1).tolist()  # type: ignore[no-any-return]  # NumPy types tolist as Any


def _angle_rows(evaluation: Evaluation) -> tuple[list[float], list[list[int]] | None]:
    """Peak resultant brain angle of each impact, and the sample at which each axis peaks; without rotation, none.

    An axis that does not turn peaks at the first sample.
    """
    if evaluation.brain_angle is None or evaluation.brain_angle_resultant is None:
        return [], None
    samples = np.abs(evaluation.brain_angle).argmax(axis=0)
    samples[evaluation.values["bam"] <= AT_REST_RAD] = 0
    return evaluation.brain_angle_resultant.tolist(), samples.T.tolist()


def _acceleration_peaks(motion: Motion) -> list[int]:
    """The sample at which each impact's linear acceleration is largest; none where it was not recorded."""
    row = motion.rows.linear_acceleration
    return [] if row < 0 else motion.squared[:, row].argmax(axis=0).tolist()


def _extra_score(extra: ExtraCriterion, kinematics: HeadKinematics) -> CriterionScore:
    missing = set(extra.needs) - set(kinematics.motion.signals)
    if missing:
        return CriterionScore(extra.key, None, extra.unit, reason=missing_reason(missing))
    found = extra.evaluate(kinematics)
    return CriterionScore(extra.key, found.value, extra.unit, risks=found.risks)
