"""The times of one impact's signals in a table: each has its rows, and a rate or stamps for them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from headimpact.recording import SignalName
from headimpact_service.ingest.stamps import may_be_stated, nominal_rate
from headimpact_service.ingest.table import FloatArray
from headimpact_service.ingest.windows import Rows


@dataclass(frozen=True, slots=True)
class Track:
    """One signal's rows; `rate` [Hz] is stated, `stamps` are as written, in units of so many milliseconds.

    Stamps that are `dated` count from no trigger and no start.
    """

    name: SignalName
    rows: Rows
    rate: float | None
    stamps: FloatArray | None
    milliseconds: float
    dated: bool = False

    @property
    def span_ms(self) -> tuple[float, float] | None:
        """The first and the last stamp [ms]."""
        if self.stamps is None or not self.stamps.size:
            return None
        return float(self.stamps[0]) * self.milliseconds, float(self.stamps[-1]) * self.milliseconds

    @property
    def samples_per_s(self) -> float | None:
        """The rate, as it is stated or as the stamps have it on average [Hz]."""
        span = self.span_ms
        if self.rate is not None or self.stamps is None or span is None or not span[0] < span[1] < np.inf:
            return self.rate
        return 1000.0 * (self.stamps.size - 1) / (span[1] - span[0])

    @property
    def from_zero_ms(self) -> tuple[float, float] | None:
        """The same from what the stamps count from; dates are infinitely far from any trigger."""
        return (np.inf, np.inf) if self.dated else self.span_ms


_UNSCALED = {1.0, 1000.0}
TimeBase = tuple[float | None, FloatArray | None]
"""A rate [Hz], or the stamps [s] where they say none."""


def time_bases(tracks: Sequence[Track]) -> list[TimeBase]:
    """The rate of each track, as stated or as its uniform stamps say, else its stamps.

    A rate that is only said by stamps stands for them where all signals begin together: a rate says nothing of when a
    signal begins, and nobody says when one of a stated rate does. Nor does it where stamps say nearly one rate.
    """
    stamped = [track for track in tracks if track.rate is None and track.stamps is not None]
    times = {id(track.stamps): _seconds(track, _origin(stamped)) for track in stamped}
    starts = {float(seconds[0]) for seconds in times.values() if seconds.size}
    together = len(starts) <= 1 and len(stamped) in {0, len(tracks)}
    rates = {key: nominal_rate(seconds) if together else None for key, seconds in times.items()}
    if not may_be_stated(rates.values()):
        rates = dict.fromkeys(rates)
    bases: list[TimeBase] = []
    for track in tracks:
        if track.rate is not None or track.stamps is None:
            bases.append((track.rate, None))
        else:
            rate = rates[id(track.stamps)]
            bases.append((rate, times[id(track.stamps)] if rate is None else None))
    return bases


def _origin(stamped: Sequence[Track]) -> float:
    """What is taken off the stamps before they are scaled: counts of hours would lose their last digits.

    Seconds stay as they are, and milliseconds are divided by 1000, as everywhere.
    """
    units = {track.milliseconds for track in stamped}
    if len(units) != 1 or units <= _UNSCALED:
        return 0.0
    return min(
        (float(track.stamps[0]) for track in stamped if track.stamps is not None and track.stamps.size), default=0.0
    )


def _seconds(track: Track, origin: float) -> FloatArray:
    stamps = np.empty(0) if track.stamps is None else track.stamps
    if track.milliseconds == 1000.0:
        return stamps
    if track.milliseconds == 1.0:
        return stamps / 1000.0
    return _without_noise(stamps - origin, origin) * track.milliseconds / 1000.0


def _without_noise(elapsed: FloatArray, origin: float) -> FloatArray:
    """Time since an origin, rounded to the digits that its stamps could hold: nanoseconds from 1970 are to 256."""
    noise = 2.0 * float(np.spacing(abs(origin)))
    if noise < 1.0:
        return elapsed
    grid = 10.0 ** np.ceil(np.log10(noise))
    rounded: FloatArray = np.rint(elapsed / grid) * grid
    return rounded
