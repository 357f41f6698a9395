"""Expected values from R and the data that they were computed from, all synthetic: tests/data/stats."""

from __future__ import annotations

import csv
import json
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from headimpact.calibration.logistic import LogisticFit, Sample, fit
from headimpact.calibration.resampling import counts_of_clusters, counts_of_rows

FOLDER = Path(__file__).parent / "data" / "stats"
ROWS: list[dict[str, Any]] = json.loads((FOLDER / "reference_fixture.json").read_text())["results"]
BY_ID = {row["id"]: row for row in ROWS}


@cache
def table(name: str) -> dict[str, list[str]]:
    """A data set, by column, as text."""
    with (FOLDER / f"{name}.csv").open() as lines:
        rows = list(csv.DictReader(lines))
    return {column: [row[column] for row in rows] for column in rows[0]}


def column(data: str, name: str) -> np.ndarray:
    return np.array(table(data)[name], dtype=float)


@cache
def sample(data: str, formula: str) -> Sample:
    """The sample of an R formula such as ``y ~ x1 + x2``."""
    names = [name.strip() for name in formula.split("~")[1].split("+")]
    return Sample(column(data, "y"), np.stack([column(data, name) for name in names], axis=1))


@cache
def fitted(data: str, formula: str) -> LogisticFit:
    return fit(sample(data, formula))


def formula_of(data: str, name: str) -> str:
    """The formula of a criterion by its short name: the column itself, or its three components."""
    columns = [name] if name in table(data) else [f"{name}_{axis}" for axis in "xyz"]
    return "y ~ " + " + ".join(columns)


def score(data: str, name: str) -> tuple[np.ndarray, np.ndarray]:
    """Outcomes, and a criterion as one score: its column, or the fitted linear predictor of its components."""
    if name in table(data):
        return column(data, "y"), column(data, name)
    return column(data, "y"), fitted(data, formula_of(data, name)).linear_predictor


def clusters(data: str) -> np.ndarray:
    names = table(data).get("athlete_id") or table(data)["athlete"]
    return np.unique(names, return_inverse=True)[1]


def _numbers(name: str) -> list[list[int]]:
    return [[int(number) for number in line.split(",")] for line in (FOLDER / name).read_text().split()]


@cache
def row_counts(data: str) -> np.ndarray:
    """The fixed bootstrap resamples by impact."""
    return counts_of_rows(_numbers(f"bootidx_{data}.csv"), len(table(data)["y"]))


@cache
def cluster_counts(data: str) -> np.ndarray:
    """The fixed bootstrap resamples by athlete."""
    return counts_of_clusters(_numbers(f"bootclusters_{data}.csv"), clusters(data))


@cache
def folds(data: str) -> np.ndarray:
    fold_of = dict(zip(table(f"folds_{data}")["athlete_id"], table(f"folds_{data}")["fold"], strict=True))
    return np.array([int(fold_of[name]) for name in table(data)["athlete_id"]])
