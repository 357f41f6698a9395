"""Zero-phase low-pass filtering: a second-order Butterworth filter run forward and backward."""

from __future__ import annotations

from functools import lru_cache
from math import pi, sqrt, tan

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dtbtrs

FloatArray = NDArray[np.float64]

SHORT = 128
"""Samples up to which a record's product with a matrix is taken: at 100 samples twelve times as fast as the recursion.
The matrix costs as much as seven recursions, so it is kept for rates that are set, not measured: whole hertz."""


def low_pass(x: FloatArray, corner_hz: float, sample_rate_hz: float) -> FloatArray:
    """Filter every record forward and backward.

    Equal to ``scipy.signal.sosfiltfilt`` of ``butter(2, corner_hz)`` with odd extension by min(9, n - 1) samples. The
    recursion y[i] + a1 y[i-1] + a2 y[i-2] = r[i] is a triangular system of three bands, which LAPACK solves record by
    record, and its transpose is the backward pass: as fast as that function's own filter, without the second and the
    50 MB that importing ``scipy.signal`` costs each process.

    Parameters
    ----------
    x
        Samples, time on the last axis: ... x 3 x n.
    corner_hz
        The Butterworth corner [Hz], from :func:`headimpact.cut_offs.corner_frequency`.
    sample_rate_hz
        Samples per second [Hz].
    """
    n = x.shape[-1]
    if n <= SHORT and float(sample_rate_hz).is_integer():
        # component by component, as `matmul` goes through a stack of rows: the bits of a product depend on its size
        rows = np.ascontiguousarray(x)[..., None, :]
        products: FloatArray = np.matmul(rows, _operator(n, corner_hz, sample_rate_hz))
        return products[..., 0, :]
    return _recursion(x, corner_hz, sample_rate_hz)


@lru_cache(maxsize=64)
def _operator(samples: int, corner_hz: float, sample_rate_hz: float) -> FloatArray:
    """What the filter makes of each sample alone, n x n: it is linear, so a record comes out as their product."""
    operator = np.ascontiguousarray(_recursion(np.eye(samples), corner_hz, sample_rate_hz))
    operator.flags.writeable = False
    return operator


def _recursion(x: FloatArray, corner_hz: float, sample_rate_hz: float) -> FloatArray:
    """The filter, sample by sample."""
    n = x.shape[-1]
    margin = min(9, n - 1)
    extended = _odd_extension(x, margin).reshape(-1, n + 2 * margin)
    design = _design(corner_hz, sample_rate_hz)
    bands = _bands(design, extended.shape[1])
    forward, _ = dtbtrs(bands, _driven(design, extended).T, uplo="L", diag="U", overwrite_b=True)
    mirrored = _driven(design, forward.T[:, ::-1])[:, ::-1]
    backward, _ = dtbtrs(bands, mirrored.T, uplo="L", trans="T", diag="U", overwrite_b=True)
    filtered: FloatArray = backward.T[:, margin : margin + n].reshape(x.shape)
    return filtered


Design = tuple[float, float, float]
"""b0, a1 and a2 of y[i] + a1 y[i-1] + a2 y[i-2] = b0 (x[i] + 2 x[i-1] + x[i-2])."""


@lru_cache(maxsize=256)
def _design(corner_hz: float, sample_rate_hz: float) -> Design:
    """Two Butterworth poles through the bilinear transform, the corner kept in its place."""
    k = tan(pi * corner_hz / sample_rate_hz)
    scale = 1.0 + sqrt(2.0) * k + k * k
    return k * k / scale, 2.0 * (k * k - 1.0) / scale, (1.0 - sqrt(2.0) * k + k * k) / scale


@lru_cache(maxsize=16)
def _bands(design: Design, samples: int) -> FloatArray:
    """The triangular matrix of the recursion, as LAPACK takes its diagonals."""
    _, a1, a2 = design
    bands = np.empty((3, samples), order="F")
    bands[0], bands[1], bands[2] = 1.0, a1, a2
    return bands


def _driven(design: Design, x: FloatArray) -> FloatArray:
    """What drives the recursion: b0 (x[i] + 2 x[i-1] + x[i-2]), as if the first sample had stood before it for ever."""
    b0, _, a2 = design
    pairs = x[:, 1:] + x[:, :-1]
    driven = np.empty_like(x)
    np.add(pairs[:, 1:], pairs[:, :-1], out=driven[:, 2:])
    driven[:, 2:] *= b0
    driven[:, 0] = x[:, 0]
    driven[:, 1:2] = b0 * x[:, 1:2] + (3.0 * b0 - a2) * x[:, :1]
    return driven


def _odd_extension(x: FloatArray, count: int) -> FloatArray:
    """Mirror each record through its end points, so that the filter meets no step there."""
    n = x.shape[-1]
    extended = np.empty((*x.shape[:-1], n + 2 * count))
    extended[..., count : count + n] = x
    np.subtract(2 * x[..., :1], x[..., count:0:-1], out=extended[..., :count])
    np.subtract(2 * x[..., -1:], x[..., -2 : -count - 2 : -1], out=extended[..., count + n :])
    return extended
