"""What a table says of one impact beside its samples: names, when it was, its context, where it came from."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime
from typing import Any, Literal

from headimpact_service.errors import Problem
from headimpact_service.ingest.conventions import require_axes, require_units
from headimpact_service.ingest.facts_beside import moment_said
from headimpact_service.ingest.formula_cells import name_in, unguarded, unguarded_name
from headimpact_service.ingest.impact_json import MAX_NAME
from headimpact_service.ingest.labels import checked_name, context_of, moment
from headimpact_service.ingest.layout import Layout
from headimpact_service.ingest.plan import Plan
from headimpact_service.ingest.row_labels import RowLabels
from headimpact_service.ingest.spelling import compact
from headimpact_service.store import ids


class ImpactFacts:
    """The facts of one impact: beside the file, in its columns, in rows above the headings, in the file's name."""

    def __init__(self, plan: Plan, layout: Layout, labels: RowLabels, *, parted: bool) -> None:
        """`parted`: the format itself parts impacts, so that a time above the headings is of no single one."""
        self._plan, self._options, self._layout, self._labels = plan, plan.options, layout, labels
        self._is_one = not (parted or layout.keys)

    def require_conventions(self) -> None:
        """Refuse columns that say other axes or units than those that are read."""
        layout = self._layout
        for column in layout.conventions.axes:
            require_axes(layout.named(column), self._labels.said(column))
        units = {name: signal.unit for name, signal in layout.signals.items()}
        for column in layout.conventions.units:
            for text in self._labels.all_said(column):
                require_units(layout.named(column), text, units)

    def external_id(self) -> str | None:
        """What the file calls the impact."""
        return self._name("external_id", self._layout.external_id) or self._plan.named.external_id

    def sent_name(self) -> str | None:
        """The same of an impact that is refused; None if the name is the fault."""
        try:
            return self.external_id()
        except Problem:
            return None

    def athlete(self) -> tuple[str | None, str | None]:
        """Our id of the athlete, or else the sender's name."""
        column = self._layout.athlete
        if self._options.athlete is not None:
            return None, self._options.athlete
        if column is None:
            return None, self._above("athlete", self._plan.above.athlete)
        name = self._name("athlete", column)
        return (name, None) if self._is_our_id(name, column) else (None, name)

    def device(self) -> str | None:
        """The serial number of the device."""
        if self._options.device is not None:
            return self._options.device
        column = self._layout.device
        above = self._above("device", self._plan.above.device)
        return (above if column is None else self._name("device", column)) or self._plan.named.device

    def occurred_at(self) -> datetime | None:
        """When it was."""
        if self._options.occurred_at is not None:
            return self._options.occurred_at
        return self._in_columns() or self._plan.named.occurred_at

    @property
    def unscorable(self) -> str | None:
        """Why it must not be scored."""
        return self._text(self._layout.unscorable)

    def context(self) -> dict[str, Any]:
        """Its context."""
        read = {"session_id": self._named}
        cells = ((field, read.get(field, self._text)(column)) for field, column in self._layout.context.items())
        texts = tuple((field, text) for field, text in cells if text is not None)
        return dict(context_of(texts)) if texts else {}

    def metadata(self) -> dict[str, Any]:
        """Where it came from, and what the file itself calls it where that is no name outside it."""
        told = {"format": self._plan.format, "preset": self._plan.preset, "file": self._options.filename}
        keys = [self._named(column) for column in self._layout.keys if column != self._layout.external_id]
        known = [key for key in keys if key is not None]
        told_apart = {"impact": " ".join(known)[:MAX_NAME]} if known else {}
        return {name: value for name, value in told.items() if value is not None} | told_apart

    def _in_columns(self) -> datetime | None:
        """When it was, in the columns that are for it or, where there are none, in others or above the headings."""
        columns = self._layout.occurred_at
        if columns:
            parts = {self._layout.headings[column]: self._text(column) for column in columns}
            return moment(parts, self._options.time_zone, self._layout.date_order)
        found = next(filter(None, map(self._moment_in, self._layout.events)), None)
        return found or (self._plan.above.occurred_at if self._is_one else None)

    def _moment_in(self, columns: Sequence[int]) -> datetime | None:
        """The time that all rows of an impact say in columns, if they say one."""
        told = [self._labels.all_said(column) for column in columns]
        if any(len(texts) != 1 for texts in told):
            return None
        return moment_said([text for (text,) in told], self._options.time_zone)

    def _above(self, field: Literal["athlete", "device"], text: str | None) -> str | None:
        """A name in a row above the headings, unless the sender's mapping reads none."""
        sent = self._options.mapping
        unread = sent is not None and field in sent.model_fields_set
        if text is None or unread:
            return None
        return checked_name(name_in(text, typed=self._plan.format != "csv") or None, field)

    def _is_our_id(self, athlete: str | None, column: int) -> bool:
        """Whether an athlete is given by our id, as this service's own lists have it: in a column athlete_id."""
        if athlete is None or compact(self._layout.headings[column]) != "athleteid":
            return False
        return ids.decode("ath", athlete) is not None

    def _text(self, column: int | None) -> str | None:
        if column is None:
            return None
        text = self._labels.said(column)
        return (unguarded(text) if self._plan.format == "csv" else unguarded_name(text)) or None

    def _named(self, column: int | None) -> str | None:
        if column is None:
            return None
        return name_in(self._labels.said(column), typed=self._plan.format != "csv") or None

    def _name(self, field: str, column: int | None) -> str | None:
        return checked_name(self._named(column), field)
