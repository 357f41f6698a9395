"""Columns beside those that a layout reads, which may gainsay what it reads or tell its rows apart."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from headimpact.recording import SignalName
from headimpact_service.ingest.axis_peaks import unclear_axis
from headimpact_service.ingest.conventions import conventions
from headimpact_service.ingest.facts_beside import event_columns
from headimpact_service.ingest.headings import Headings
from headimpact_service.ingest.layout import Layout
from headimpact_service.ingest.lines_above import rates_stated
from headimpact_service.ingest.other_times import other_times
from headimpact_service.ingest.presets import keys_of, times_of
from headimpact_service.ingest.supplied import spoken_in
from headimpact_service.ingest.table import Table
from headimpact_service.ingest.unread import Unread, unread_columns


def with_other_times(layout: Layout, headings: Headings, table: Table, *, rates: bool) -> Layout:
    """The layout, with the columns beside it that may say other times or, where they count, other rates."""
    read = {*layout.numbers, *layout.texts}
    others = other_times(headings, read, table, times_of(headings))
    if not rates:
        return replace(layout, others=replace(others, rates=()))
    stated = (*rates_stated(table.above, sentences=True), *rates_stated(table.beside, sentences=False))
    return replace(layout, others=replace(others, stated=stated))


def with_supplied(layout: Layout, headings: Headings, table: Table) -> Layout:
    """The layout, with the resultants and peaks beside it; where the format parts impacts, peaks are no samples."""
    passed = {*layout.numbers, *layout.texts}
    unnamed = [name for name, signal in layout.signals.items() if not headings.name_units(name, signal.columns)]
    signals = dict(layout.signals)
    units = {name: signal.unit for name, signal in signals.items()}
    for name, kind, found in spoken_in(headings, units, unnamed):
        signal = signals[name]
        if found.column in passed:
            continue
        if kind == "resultant" and (found.column in table.wordless or not table.parted):
            signals[name] = replace(signal, resultants=(*signal.resultants, found))
        elif kind == "peak" and found.column not in table.wordless:
            signals[name] = replace(signal, peaks=(*signal.peaks, found))
    return replace(layout, signals=signals)


def with_axis_peaks(layout: Layout, found: Mapping[int, SignalName], table: Table) -> Layout:
    """The layout, with columns beside it that are each axis' peak, unless they hold a value a sample."""
    passed = {*layout.numbers, *layout.texts}
    beside = {column: signal for column, signal in found.items() if column not in passed}
    for column, signal in beside.items():
        if column in table.wordless:
            raise unclear_axis(layout.named(column), signal)
    return replace(layout, axis_peaks=beside)


def with_conventions(layout: Layout, headings: Headings, table: Table, *, axes: bool, units: bool) -> Layout:
    """The layout, with the columns beside it that may say other units or axes, where these are open."""
    passed = _read_or_wordless(layout, table)
    return replace(layout, conventions=conventions(headings, passed, axes=axes, units=units))


def with_events(layout: Layout, headings: Headings, table: Table) -> Layout:
    """The layout, with the columns beside it that may say when an impact was, if none that is read does."""
    if layout.occurred_at:
        return layout
    return replace(layout, events=event_columns(headings, _read_or_wordless(layout, table)))


def _read_or_wordless(layout: Layout, table: Table) -> set[int]:
    """The columns that are read, but for those that are only held against each other, and those without text."""
    held = {*layout.unread.columns, *(other.column for other in layout.others.clocks)}
    return ({*layout.numbers, *layout.texts} - held) | {*table.wordless}


def with_unread(layout: Layout, headings: Headings, table: Table, group_by: Sequence[object] | None) -> Layout:
    """The layout, with the columns beside it that may tell several impacts from one.

    What the sender names in `group_by` tells them apart; if that is empty the rows are one impact, unless the column
    that is for it says that they are not.
    """
    if group_by == []:
        named = tuple(column for column in keys_of(headings) if column not in {*layout.numbers, *layout.texts})
        return replace(layout, unread=Unread(names=named, said_one=True))
    if layout.sample_number is not None:
        return layout
    passed = _read_or_wordless(layout, table)
    timed = layout.is_timed
    unread = unread_columns(layout.headings, passed, timed=timed, keyed=bool(layout.keys), named=bool(group_by))
    return replace(layout, unread=unread if timed else replace(unread, peaks=(*layout.peaks, *layout.axis_peaks)))
