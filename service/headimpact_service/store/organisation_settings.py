"""What an organisation has set: the incidence of its players, and the operating points it wants answered."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from sqlalchemy import Connection, bindparam, select, update

from headimpact_service.errors import not_found
from headimpact_service.store.revision import require_revision
from headimpact_service.store.tables import data_sets, organisations


@dataclass(frozen=True, slots=True)
class OrganisationSettings:
    """The settings and their revision; an incidence of None is the model's own."""

    incidence: float | None
    operating_points: tuple[dict[str, object], ...]
    revision: int


_GET = select(organisations.c.incidence, organisations.c.operating_points, organisations.c.settings_revision).where(
    organisations.c.id == bindparam("organisation_id")
)

_OWNER = select(data_sets.c.organisation_id).where(data_sets.c.id == bindparam("data_set_id"))


def get(conn: Connection, organisation_id: bytes) -> OrganisationSettings:
    """The settings of an organisation."""
    row = conn.execute(_GET, {"organisation_id": organisation_id}).first()
    if row is None:
        raise not_found("organisation")
    return OrganisationSettings(row.incidence, tuple(row.operating_points), row.settings_revision)


def of_data_set(conn: Connection, data_set_id: bytes) -> OrganisationSettings:
    """The settings of the organisation whose data set it is."""
    organisation = conn.execute(_OWNER, {"data_set_id": data_set_id}).scalar_one()
    return get(conn, organisation)


def put(
    conn: Connection,
    organisation_id: bytes,
    *,
    incidence: float | None,
    operating_points: Sequence[Mapping[str, object]],
    if_match: int | None = None,
) -> OrganisationSettings:
    """Replace the settings; the revision grows only if they change."""
    present = get(conn, organisation_id)
    require_revision(present.revision, if_match)
    points = tuple(dict(point) for point in operating_points)
    if (incidence, points) == (present.incidence, present.operating_points):
        return present
    changed = OrganisationSettings(incidence, points, present.revision + 1)
    conn.execute(
        update(organisations).where(organisations.c.id == organisation_id),
        {"incidence": incidence, "operating_points": list(points), "settings_revision": changed.revision},
    )
    return changed
