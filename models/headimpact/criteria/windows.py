"""The maximum of HIC's form over all windows, the heart of HIC and RIC.

max over t1 < t2 of (t2 - t1) (1/(t2 - t1) integral of x)^2.5 with t2 - t1 at most a limit (inclusive, as in
49 CFR 571.208). Windows start and end on samples. For a window of k intervals the best start is the one with the
largest integral M(k), so the value is M(k)^2.5 / (k dt)^1.5 and one power per length k is enough.
"""

from __future__ import annotations

from functools import lru_cache
from math import floor, sqrt

import numpy as np
from numpy.typing import NDArray

from headimpact.kinematics import running_integral

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]

# Above this many candidate windows, one impact is searched by branch and bound instead of in one table.
TABLE_SIZE = 20_000


def window_intervals(limit_s: float, sample_rate_hz: float, samples: int) -> int:
    """The longest window, in sampling intervals; the small addend keeps 15 ms at 1 kHz from reading as 14 intervals."""
    return min(floor(limit_s * sample_rate_hz + 1e-6), samples - 1)


def window_maxima(
    x: FloatArray, sample_rate_hz: float, limits_s: tuple[float, ...]
) -> list[tuple[FloatArray, IntArray, IntArray]]:
    """The largest windowed value under each limit.

    Parameters
    ----------
    x
        A resultant, not negative, time first: n, or n x m for a block of impacts.
    sample_rate_hz
        Samples per second [Hz].
    limits_s
        Longest windows [s], ascending: all are found in one pass.

    Returns
    -------
    list of (value, start, stop)
        Per limit; value in (unit of x)^2.5 s, start and stop as sample numbers. Of equal windows, the shortest and then
        the earliest. A record without any motion has value 0 and the window (0, 0).
    """
    integral = running_integral(x, sample_rate_hz)
    lengths = [window_intervals(limit, sample_rate_hz, x.shape[0]) for limit in limits_s]
    if x.ndim == 1:
        return [_as_arrays(found) for found in _single(integral, sample_rate_hz, lengths)]
    if lengths[-1] * x.shape[0] > TABLE_SIZE:
        columns = [_single(np.ascontiguousarray(column), sample_rate_hz, lengths) for column in integral.T]
        return [_stack([column[i] for column in columns]) for i in range(len(lengths))]
    return _block(integral, sample_rate_hz, lengths)


def _as_arrays(found: tuple[float, int, int]) -> tuple[FloatArray, IntArray, IntArray]:
    return np.float64(found[0]), np.intp(found[1]), np.intp(found[2])  # type: ignore[return-value] # 0-d


def _stack(found: list[tuple[float, int, int]]) -> tuple[FloatArray, IntArray, IntArray]:
    value, start, stop = zip(*found, strict=True)
    return np.array(value), np.array(start, dtype=np.intp), np.array(stop, dtype=np.intp)


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


def _block(
    integral: FloatArray, sample_rate_hz: float, lengths: list[int]
) -> list[tuple[FloatArray, IntArray, IntArray]]:
    """Every window length of a block of impacts: subtract and take the maximum, once per length."""
    n, m = integral.shape
    longest = lengths[-1]
    largest = np.empty((longest, m))
    difference = np.empty((n - 1, m))
    for k in range(1, longest + 1):
        rows = np.subtract(integral[k:], integral[:-k], out=difference[: n - k])
        np.maximum.reduce(rows, axis=0, out=largest[k - 1])
    values = _value(largest, _durations(longest, sample_rate_hz)[:, None])
    results = []
    for length in lengths:
        best = values[:length].argmax(axis=0)
        results.append(_locate(integral, values[best, np.arange(m)], best + 1))
    return results


def _locate(integral: FloatArray, value: FloatArray, k: IntArray) -> tuple[FloatArray, IntArray, IntArray]:
    """The first start whose window of k intervals has the largest integral, for each impact of a block."""
    n = integral.shape[0]
    rows = np.arange(n)[:, None] + k
    ends = np.take_along_axis(integral, np.minimum(rows, n - 1), axis=0)
    start = np.where(rows < n, ends - integral, -1.0).argmax(axis=0)
    moved = value > 0
    return value, np.where(moved, start, 0), np.where(moved, start + k, 0)


def _single(integral: FloatArray, sample_rate_hz: float, lengths: list[int]) -> list[tuple[float, int, int]]:
    if lengths[-1] * integral.size <= TABLE_SIZE:
        return _single_by_table(integral, sample_rate_hz, lengths)
    return _single_by_bound(integral, sample_rate_hz, lengths)


def _window(integral: FloatArray, value: float, k: int) -> tuple[float, int, int]:
    if value <= 0:
        return 0.0, 0, 0
    start = int((integral[k:] - integral[:-k]).argmax())
    return value, start, start + k


def _single_by_table(integral: FloatArray, sample_rate_hz: float, lengths: list[int]) -> list[tuple[float, int, int]]:
    """All windows of a short record in one table, a row per length.

    The integral is continued by its last value. A window that overhangs the end is then a longer one with the same
    integral as the window that stops there, so it never wins.
    """
    longest = lengths[-1]
    continued = np.empty(integral.size + longest)
    continued[: integral.size] = integral
    continued[integral.size :] = integral[-1]
    step = continued.itemsize
    ends = np.ndarray((longest, integral.size - 1), np.float64, continued, step, (step, step))
    largest = np.maximum.reduce(ends - integral[:-1], axis=1)
    values = _value(largest, _durations(longest, sample_rate_hz))
    found = []
    for length in lengths:
        best = int(values[:length].argmax())
        found.append(_window(integral, float(values[best]), best + 1))
    return found


def _single_by_bound(integral: FloatArray, sample_rate_hz: float, lengths: list[int]) -> list[tuple[float, int, int]]:
    """Branch and bound over the window length, for long records at high rates.

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
