"""A refit: every criterion of a cohort fitted, judged and compared, and the model that comes of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from headimpact.calibration.cohort import Cohort, component_names, parts_of
from headimpact.calibration.criterion_refit import CriterionRefit, Resamples, Setting, refit_criterion
from headimpact.calibration.discrimination import DeLongTest, auc, delong_test
from headimpact.calibration.logistic import FloatArray
from headimpact.calibration.options import RefitOptions
from headimpact.calibration.resampling import counts_of_clusters, counts_of_rows, drawn_with_replacement
from headimpact.calibration.thresholds import confusion, order_statistic_interval
from headimpact.calibration.validation import folds_by_athlete
from headimpact.criteria import CRITERION_KEYS
from headimpact.errors import CalibrationError
from headimpact.risk import KnownPoint, RiskCurve, RiskModel

IntArray = NDArray[np.intp]
REFERENCE = "bam"
"""The criterion that the others are compared with."""


@dataclass(frozen=True)
class Comparison:
    """DeLong's test of two criteria's areas, on the impacts that have both: of their scores, and out of fold."""

    first: str
    second: str
    apparent: DeLongTest
    out_of_fold: DeLongTest | None


@dataclass(frozen=True)
class Refit:
    """What a refit found out.

    Parameters
    ----------
    cohort
        What it was fitted on.
    options
        What it was asked to do.
    criteria
        By name, those that could be fitted.
    failed
        By name, why the others could not.
    comparisons
        Of every two criteria.
    active
        The version of the model in service that it was compared with.
    """

    cohort: Cohort
    options: RefitOptions
    criteria: Mapping[str, CriterionRefit]
    failed: Mapping[str, CalibrationError]
    comparisons: Sequence[Comparison]
    active: str | None

    @property
    def reference_tests(self) -> int:
        """m of Bonferroni's correction of the tests against the reference criterion."""
        return max(len(self.criteria) - 1, 0) if REFERENCE in self.criteria else 0


def refit(cohort: Cohort, options: RefitOptions | None = None, active: RiskModel | None = None) -> Refit:
    """Fit and judge the criteria of a cohort.

    Parameters
    ----------
    cohort
        Impacts with outcomes.
    options
        What to do; the defaults unless given.
    active
        The model in service, to compare with.

    Raises
    ------
    CalibrationError
        The cohort has outcomes of one kind only, or no criterion could be fitted; the message says what is missing.
    """
    options = options or RefitOptions()
    if cohort.events == 0 or cohort.events == cohort.n:
        lacking = "with" if cohort.events == 0 else "without"
        raise CalibrationError(
            "no-events" if cohort.events == 0 else "no-non-events",
            f"The cohort has {cohort.n} impacts, and none {lacking} a concussion.",
        )
    setting = _setting(cohort, options)
    criteria: dict[str, CriterionRefit] = {}
    failed: dict[str, CalibrationError] = {}
    for name in options.criteria or [key for key in CRITERION_KEYS if key in cohort.criteria]:
        try:
            criteria[name] = _one(name, cohort, setting, active)
        except CalibrationError as error:
            failed[name] = error
    if not criteria:
        raise _nothing_fitted(failed)
    return Refit(cohort, options, criteria, failed, _comparisons(criteria), None if active is None else active.version)


def _nothing_fitted(failed: Mapping[str, CalibrationError]) -> CalibrationError:
    """Why no criterion could be fitted, each reason under the criteria that met it."""
    if not failed:
        return CalibrationError("no-criteria", "The cohort has no values of any criterion.")
    met: dict[str, list[str]] = {}
    for name, error in failed.items():
        met.setdefault(str(error), []).append(name)
    told = " ".join(f"{', '.join(names)}: {reason}" for reason, names in met.items())
    return CalibrationError(next(iter(failed.values())).code, f"No criterion could be fitted. {told}")


def _setting(cohort: Cohort, options: RefitOptions) -> Setting:
    """Folds and resamples; what is drawn comes of the seed, each from a stream of its own."""
    for_folds, for_impacts, for_athletes = np.random.default_rng(options.seed).spawn(3)
    if options.resamples is not None:
        by_impact = counts_of_rows(options.resamples, cohort.n)[cohort.position]
    else:
        by_impact = counts_of_rows(drawn_with_replacement(cohort.n, options.replicas, for_impacts), cohort.n)
    athletes = drawn_with_replacement(cohort.athlete_count, options.replicas, for_athletes)
    resamples = Resamples(by_impact, counts_of_clusters(athletes, cohort.clusters))
    return Setting(options, cohort.clusters, _folds(cohort, options, for_folds), resamples)


def _folds(cohort: Cohort, options: RefitOptions, generator: np.random.Generator) -> IntArray:
    given = options.folds
    if isinstance(given, int):
        folds = min(given, cohort.athlete_count)
        return folds_by_athlete(cohort.clusters, cohort.outcome, folds, generator)
    unknown = sorted(set(cohort.athletes) - set(given))
    if unknown:
        raise CalibrationError("folds", f"The folds lack {len(unknown)} of the cohort's athletes.")
    return np.array([given[athlete] for athlete in cohort.athletes], dtype=np.intp)


