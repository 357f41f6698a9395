"""The maximum of HIC's form over all windows, the heart of HIC and RIC.

max over t1 < t2 of (t2 - t1) (1/(t2 - t1) integral of x)^2.5 with t2 - t1 at most a limit (inclusive, as in
49 CFR 571.208). Windows start and end on samples. For a window of k intervals the best start is the one with the
largest integral M(k), so the value is M(k)^2.5 / (k dt)^1.5 and one power per length k is enough.
"""

from __future__ import annotations

from functools import lru_cache
from math import floor, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from headimpact.kinematics import running_integral

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]

# Above this many candidate windows, a record is searched by branch and bound instead of in one table.
TABLE_SIZE = 20_000
# Below this many records, one table holds the windows of all.
FEW = 20


def window_intervals(limit_s: float, sample_rate_hz: float, samples: int) -> int:
    """The longest window, in sampling intervals; the small addend keeps 15 ms at 1 kHz from reading as 14 intervals."""
    return min(floor(limit_s * sample_rate_hz + 1e-6), samples - 1)


class WindowMaxima(NamedTuple):
    """Largest windowed values, limits x m, and the samples at which their windows start and stop."""

    value: FloatArray
    start: IntArray
    stop: IntArray


def window_maxima(x: FloatArray, sample_rate_hz: float, limits_s: tuple[float, ...]) -> WindowMaxima:
    """The largest windowed value under each limit.

    Parameters
    ----------
    x
        Resultants, not negative, time first: n x m.
    sample_rate_hz
        Samples per second [Hz].
    limits_s
        Longest windows [s], ascending: all are found in one pass.

    Returns
    -------
    WindowMaxima
        Values in (unit of x)^2.5 s, starts and stops as sample numbers. Of equal windows, the shortest and then the
        earliest. A record without any motion has value 0 and the window (0, 0).
    """
    return maxima_of_integral(running_integral(x, sample_rate_hz), sample_rate_hz, limits_s)


def maxima_of_integral(integral: FloatArray, sample_rate_hz: float, limits_s: tuple[float, ...]) -> WindowMaxima:
    """The same from the running integral of the resultants, n x m."""
    n, m = integral.shape
    lengths = [window_intervals(limit, sample_rate_hz, n) for limit in limits_s]
    if lengths[-1] * n > TABLE_SIZE:
        return _by_bound(integral, sample_rate_hz, lengths)
    if m < FEW:
        return _by_table(integral, sample_rate_hz, lengths)
    return _by_length(integral, sample_rate_hz, lengths)


def _value(m: FloatArray, duration_to_1_5: FloatArray) -> FloatArray:
    """M^2.5 / T^1.5, by products and roots: several times faster than powers."""
    return m * m * np.sqrt(m) / duration_to_1_5


@lru_cache(maxsize=64)
def _durations(longest: int, sample_rate_hz: float) -> FloatArray:
    """T^1.5 of windows of 1 to `longest` intervals [s^1.5]."""
    t = np.arange(1, longest + 1) / sample_rate_hz
    durations: FloatArray = t * np.sqrt(t)
    durations.flags.writeable = False
    return durations


def _by_length(integral: FloatArray, sample_rate_hz: float, lengths: list[int]) -> WindowMaxima:
    """Every window length of many records: subtract and take the maximum, once per length."""
    n, m = integral.shape
    longest = lengths[-1]
    largest = np.empty((longest, m))
    difference = np.empty((n - 1, m))
    for k in range(1, longest + 1):
        rows = np.subtract(integral[k:], integral[:-k], out=difference[: n - k])
        np.maximum.reduce(rows, axis=0, out=largest[k - 1])
    values = _value(largest, _durations(longest, sample_rate_hz)[:, None])
    best = np.stack([values[:length].argmax(axis=0) for length in lengths])
    start = np.stack([_first_largest(integral, k + 1) for k in best])
    return _found(values[best, np.arange(m)], start, best + 1)


def _first_largest(integral: FloatArray, k: IntArray) -> IntArray:
    """The first start whose window of k intervals has the largest integral, for each record."""
    n = integral.shape[0]
    ends = np.arange(n)[:, None] + k
    at_end = np.take_along_axis(integral, np.minimum(ends, n - 1), axis=0)
    found: IntArray = np.where(ends < n, at_end - integral, -1.0).argmax(axis=0)
    return found


