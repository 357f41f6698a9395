"""The paper's thirteen criteria: one ordered registry, and their evaluation on one impact or a block of impacts."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field

from headimpact.criteria import combined, rotational, translational
from headimpact.criteria.windows import FloatArray, IntArray
from headimpact.kinematics import HeadKinematics, largest_magnitude
from headimpact.recording import SignalName

Window = tuple[IntArray, IntArray]


@dataclass(slots=True)
class Evaluation:
    """Values of criteria, by key, as they are computed: one value or one per axis for each impact."""

    kinematics: HeadKinematics
    values: dict[str, FloatArray] = field(default_factory=dict)
    windows: dict[str, Window] = field(default_factory=dict)
    brain_angle: FloatArray | None = None


def _rotation(evaluation: Evaluation) -> None:
    evaluation.values["peak_angular_acceleration"] = rotational.peak_angular_acceleration(evaluation.kinematics)
    value, start, stop = rotational.ric(evaluation.kinematics)
    evaluation.values["ric"] = value
    evaluation.windows["ric"] = (start, stop)
    evaluation.brain_angle = rotational.brain_angle(evaluation.kinematics)
    evaluation.values["bam"] = largest_magnitude(evaluation.brain_angle)


def _velocity(evaluation: Evaluation) -> None:
    evaluation.values["delta_angular_velocity"] = rotational.delta_angular_velocity(evaluation.kinematics)
    evaluation.values["bric"] = rotational.bric(evaluation.kinematics)


def _translation(evaluation: Evaluation) -> None:
    evaluation.values["peak_linear_acceleration"] = translational.peak_linear_acceleration(evaluation.kinematics)
    for key, (value, start, stop) in zip(
        ("hic15", "hic36"), translational.hic15_and_hic36(evaluation.kinematics), strict=True
    ):
        evaluation.values[key] = value
        evaluation.windows[key] = (start, stop)
    evaluation.values["si"] = translational.severity_index(evaluation.kinematics)


def _combination(evaluation: Evaluation) -> None:
    evaluation.values["hip"], evaluation.values["hip3d"] = combined.head_impact_power(evaluation.kinematics)
    evaluation.values["gambit"] = combined.gambit(evaluation.kinematics)
    evaluation.values["vtcp"] = combined.vtcp(evaluation.kinematics)


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


def present_signals(kinematics: HeadKinematics) -> frozenset[str]:
    """Names of the signals that the kinematics hold."""
    held = {
        "linear_acceleration": kinematics.linear_acceleration_g,
        "angular_velocity": kinematics.angular_velocity,
        "angular_acceleration": kinematics.angular_acceleration,
    }
    return frozenset(name for name, array in held.items() if array is not None)


def evaluate(kinematics: HeadKinematics) -> Evaluation:
    """Every criterion that the recorded signals allow.

    Parameters
    ----------
    kinematics
        Motion of one impact (n x 3) or of a block of m impacts (n x 3 x m).

    Returns
    -------
    Evaluation
        `values` by key, shaped () or (3,) for one impact, (m,) or (3, m) for a block; a criterion whose signals are
        absent is absent. `windows` of HIC and RIC as sample numbers; `brain_angle` the history at the samples [rad].
    """
    evaluation = Evaluation(kinematics)
    present = present_signals(kinematics)
    for family in (ROTATION, VELOCITY, TRANSLATION, COMBINATION):
        if present.issuperset(family.needs):
            family.evaluate(evaluation)
    return evaluation


def missing_reason(missing: Iterable[str]) -> str:
    """Why a criterion has no value, in words."""
    words = " and ".join(name.replace("_", " ") for name in sorted(missing))
    return f"No {words} was recorded."
