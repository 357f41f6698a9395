"""What headings of times and of rates say: the unit, and the sensor where it has times or a rate of its own."""

from __future__ import annotations

import re

from headimpact.recording import SignalName
from headimpact_service.ingest.mapping import TIME_UNITS
from headimpact_service.ingest.spelling import unit_ending, unit_spelled, words_of

_TIMES = frozenset({"t", "time", "times", "stamp", "timestamp", "timestamps", "elapsed", "zeit", "temps", "tiempo"})
_TIME_OF_ONE = re.compile(r"t[a-z]|[a-z]*time[a-z]*")
"""A word such as `tg` or `gyrotime`."""
_INSIDE = frozenset(
    {"ms", "msec", "millisec", "milliseconds", "us", "usec", "microsec", "microseconds", "ns", "sec", "secs", "seconds"}
)
"""Units of time that mean one wherever they stand in a heading; a lone `s` may be a part of another unit."""
_RATES = frozenset(
    {
        *(
            "rate",
            "srate",
            "frequency",
            "freq",
            "freqs",
            "fs",
            "fsamp",
            "fsample",
            "hz",
            "khz",
            "sr",
            "odr",
            "sampling",
        ),
        *("dt", "step", "timestep", "interval", "period", "tvec", "tms", "ts", "tt", "timebase"),
    }
)
_RATE = frozenset({"rate", "frequency", "freq", "frequenz", "frequence", "frecuencia", "frequenza", "taux"})
_OF_SAMPLES = frozenset(
    {
        *("sample", "samples", "sampling", "acquisition", "logging"),
        *("abtast", "echantillonnage", "acquisizione", "muestreo", "campionamento"),
    }
)
_OF_SAMPLED = _OF_SAMPLES | {"sampled", "acquired", "recorded", "logged", "daq"}
_TRIGGER = frozenset({"trigger", "triggered", "rel", "relative", "contact", "zero"})
LEAST_HZ = 100.0
"""What is said to be a rate and is less is none of samples, unless it says so."""
_PERIODS = frozenset({"dt", "interval", "period", "step", "abtastintervall", "abtastperiode"})
_ALONE = frozenset(
    {
        *("odr", "sr", "sps", "abtastrate", "abtastfrequenz", "messrate", "samplerate", "samplingrate"),
        *("samplefreq", "samplingfreq", "samplefrequency", "samplingfrequency"),
    }
)
_PER_SECOND = re.compile(r"samples?\s*(/|per)\s*s(ec(onds?)?)?", re.IGNORECASE)
_SAMPLES_PER_S = {"s/s": 1.0, "sa/s": 1.0, "sps": 1.0, "ks/s": 1000.0, "ksa/s": 1000.0, "ksps": 1000.0}
_NOT_OF_SAMPLES = frozenset(
    {
        *("filter", "cut", "cutoff", "corner", "lowpass", "highpass", "bandwidth"),
        *("heart", "pulse", "respiration", "ecg", "emg", "video", "camera", "audio", "frames", "fps"),
        *("mag", "magnetometer", "baro", "barometer", "gps", "quat", "quaternion", "temp", "temperature"),
        *("original", "raw", "native", "source", "min", "max", "minimum", "maximum", "limit", "high"),
        *(
            "load",
            "cell",
            "microphone",
            "mic",
            "strain",
            "gauge",
            "force",
            "pressure",
            "radar",
            "aggregate",
            "internal",
        ),
        *("supported", "decimated", "downsampled", "resampled", "code", "dominant", "excitation", "fundamental"),
        *("calibration", "nyquist", "content", "band", "loading", "peak", "filtered"),
    }
)
"""Words of what has times and rates of its own and is none of the signals, or no longer those of the samples."""
_OTHER_RATES = frozenset(
    {
        *("low", "pass", "notch", "resonant", "resonance", "natural", "line", "mains"),
        *("trigger", "export", "report", "reporting", "transmission", "update", "refresh"),
    }
)
"""Words of what has a frequency that is none of samples."""
_OF_SIGNALS = frozenset({"rad", "deg", "degrees", "dps", "g", "m", "x", "y", "z"})
"""Words of a signal's units and axes."""
_SENSORS: dict[SignalName, frozenset[str]] = {
    "linear_acceleration": frozenset({"acc", "accel", "accelerometer", "lin", "linear"}),
    "angular_velocity": frozenset({"gyr", "gyro", "gyroscope", "ang", "angular", "rot", "rotational", "ars", "omega"}),
}
"""Words for the sensor of a signal."""
_ANY_SENSOR = frozenset[str]().union(*_SENSORS.values())


