"""The paper's thirteen criteria: one ordered registry, and their evaluation on one impact or a block of impacts."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from functools import cached_property

from headimpact.brain import peaks_of
from headimpact.criteria import combined, rotational, translational
from headimpact.criteria.windows import IntArray, WindowMaxima, window_maxima
from headimpact.kinematics import FloatArray, Motion
from headimpact.recording import SignalName

LIMITS_S = (translational.HIC15_LIMIT_S, translational.HIC36_LIMIT_S)
"""Longest windows of HIC and RIC [s]: RIC's is that of HIC36, so that one pass finds them all."""
assert rotational.RIC_LIMIT_S == translational.HIC36_LIMIT_S


@dataclass
class Evaluation:
    """Criteria of m impacts, by key, as they are computed: m values, or 3 x m of them, one per axis."""

    motion: Motion
    values: dict[str, FloatArray] = field(default_factory=dict)
    windows: dict[str, tuple[IntArray, IntArray]] = field(default_factory=dict)
    brain_angle: FloatArray | None = None
    """At every sample, n x 3 x m [rad]."""
    brain_angle_resultant: FloatArray | None = None
    """Its largest norm, m [rad]."""

    def take_window(self, key: str, limit: int, acceleration: int) -> None:
        """A criterion of HIC's form, with its window: under which of :data:`LIMITS_S`, of which acceleration."""
        at = (limit, acceleration)
        self.values[key] = self._maxima.value[at]
        self.windows[key] = (self._maxima.start[at], self._maxima.stop[at])

    @cached_property
    def _maxima(self) -> WindowMaxima:
        """The windowed maxima of the accelerations that are there, found in one pass: limits x accelerations x m."""
        resultants = self.motion.resultants[:, self.motion.rows.accelerations]
        n, accelerations, m = resultants.shape
        found = window_maxima(resultants.reshape(n, -1), self.motion.sample_rate_hz, LIMITS_S)
        shape = (len(LIMITS_S), accelerations, m)
        return WindowMaxima(found.value.reshape(shape), found.start.reshape(shape), found.stop.reshape(shape))


def _rotation(evaluation: Evaluation) -> None:
    evaluation.values["peak_angular_acceleration"] = rotational.peak_angular_acceleration(evaluation.motion)
    evaluation.take_window("ric", 1, -1)
    evaluation.brain_angle = rotational.brain_angle(evaluation.motion)
    evaluation.values["bam"], evaluation.brain_angle_resultant = peaks_of(evaluation.brain_angle)


def _velocity(evaluation: Evaluation) -> None:
    evaluation.values["delta_angular_velocity"] = rotational.delta_angular_velocity(evaluation.motion)
    evaluation.values["bric"] = rotational.bric(evaluation.motion)


def _translation(evaluation: Evaluation) -> None:
    evaluation.values["peak_linear_acceleration"] = translational.peak_linear_acceleration(evaluation.motion)
    evaluation.take_window("hic15", 0, 0)
    evaluation.take_window("hic36", 1, 0)
    evaluation.values["si"] = translational.severity_index(evaluation.motion)


def _combination(evaluation: Evaluation) -> None:
    evaluation.values["hip"], evaluation.values["hip3d"] = combined.head_impact_power(evaluation.motion)
    evaluation.values["gambit"] = combined.gambit(evaluation.motion)
    evaluation.values["vtcp"] = combined.vtcp(evaluation.motion)


@dataclass(frozen=True, slots=True)
class Family:
    """Criteria that need the same signals and share intermediate results."""

    needs: tuple[SignalName, ...]
    evaluate: Callable[[Evaluation], None]


ROTATION = Family(("angular_acceleration",), _rotation)
VELOCITY = Family(("angular_velocity",), _velocity)
TRANSLATION = Family(("linear_acceleration",), _translation)
COMBINATION = Family(("linear_acceleration", "angular_acceleration"), _combination)


@dataclass(frozen=True, slots=True)
class Criterion:
    """One criterion: its key, its full name, how many values it has (3 = one per axis), their unit and its source."""

    key: str
    name: str
    components: int
    unit: str
    family: Family
    source: str

    @property
    def needs(self) -> tuple[SignalName, ...]:
        """The signals without which it has no value."""
        return self.family.needs


CRITERIA: tuple[Criterion, ...] = (
    Criterion("peak_angular_acceleration", "Peak angular acceleration", 3, "rad/s^2", ROTATION, "Laksari et al. 2020"),
    Criterion("delta_angular_velocity", "Peak change in angular velocity", 3, "rad/s", VELOCITY, "Laksari et al. 2020"),
    Criterion("bric", "Brain injury criterion", 1, "-", VELOCITY, "Takhounts et al. 2013"),
    Criterion("ric", "Rotational injury criterion", 1, "(rad/s^2)^2.5 s", ROTATION, "Kimpara & Iwamoto 2012"),
    Criterion("peak_linear_acceleration", "Peak linear acceleration", 3, "g", TRANSLATION, "Laksari et al. 2020"),
    Criterion("hic15", "Head injury criterion, 15 ms", 1, "g^2.5 s", TRANSLATION, "49 CFR 571.208"),
    Criterion("hic36", "Head injury criterion, 36 ms", 1, "g^2.5 s", TRANSLATION, "49 CFR 571.208"),
    Criterion("si", "Gadd severity index", 1, "g^2.5 s", TRANSLATION, "Gadd 1966"),
    Criterion("hip", "Head impact power", 1, "W", COMBINATION, "Newman et al. 2000"),
    Criterion("hip3d", "Head impact power by axis", 3, "W", COMBINATION, "Newman et al. 2000"),
    Criterion("gambit", "Generalised acceleration model", 1, "-", COMBINATION, "Newman 1986"),
    Criterion("vtcp", "Virginia Tech combined probability", 1, "-", COMBINATION, "Rowson & Duma 2013"),
    Criterion("bam", "Brain angle metric", 3, "rad", ROTATION, "Laksari et al. 2020"),
)
CRITERION_KEYS: tuple[str, ...] = tuple(criterion.key for criterion in CRITERIA)
BY_KEY: dict[str, Criterion] = {criterion.key: criterion for criterion in CRITERIA}


def evaluate(motion: Motion) -> Evaluation:
    """Every criterion that the recorded signals allow.

    Parameters
    ----------
    motion
        Of m impacts.

    Returns
    -------
    Evaluation
        `values` by key, m or 3 x m; a criterion whose signals are absent is absent. `windows` of HIC and RIC as sample
        numbers; the history of the brain angle at the samples [rad].
    """
    evaluation = Evaluation(motion)
    present = set(motion.signals)
    for family in (ROTATION, VELOCITY, TRANSLATION, COMBINATION):
        if present.issuperset(family.needs):
            family.evaluate(evaluation)
    return evaluation


def missing_reason(missing: Iterable[str]) -> str:
    """Why a criterion has no value, in words."""
    words = " and ".join(name.replace("_", " ") for name in sorted(missing))
    return f"No {words} was recorded."
