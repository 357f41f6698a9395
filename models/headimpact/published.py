"""Published constants and risk models, read from the data files that name their sources."""

from __future__ import annotations

import tomllib
from functools import cache
from importlib.resources import files
from typing import Any


@cache
def data_file(name: str) -> dict[str, Any]:
    """A data file of this package, by its name without ``.toml``."""
    return tomllib.loads((files("headimpact") / "data" / f"{name}.toml").read_text(encoding="utf-8"))


UNITS: dict[str, Any] = data_file("units")
FILTERS: dict[str, Any] = data_file("filters")
BRAIN_MODEL: dict[str, Any] = data_file("brain_model")
CRITERIA_CONSTANTS: dict[str, Any] = data_file("criteria")
EXTRA_CONSTANTS: dict[str, Any] = data_file("extra_criteria")
QUALITY_LIMITS: dict[str, Any] = data_file("quality")
