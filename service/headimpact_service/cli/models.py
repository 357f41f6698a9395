"""Models by the command line: register what `headimpact refit` wrote, list, promote."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Literal, cast

from headimpact.model_document import model_from_text, model_to_document
from headimpact.risk import PUBLISHED_MODELS
from headimpact_service.cli.database import migrated
from headimpact_service.intake import registry
from headimpact_service.store import aliases, models, organisation_settings, organisations
from headimpact_service.store.database import Database
from headimpact_service.store.models import NewModel


def add(files: list[Path], *, organisation: str, mode: str, database_url: str | None) -> None:
    """Register every file, or none: a version that is taken by another document refuses all."""
    found = [model_from_text(file.read_bytes()) for file in files]
    for model in found:
        registry.require_free(model.version)
    with migrated(database_url) as database:
        data_set = _data_set(database, organisation, mode)

        def register(conn: Any) -> list[bool]:  # noqa: ANN401 - a connection of the store
            documents = [NewModel(version=model.version, document=model_to_document(model)) for model in found]
            return [models.add(conn, data_set, new)[1] for new in documents]

        made = database.write(register)
    for model, new in zip(found, made, strict=True):
        print(f"{model.version}: {'registered' if new else 'was registered already'}")


def show(*, organisation: str, mode: str, database_url: str | None) -> None:
    """Print the versions of a data set, newest first, and what the aliases mean."""
    with migrated(database_url) as database:
        data_set = _data_set(database, organisation, mode)
        with database.read() as conn:
            own = models.list_all(conn, data_set)
            active = registry.active_model(conn, data_set).version
            candidate = aliases.get(conn, data_set, "candidate").version
    for version in [*(stored.version for stored in own), *PUBLISHED_MODELS]:
        meant = [name for name, of in (("active", active), ("candidate", candidate)) if of == version]
        print("  ".join([version, *meant]))


def promote(version: str, *, reason: str, organisation: str, mode: str, database_url: str | None) -> None:
    """Let a version score new impacts; a running service follows within five seconds."""
    with migrated(database_url) as database:
        data_set = _data_set(database, organisation, mode)

        def change(conn: Any) -> str | None:  # noqa: ANN401 - a connection of the store
            model = registry.model_of(conn, data_set, version)
            found = organisations.find(conn, organisation)
            if found is not None:
                settings = organisation_settings.get(conn, found.id)
                registry.require_promotable(model, settings.incidence, settings.operating_points)
            before = registry.active_model(conn, data_set).version
            aliases.put(conn, data_set, "active", version, reason)
            return before

        before = database.write(change)
    print(f"{version} is active; before it was {before}.")


def _data_set(database: Database, organisation: str, mode: str) -> bytes:
    def find(conn: Any) -> bytes:  # noqa: ANN401 - a connection of the store
        found = organisations.known(conn, organisation)
        return organisations.ensure_data_set(conn, found.id, cast("Literal['live', 'test']", mode))

    return database.write(find)