def _one(name: str, cohort: Cohort, setting: Setting, active: RiskModel | None) -> CriterionRefit:
    lacking = [key for key in parts_of(name) if key not in cohort.criteria]
    if lacking:
        raise CalibrationError("missing-criterion", f"The cohort has no values of {', '.join(lacking)}.")
    rows = cohort.complete(name)
    if not rows.any():
        raise CalibrationError("missing-criterion", f"No impact of the cohort has a value of {name}.")
    sample = cohort.sample(name)
    return refit_criterion(name, sample, rows, setting, _active_predictor(name, sample.x, setting.options, active))


def _active_predictor(name: str, x: FloatArray, options: RefitOptions, active: RiskModel | None) -> FloatArray | None:
    """What the model in service gives, in the usual sign; at the refit's incidence where that is declared."""
    if active is None or name not in active.curves:
        return None
    curve = active.curves[name]
    found: FloatArray = -(curve.b0 + active.incidence_shift(options.tau) + x @ np.array(curve.b))
    return found


def _comparisons(criteria: Mapping[str, CriterionRefit]) -> list[Comparison]:
    """Every two criteria, the reference first."""
    names = sorted(criteria, key=lambda name: name != REFERENCE)
    return [_compared(criteria[a], criteria[b]) for i, a in enumerate(names) for b in names[i + 1 :]]


def _compared(first: CriterionRefit, second: CriterionRefit) -> Comparison:
    common = first.rows & second.rows
    y = first.sample.y[common[first.rows]]
    pairs = [(first.score[common[first.rows]], second.score[common[second.rows]])]
    if not isinstance(first.out_of_fold, str) and not isinstance(second.out_of_fold, str):
        pairs.append(
            (
                first.out_of_fold.linear_predictor[common[first.rows]],
                second.out_of_fold.linear_predictor[common[second.rows]],
            )
        )
    tests = [_tested(y, a, b) for a, b in pairs]
    apparent = tests[0]
    assert apparent is not None
    return Comparison(first.name, second.name, apparent, tests[1] if len(tests) > 1 else None)


def _tested(y: FloatArray, a: FloatArray, b: FloatArray) -> DeLongTest | None:
    known = np.isfinite(a) & np.isfinite(b)
    if not 0 < y[known].sum() < known.sum():
        return None
    return delong_test(auc(y[known], a[known]), auc(y[known], b[known]))


def fitted_model(found: Refit, version: str, title: str = "") -> RiskModel:
    """The model of a refit: a curve for each criterion of the thirteen, with its covariance and operating points.

    Parameters
    ----------
    found
        The refit.
    version
        What the model is to be called.
    title
        What it is, for people.

    Raises
    ------
    CalibrationError
        None of the thirteen was fitted alone.
    """
    single = {name: one for name, one in found.criteria.items() if name in CRITERION_KEYS}
    if not single:
        raise CalibrationError("no-criteria", "A model needs a curve of at least one of the thirteen criteria.")
    options, cohort = found.options, found.cohort
    incidence = options.tau if options.tau is not None else cohort.events / cohort.n
    return RiskModel(
        version=version,
        title=title or f"Refit on {cohort.n} impacts with {cohort.events} concussions",
        source="Fitted by Headimpact; not published.",
        population=f"{cohort.athlete_count} athletes of the cohort {cohort.digest}",
        incidence=incidence,
        curves={name: _curve(one) for name, one in single.items()},
        operating_points={name: _known_points(one, options.level) for name, one in single.items()},
        basis="cohort",
        cohort={
            "n": cohort.n,
            "events": cohort.events,
            "athletes": cohort.athlete_count,
            "athletes_with_events": cohort.athletes_with_events,
            "digest": cohort.digest,
            "sampling": options.sampling,
            "bias_correction": options.bias_correction,
            "seed": options.seed,
        },
    )


def _curve(one: CriterionRefit) -> RiskCurve:
    """In the sign of the published table, p = 1/(1 + exp(b0 + b.x))."""
    intercept, *slopes = (-one.coefficients).tolist()
    return RiskCurve(intercept, tuple(slopes), (), tuple(tuple(row) for row in one.covariance.tolist()))


def _known_points(one: CriterionRefit, level: float) -> tuple[KnownPoint, ...]:
    """The threshold of every sensitivity that the cohort's events can show, at the served coefficients.

    The threshold of a sensitivity that the fit was asked for has the interval of that sensitivity, as its report has.
    """
    y, served = one.sample.y, one.served
    asked = {threshold.value: threshold.bounds for threshold in one.served_thresholds}
    thresholds = np.unique(served[y == 1.0])[::-1]
    points = []
    for value in thresholds.tolist():
        achieved = confusion(y, served, value)
        bounds = asked.get(value) or order_statistic_interval(y, served, achieved.sensitivity, level)
        points.append(
            KnownPoint(
                sensitivity=achieved.sensitivity,
                linear_predictor=-value,
                linear_predictor_interval=(
                    None if bounds.high is None else -bounds.high,
                    None if bounds.low is None else -bounds.low,
                ),
                specificity=achieved.specificity,
            )
        )
    return tuple(points)


def coefficient_names(name: str) -> list[str]:
    """The intercept, and the components of a criterion."""
    return ["intercept", *component_names(name)]
