"""What a refit is asked to do."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

from headimpact.calibration.cohort import parts_of
from headimpact.criteria import BY_KEY, CRITERION_KEYS
from headimpact.errors import CalibrationError
from headimpact.risk import LAKSARI_2020

Sampling = Literal["case_control", "full_follow_up"]
BiasCorrection = Literal["king_zeng", "firth", "zelig", "none"]
SAMPLINGS: tuple[Sampling, ...] = ("case_control", "full_follow_up")
BIAS_CORRECTIONS: tuple[BiasCorrection, ...] = ("king_zeng", "firth", "zelig", "none")
MAX_REPLICAS = 10_000


def require_in_range(incidence: float, bounds: Sequence[float]) -> None:
    """Refuse a range of incidences that does not hold the one that intercepts are corrected to.

    Raises
    ------
    CalibrationError
        With the incidence, which is the bound of either end.
    """
    if not bounds[0] <= incidence <= bounds[1]:
        raise CalibrationError(
            "incidence-range",
            f"The incidence_range must hold the incidence, {incidence:.15g}: its first number is at most that, its "
            "second at least.",
        )


@dataclass(frozen=True)
class RefitOptions:
    """What a refit is asked to do.

    Parameters
    ----------
    criteria
        Keys, or several joined by a plus sign to be fitted together; all that the cohort has unless given.
    sampling
        ``case_control`` where impacts were chosen by their outcome: the intercept is corrected to the incidence.
        ``full_follow_up`` where every impact was followed up: it is not.
    incidence
        tau, concussions per impact in the population of a case-control sample; the published model's unless given.
    incidence_range
        The least and the greatest that it may be, for the range that leaves the intercept; it lies between them.
    bias_correction
        ``king_zeng``, ``firth``, ``zelig`` (reproduces the paper) or ``none``.
    replicas
        Of the bootstrap, by impact and by athlete each.
    seed
        Of everything that is drawn.
    folds
        How many folds by athlete, or the fold of every athlete.
    resamples
        Rows of each resample by impact, in the numbers of the rows as they came in; drawn unless given.
    sensitivity_targets
        Sensitivities that thresholds are wanted for.
    level
        Of the intervals.
    alpha
        Of the tests, before Bonferroni's correction.
    """

    criteria: tuple[str, ...] = ()
    sampling: Sampling = "case_control"
    incidence: float | None = None
    incidence_range: tuple[float, float] | None = None
    bias_correction: BiasCorrection = "king_zeng"
    replicas: int = 1000
    seed: int = 0
    folds: int | Mapping[str, int] = 5
    resamples: Sequence[Sequence[int]] | None = None
    sensitivity_targets: tuple[float, ...] = (0.5, 0.9)
    level: float = 0.95
    alpha: float = 0.05

    def __post_init__(self) -> None:
        for name in self.criteria:
            keys = parts_of(name)
            if any(key not in BY_KEY for key in keys) or len(set(keys)) < len(keys):
                raise CalibrationError(
                    "criteria", f"Criteria are: {', '.join(CRITERION_KEYS)}; a plus sign joins some."
                )
        if len({frozenset(parts_of(name)) for name in self.criteria}) < len(self.criteria):
            raise CalibrationError("criteria", "Each criterion may be named once.")
        if self.sampling not in SAMPLINGS:
            raise CalibrationError("sampling", f"The sampling is one of: {', '.join(SAMPLINGS)}.")
        if self.bias_correction not in BIAS_CORRECTIONS:
            raise CalibrationError("bias-correction", f"The bias correction is one of: {', '.join(BIAS_CORRECTIONS)}.")
        if self.incidence is not None and not 0.0 < self.incidence < 1.0:
            raise CalibrationError("incidence", "An incidence must be above 0 and below 1.")
        if self.incidence_range is not None and not 0.0 < self.incidence_range[0] <= self.incidence_range[1] < 1.0:
            raise CalibrationError("incidence-range", "A range of incidences rises from above 0 to below 1.")
        if self.incidence_range is not None and self.tau is not None:
            require_in_range(self.tau, self.incidence_range)
        if not 0 <= self.replicas <= MAX_REPLICAS:
            raise CalibrationError("replicas", f"Replicas are 0 to {MAX_REPLICAS}.")
        if not self.sensitivity_targets or not all(0.0 < target <= 1.0 for target in self.sensitivity_targets):
            raise CalibrationError("sensitivity", "A sensitivity is above 0 and at most 1.")
        if not (0.0 < self.level < 1.0 and 0.0 < self.alpha < 1.0):
            raise CalibrationError("level", "Levels are above 0 and below 1.")

    @property
    def tau(self) -> float | None:
        """The incidence that intercepts are corrected to; None where the sample is the population."""
        if self.sampling != "case_control":
            return None
        return LAKSARI_2020.incidence if self.incidence is None else self.incidence

    @property
    def ignored(self) -> tuple[str, ...]:
        """Options that were given and have no use here: a sample that is the population has its own incidence."""
        if self.sampling == "case_control":
            return ()
        return tuple(name for name in ("incidence", "incidence_range") if getattr(self, name) is not None)
