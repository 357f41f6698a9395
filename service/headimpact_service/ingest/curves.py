"""Single channels of a laboratory, each a file or a column of its own, put together into the signals of one head."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from headimpact.cut_offs import LowPass
from headimpact.quality import QualityNote, words
from headimpact.recording import AXES, AxesName, Recording, Signal, SignalName
from headimpact_service.ingest.file_faults import file_fault
from headimpact_service.ingest.stamps import may_be_stated
from headimpact_service.ingest.table import FloatArray

BETWEEN = 0.1
"""Of a step: how far the samples of two axes of one signal may be apart, as times in headers are rounded."""


@dataclass(frozen=True, slots=True)
class Curve:
    """One channel's samples; `rate` [Hz] is None where its stamps [s] are not uniform."""

    axis: str
    unit: str
    values: FloatArray
    stamps_s: FloatArray
    rate: float | None
    full_scale: float | None = None


Curves = Mapping[SignalName, Sequence[Curve]]


def head_recording(
    signals: Curves, *, axes: AxesName, low_pass: LowPass, trigger_known: bool = True, fill_gaps: bool = False
) -> Recording:
    """The recording that a head's channels make; time zero is the trigger.

    The curves of a signal are cut to what they share; what signals share is found when they are scored. An axis that a
    signal lacks is no number.

    Raises
    ------
    Problem
        422: the curves of a signal differ in rate or unit, or do not overlap.
    """
    aligned = {name: _common(curves) for name, curves in signals.items()}
    starts = {float(curves[0].stamps_s[0]) for curves in aligned.values()}
    rates = [curves[0].rate for curves in aligned.values()]
    start_s, stamped = min(starts), len(starts) > 1 or not may_be_stated(rates)
    sent: dict[str, Any] = {name: _signal(curves, stamped=stamped) for name, curves in aligned.items()}
    return Recording(
        axes=axes,
        low_pass=low_pass,
        pre_trigger_ms=round(-1000.0 * start_s, 9) + 0.0 if trigger_known and start_s <= 0.0 else None,
        fill_gaps=fill_gaps,
        **sent,
    )


def _common(curves: Sequence[Curve]) -> list[Curve]:
    """Curves of one rate cut to the samples that all of them have."""
    rate = curves[0].rate
    if any(curve.rate != rate for curve in curves):
        raise file_fault("The curves of one signal must be sampled at one rate.", "rates-differ")
    if rate is None:
        return _on_the_same_stamps(curves)
    start = max(float(curve.stamps_s[0]) for curve in curves)
    later = [(start - float(curve.stamps_s[0])) * rate for curve in curves]
    offsets = [round(samples) for samples in later]
    for curve, samples, offset in zip(curves, later, offsets, strict=True):
        if abs(samples - offset) > BETWEEN:
            raise file_fault(
                f"The samples of {curve.axis} lie {abs(samples - offset):.2g} of a step between those of another axis "
                "of the same signal: bring them to common times.",
                "rates-differ",
            )
    count = min(curve.values.size - offset for curve, offset in zip(curves, offsets, strict=True))
    if count < 3:
        raise file_fault("The head's curves must overlap in time by at least 3 samples.", "no-overlap")
    return [
        replace(curve, values=curve.values[o : o + count], stamps_s=curve.stamps_s[o : o + count])
        for curve, o in zip(curves, offsets, strict=True)
    ]


def check_twice(signal: SignalName, read: tuple[str, Curve], other: tuple[str, Curve]) -> Iterator[QualityNote]:
    """One channel that a file gives twice: what was read of it against the other, each with its name."""
    (name, curve), (other_name, other_curve) = read, other
    if curve.unit == other_curve.unit and curve.values.size == other_curve.values.size:
        if np.array_equal(curve.values, other_curve.values, equal_nan=True):
            return
        differences = np.abs(curve.values - other_curve.values)
        what = f"differ by up to {np.nanmax(differences, initial=0.0):.4g} {curve.unit}"
    else:
        sizes = (f"{one.values.size} samples in {one.unit}" for one in (curve, other_curve))
        what = f"differ ({' and '.join(sizes)})"
    detail = f"{name} and {other_name} say that they are the same channel and {what}; {name} was read."
    yield QualityNote("channel_given_twice", "warning", detail, signal, curve.axis)


def check_cut(signal: SignalName, curves: Sequence[Curve], read: FloatArray) -> Iterator[QualityNote]:
    """What the curves of one signal lose by being cut to what all of them have, the samples that are `read`."""
    for curve in curves:
        if len(read) < curve.values.size:
            detail = (
                f"Of the {curve.values.size} samples of the {words(signal)} on {curve.axis}, those "
                f"{len(read)} are read that all its axes have."
            )
            yield QualityNote("sample_count_mismatch", "warning", detail, signal, curve.axis)
            yield from _peak_cut(signal, curve, read[:, AXES.index(curve.axis)])


def _peak_cut(signal: SignalName, curve: Curve, read: FloatArray) -> Iterator[QualityNote]:
    within, whole = (float(np.nanmax(np.abs(values), initial=0.0)) for values in (read, curve.values))
    if whole > within:
        detail = (
            f"The {words(signal)} on {curve.axis} is larger where not all its axes were recorded, {whole:.4g} "
            f"{curve.unit}, than where they were, {within:.4g} {curve.unit}; only that was read."
        )
        yield QualityNote("peak_cut_off", "warning", detail, signal, curve.axis)


def _on_the_same_stamps(curves: Sequence[Curve]) -> list[Curve]:
    if any(not np.array_equal(curve.stamps_s, curves[0].stamps_s) for curve in curves):
        raise file_fault("Curves whose stamps are not uniform must share them.", "rates-differ")
    return list(curves)


def _signal(curves: Sequence[Curve], *, stamped: bool) -> Signal:
    """One signal on its rate or, where the signals do not begin together or nearly share a rate, on its stamps.

    Stamps are thousandths of milliseconds, as all that can be sent again are.
    """
    rate = None if stamped else curves[0].rate
    return Signal(
        values=_values(curves),
        unit=_unit(curves),
        sample_rate_hz=rate,
        time_s=curves[0].stamps_s * 1000.0 / 1000.0 if rate is None else None,
        declared_range=_range(curves),
    )


def _values(curves: Sequence[Curve]) -> FloatArray:
    values = np.full((curves[0].values.size, len(AXES)), np.nan)
    for curve in curves:
        values[:, AXES.index(curve.axis)] = curve.values
    return values


def _unit(curves: Sequence[Curve]) -> str:
    units = {curve.unit for curve in curves}
    if len(units) > 1:
        raise file_fault("The curves of one signal must be in one unit.", "units-differ")
    return units.pop()


def _range(curves: Sequence[Curve]) -> float | None:
    """The sensors' full scale, where all have one: their largest, so that no smaller one raises a false alarm."""
    scales = [curve.full_scale for curve in curves]
    return max(scale for scale in scales if scale is not None) if all(scales) else None
