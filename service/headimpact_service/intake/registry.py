"""Which risk model a version means: a published one, or one of the data set's own."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from headimpact.model_document import model_from_document
from headimpact.risk import LAKSARI_2020, PUBLISHED_MODELS, RiskModel
from headimpact_service.errors import Problem, not_found
from headimpact_service.intake.scoring import Terms, operating_points, requests_of
from headimpact_service.store import aliases, models

DEFAULT = LAKSARI_2020
"""What is active as long as nobody has promoted another."""
RESERVED = frozenset({"aliases", "fits", *aliases.ALIASES, *PUBLISHED_MODELS})
"""Names that no version of a data set may have."""
_REMEMBERED = 256
_known: dict[tuple[bytes, str], RiskModel] = {}


def model_of(conn: Any, data_set_id: bytes, version: str) -> RiskModel:  # noqa: ANN401 - a connection of the store
    """The model of a version; a `not-found` problem for none of the data set's.

    Versions do not change, so what was read once is remembered.
    """
    found = PUBLISHED_MODELS.get(version) or _known.get((data_set_id, version))
    if found is not None:
        return found
    stored = models.get(conn, data_set_id, version)
    if stored is None:
        raise not_found("model")
    if len(_known) >= _REMEMBERED:
        _known.clear()
    _known[data_set_id, version] = model_from_document(stored.document)
    return _known[data_set_id, version]


def active_model(conn: Any, data_set_id: bytes) -> RiskModel:  # noqa: ANN401 - a connection of the store
    """The model that scores the data set's new impacts."""
    version = aliases.get(conn, data_set_id, "active").version
    return DEFAULT if version is None else model_of(conn, data_set_id, version)


def require_promotable(model: RiskModel, incidence: float | None, points: Sequence[Mapping[str, object]]) -> None:
    """An `operating-point-unreachable` problem where the model lacks one that the organisation has set."""
    operating_points(requests_of(points), Terms(incidence=incidence, model=model))


def require_free(version: str) -> None:
    """A `conflict` problem for a name that is not to be had."""
    if version in RESERVED:
        raise Problem("conflict", "This name is taken for good; choose another.")