def _found(value: FloatArray, start: IntArray, k: IntArray) -> WindowMaxima:
    """Windows of k intervals, none where nothing moved."""
    moved = value > 0
    return WindowMaxima(value, start * moved, (start + k) * moved)


def _by_table(integral: FloatArray, sample_rate_hz: float, lengths: list[int]) -> WindowMaxima:
    """All windows of a few short records in one table, a row per length.

    Each integral is continued by its last value. A window that overhangs the end is then a longer one with the same
    integral as the window that stops there, so it never wins.
    """
    n, m = integral.shape
    longest = lengths[-1]
    continued = np.empty((m, n + longest))
    continued[:, :n] = integral.T
    continued[:, n:] = continued[:, n - 1 : n]
    step = continued.itemsize
    strides = (continued.strides[0], step, step)
    ends = np.ndarray((m, longest, n - 1), np.float64, continued, step, strides)
    integrals = ends - continued[:, None, : n - 1]
    values = _value(np.maximum.reduce(integrals, axis=2), _durations(longest, sample_rate_hz))
    best = np.array([values[:, :length].argmax(axis=1) for length in lengths])
    records = np.arange(m)
    return _found(values[records, best], integrals[records, best].argmax(axis=2), best + 1)


def _window(integral: FloatArray, value: float, k: int) -> tuple[float, int, int]:
    if value <= 0:
        return 0.0, 0, 0
    start = int((integral[k:] - integral[:-k]).argmax())
    return value, start, start + k


def _by_bound(integral: FloatArray, sample_rate_hz: float, lengths: list[int]) -> WindowMaxima:
    """Long records at high rates, one by one."""
    found = [_one_by_bound(column, sample_rate_hz, lengths) for column in np.ascontiguousarray(integral.T)]
    value, start, stop = np.array(found).transpose(2, 1, 0)
    return WindowMaxima(value, start.astype(np.intp), stop.astype(np.intp))


def _one_by_bound(integral: FloatArray, sample_rate_hz: float, lengths: list[int]) -> list[tuple[float, int, int]]:
    """Branch and bound over the window length.

    M(k) never falls with k, so over the lengths a..b no value exceeds M(b)^2.5 / (a dt)^1.5. Spans whose bound is below
    the best value found are dropped, the others are halved: the cost grows like the rate, not like its square.
    """
    search = _LengthSearch(integral, sample_rate_hz)
    best_value, best_k, done = -1.0, 1, 0
    found = []
    for length in lengths:
        if length > done:
            best_value, best_k = search.best(done + 1, length, best_value, best_k)
            done = length
        found.append(_window(integral, best_value, best_k))
    return found


class _LengthSearch:
    """The largest windowed value over a span of window lengths."""

    def __init__(self, integral: FloatArray, sample_rate_hz: float) -> None:
        self._integral = integral
        self._buffer = np.empty(integral.size - 1)
        self._rate = sample_rate_hz
        self._largest: dict[int, float] = {}

    def best(self, first: int, last: int, best_value: float, best_k: int) -> tuple[float, int]:
        spans = [(first, last)]
        best_value, best_k = self._take(first, best_value, best_k)
        best_value, best_k = self._take(last, best_value, best_k)
        while spans:
            halves: list[tuple[int, int]] = []
            for a, b in spans:
                if b - a < 2 or self._bound(a, b) < best_value:
                    continue
                middle = (a + b) // 2
                best_value, best_k = self._take(middle, best_value, best_k)
                halves += [(a, middle), (middle, b)]
            # the most promising spans first: they raise the best value, which drops the others
            spans = sorted(halves, key=lambda span: -self._bound(*span))
        return best_value, best_k

    def _take(self, k: int, best_value: float, best_k: int) -> tuple[float, int]:
        value = self._value(self._largest_integral(k), k)
        if value > best_value or (value == best_value and k < best_k):
            return value, k
        return best_value, best_k

    def _bound(self, a: int, b: int) -> float:
        # a + 1: the value at a itself is known; the rounding of the bound is covered by its last factor
        return self._value(self._largest_integral(b), a + 1) * (1 + 1e-14)

    def _value(self, m: float, k: int) -> float:
        t = k / self._rate
        return m * m * sqrt(m) / (t * sqrt(t))

    def _largest_integral(self, k: int) -> float:
        found = self._largest.get(k)
        if found is None:
            rows = self._buffer[: self._integral.size - k]
            np.subtract(self._integral[k:], self._integral[:-k], out=rows)
            found = self._largest[k] = float(rows.max())
        return found
