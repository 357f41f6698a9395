"""Bootstrap refits of 13 criteria, against statsmodels in a loop; and what they agree to.

    uv run python benchmarks/refit.py [--replicas 1000]

The cohort is the synthetic one of the tests, of 914 impacts. Both fit the same resamples, in turn, criterion by
criterion; times are the process's CPU. Where statsmodels settles, coefficients are compared by the largest difference
over the largest coefficient, in units of the predictors' standard deviations.
"""

from __future__ import annotations

import argparse
import csv
import time
import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np
import statsmodels.api as sm

from headimpact.calibration.logistic import Sample, fit, fit_resamples
from headimpact.calibration.resampling import counts_of_rows, drawn_with_replacement

TABLE = Path(__file__).parents[1] / "tests" / "data" / "stats" / "impacts914.csv"
VECTORS = ("alpha", "domega", "a", "hip", "bam")
SCALARS = ("bric", "ric", "hic15", "hic36", "si", "hip", "gambit", "vtcp")


def samples() -> dict[str, Sample]:
    """The thirteen criteria's samples."""
    with TABLE.open() as lines:
        rows = list(csv.DictReader(lines))
    y = np.array([row["y"] for row in rows], dtype=float)

    def columns(names: list[str]) -> np.ndarray:
        return np.array([[row[name] for name in names] for row in rows], dtype=float)

    vectors = {f"{name}3": Sample(y, columns([f"{name}_{axis}" for axis in "xyz"])) for name in VECTORS}
    return vectors | {name: Sample(y, columns([name])) for name in SCALARS}


Peer = Callable[[np.ndarray, np.ndarray], np.ndarray | None]


def logit(y: np.ndarray, x: np.ndarray) -> np.ndarray | None:
    """Newton's method; None where it does not settle."""
    result = sm.Logit(y, x).fit(disp=0, tol=1e-12, maxiter=100)
    return result.params if result.mle_retvals["converged"] else None


def glm(y: np.ndarray, x: np.ndarray) -> np.ndarray | None:
    """Iteratively reweighted least squares; None where it does not settle."""
    result = sm.GLM(y, x, family=sm.families.Binomial()).fit(tol=1e-12, maxiter=100)
    return result.params if result.converged else None


def loop(peer: Peer, sample: Sample, resamples: list[np.ndarray]) -> np.ndarray:
    """statsmodels, one resample after the other; NaN where it fails."""
    found = np.full((sample.design.shape[1], len(resamples)), np.nan)
    scaled = sample.design / sample.scale
    for column, rows in enumerate(resamples):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            try:
                params = peer(sample.y[rows], scaled[rows])
            except Exception:  # separated resamples: it raises, or diverges
                continue
        if params is not None:
            found[:, column] = params
    return found


def main() -> None:
    """Time all three, and compare."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--replicas", type=int, default=1000)
    replicas = parser.parse_args().replicas
    resamples = list(drawn_with_replacement(914, replicas, np.random.default_rng(1)))
    counts = counts_of_rows(resamples, 914)
    spent = {"ours": 0.0, "Logit": 0.0, "GLM": 0.0}
    worst, compared = 0.0, 0
    for sample in samples().values():
        start = time.process_time()
        ours = fit_resamples(sample, counts, fit(sample).coefficients)
        spent["ours"] += time.process_time() - start
        for name, peer in (("Logit", logit), ("GLM", glm)):
            start = time.process_time()
            theirs = loop(peer, sample, resamples)
            spent[name] += time.process_time() - start
            known = np.isfinite(theirs).all(axis=0) & ours.converged
            scaled = ours.coefficients[:, known] * sample.scale[:, None]
            difference = np.abs(scaled - theirs[:, known]).max(axis=0) / np.abs(scaled).max(axis=0)
            worst, compared = max(worst, float(difference.max())), compared + int(known.sum())
    print(f"13 criteria x {replicas} replicas: ours {spent['ours']:.2f} s")
    for name in ("Logit", "GLM"):
        print(f"statsmodels' {name}: {spent[name]:.1f} s, {spent[name] / spent['ours']:.1f} x")
    print(f"largest difference of {compared} fits that both settled: {worst:.2g}")


if __name__ == "__main__":
    main()