def speaks_of_times(heading: str) -> bool:
    """Whether a heading may be that of times or of a rate of the samples, in whatever unit."""
    words = _words(heading)
    return bool(words & (_TIMES | _RATES | _INSIDE)) and not words & _NOT_OF_SAMPLES


def may_be_times(heading: str) -> bool:
    """Whether a heading may be that of times: it speaks of them, or of a signal's sensor with a unit of time."""
    words = _words(heading)
    if words & _NOT_OF_SAMPLES:
        return False
    spoken = bool(words & (_TIMES | _INSIDE)) or any(map(_TIME_OF_ONE.fullmatch, words))
    return spoken or (bool(words & _ANY_SENSOR) and unit_of_times(heading, None) is not None)


def names_trigger(heading: str) -> bool:
    """Whether a heading of times says that they count from the trigger."""
    words = _words(heading)
    return bool(words & _TIMES and words & _TRIGGER)


def speaks_of_samples(text: str) -> bool:
    """Whether a sentence is about how samples were taken, and not about a filter or another instrument."""
    words = _words(text)
    return bool(words & (_OF_SAMPLED | _ALONE)) and not words & (_NOT_OF_SAMPLES | _OTHER_RATES)


def period_of_samples(heading: str, beside: str | None) -> float | None:
    """Milliseconds that make one of what a column of the samples' period may say; None for any other heading."""
    words = _words(heading)
    if words & (_NOT_OF_SAMPLES | _OF_SIGNALS) or not words & _PERIODS:
        return None
    unit = unit_of_times(heading, beside)
    of_samples = words & (_OF_SAMPLES | _ANY_SENSOR | {"dt", "abtastintervall", "abtastperiode"})
    return TIME_UNITS[unit] if unit is not None and of_samples else None


def unit_of_times(heading: str, beside: str | None) -> str | None:
    """The unit of time that a heading names, or that stands beside it."""
    words = _words(heading)
    inside = next((word for word in words_of(heading) if word in _INSIDE), None)
    at_end = None if words & _OF_SIGNALS - {"x", "y"} else unit_ending("time", heading)
    return unit_spelled("time", beside) or at_end or unit_spelled("time", inside)


def sensor_of_times(heading: str) -> SignalName | None:
    """The signal whose sensor a heading names that speaks of times outright."""
    words = _words(heading)
    named = [signal for signal, spelled in _SENSORS.items() if words & spelled]
    return named[0] if len(named) == 1 and words & _TIMES else None


def hertz_of_rates(heading: str, beside: str | None, *, fs_is_rate: bool) -> float | None:
    """How many hertz make one of what a column of a sample rate may say; None for any other heading.

    Of one sensor `fs` behind its name may be its full scale, unless the table has a rate of this name.
    """
    if _PER_SECOND.fullmatch(heading.strip()):
        return 1.0
    fs_is_rate = fs_is_rate or words_of(heading)[:1] == ["fs"]
    words = _words(heading) | _words(beside or "")
    if words & (_NOT_OF_SAMPLES | _OF_SIGNALS | _OTHER_RATES):
        return None
    if words & _OF_SAMPLES and (thousands := _SAMPLES_PER_S.get((beside or "").lower())) is not None:
        return thousands
    if len(words) == 1 and words & (_RATE | {"hz", "fs", "srate", "fsamp", "fsample"}):
        return 1.0
    rate_alone = words <= _RATE | {"hz", "khz", "k"}
    in_hertz = "hz" in words and (rate_alone or words & (_OF_SAMPLES | _ANY_SENSOR | {"fs"}))
    of_one = words & _ANY_SENSOR and (words & _RATE or (fs_is_rate and "fs" in words))
    if in_hertz or of_one or (words & _RATE and words & _OF_SAMPLES) or words & _ALONE or _are_per_second(words):
        return 1000.0 if "khz" in f"{heading} {beside}".lower() else 1.0
    return None


def names_samples(heading: str) -> bool:
    """Whether a heading of a rate speaks of samples or a sensor: a `rate` or a `frequency` may be of anything."""
    words = _words(heading)
    return bool(words & (_OF_SAMPLED | _ALONE | _ANY_SENSOR | {"fs", "srate", "fsamp", "fsample"}))


def _are_per_second(words: set[str]) -> bool:
    return {"samples", "per"} <= words and bool(words & {"s", "sec", "second", "seconds"})


def _words(heading: str) -> set[str]:
    return set(words_of(heading))
