"""A table and a mapping into impacts."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from headimpact.quality import words
from headimpact.recording import SIGNALS, SignalName
from headimpact_service.errors import Problem
from headimpact_service.ingest.beside import (
    with_axis_peaks,
    with_conventions,
    with_events,
    with_other_times,
    with_supplied,
    with_unread,
)
from headimpact_service.ingest.conventions import unclear_axes
from headimpact_service.ingest.facts_beside import facts_above
from headimpact_service.ingest.file_faults import file_fault
from headimpact_service.ingest.file_names import named_facts
from headimpact_service.ingest.headings import Headings, layout_problem
from headimpact_service.ingest.impact_json import MAX_SAMPLES
from headimpact_service.ingest.laying_out import lay_out
from headimpact_service.ingest.layout import Layout
from headimpact_service.ingest.lines_above import axes_stated
from headimpact_service.ingest.mapping import Mapping, merge
from headimpact_service.ingest.no_signal import is_no_signal, with_remedies
from headimpact_service.ingest.options import ImportOptions
from headimpact_service.ingest.plan import Plan
from headimpact_service.ingest.presets import (
    Preset,
    beside_signals,
    fitting,
    generic,
    names_plane,
    preset_named,
    recognise,
    signals_of_presets,
    single_axes,
)
from headimpact_service.ingest.record import ImpactRecord, RefusedImpact
from headimpact_service.ingest.samples import Samples
from headimpact_service.ingest.seeming import given_twice, left_signals, not_named, not_read, unnamed
from headimpact_service.ingest.table import Table
from headimpact_service.ingest.table_impact import TableImpact
from headimpact_service.ingest.time_headings import speaks_of_times
from headimpact_service.ingest.windows import Window, windows


def read_table(table: Table, options: ImportOptions, *, format_name: str) -> Iterator[ImpactRecord | Problem]:
    """The impacts of a table in the order in which they begin.

    Raises
    ------
    Problem
        The table as a whole cannot be read. A fault of one impact is yielded in its place instead.
    """
    lone = {place for place in range(len(table.headings)) if not table.has_samples(place)}
    headings = Headings(table.headings, table.units, table.dated, lone)
    plan = _plan(headings, options, format_name)
    plan = replace(plan, above=facts_above(table.above, options.time_zone))
    _require_sensor(plan.mapping)
    layout = _laid_out(plan, headings)
    layout = _require_read(layout, headings, options, table)
    _require_no_other_device(layout, plan, headings)
    _require_rate(layout, plan)
    _require_no_other_rate(layout, plan, headings)
    _require_no_other_axes(layout, plan, table)
    if options.mapping is None or "time" not in options.mapping.model_fields_set:
        layout = with_other_times(layout, headings, table, rates=_reads_rates(options))
    if plan.preset is not None:
        layout = with_supplied(layout, headings, table)
        if options.mapping is None or not _names_signals(options.mapping):
            layout = with_axis_peaks(layout, preset_named(plan.preset).axis_peaks(headings), table)
    if not table.parted:
        layout = with_unread(layout, headings, table, None if options.mapping is None else options.mapping.group_by)
    says_units = options.mapping is not None and _names_signals(options.mapping)
    layout = with_conventions(layout, headings, table, axes=not _says_axes(layout, plan), units=not says_units)
    if options.occurred_at is None:
        layout = with_events(layout, headings, table)
    blocks = table.blocks(layout.numbers, layout.texts)
    max_single = MAX_SAMPLES + (plan.mapping.drop_rows or 0)
    count = 0
    may_space = layout.has_order or _names_one_impact(options)
    may_part = layout.has_order or layout.time_base is not None
    for window in windows(
        blocks, layout.keys, parted=table.parted, max_single=max_single, may_space=may_space, may_part=may_part
    ):
        count += len(window.impacts)
        if count > options.max_impacts:
            raise Problem("import-too-large", f"An import may hold at most {options.max_impacts} impacts.")
        yield from _read_window(plan, layout, window)
        del window  # before the next is put together beside it
    if count == 0:
        raise Problem("unreadable-file", "The file has headings but no samples.")


def _reads_rates(options: ImportOptions) -> bool:
    """Whether columns of a rate count: the sender may say that none does."""
    reading = {} if options.mapping is None else options.mapping.reading or {}
    return reading.get("sample_rate_hz", ()) is not None


def _names_one_impact(options: ImportOptions) -> bool:
    """Whether the sender says that nothing parts the rows: they are one impact."""
    return options.mapping is not None and options.mapping.group_by == []


def _read_window(plan: Plan, layout: Layout, window: Window) -> Iterator[ImpactRecord | Problem]:
    samples = Samples(layout, window)
    for number in range(len(window.impacts)):
        impact = TableImpact(plan, samples, number)
        try:
            yield impact.record()
        except Problem as problem:
            yield RefusedImpact(problem, impact.facts.sent_name())


def _plan(headings: Headings, options: ImportOptions, format_name: str) -> Plan:
    preset = _preset(headings, options)
    asked = options.mapping
    required = frozenset() if asked is None else frozenset(_names_columns(asked))
    if preset is None:
        mapping = _without_overridden(merge(beside_signals(headings), asked), options)
        return Plan(mapping, None, required, options, format_name)
    named = named_facts(options.filename, preset.file_name, options.time_zone)
    mapping = _without_overridden(merge(preset.mapping_for(headings, _named_signals(asked)), asked), options)
    return Plan(mapping, preset.name, required, options, format_name, named)


def _without_overridden(mapping: Mapping, options: ImportOptions) -> Mapping:
    """The mapping without columns in whose place the sender's fields count, whatever they say."""
    given = {"axes": options.axes, "filter": options.low_pass, "fill_gaps": options.fill_gaps or None}
    reading = {field: spelled for field, spelled in (mapping.reading or {}).items() if given.get(field) is None}
    return mapping.model_copy(update={"reading": reading})


def _preset(headings: Headings, options: ImportOptions) -> Preset | None:
    """The preset that is named, or else recognised; a mapping that names the columns of a signal stands alone."""
    if options.preset is not None:
        preset = preset_named(options.preset)
        if preset.format != "table":
            raise Problem("unreadable-file", f"The preset {preset.name} reads another kind of file than this table.")
        return preset
    if options.mapping is not None and _names_signals(options.mapping):
        return None
    found = recognise(headings)
    is_planar = names_plane(headings) or (options.mapping is not None and options.mapping.constrained_plane is not None)
    return generic() if found is None and is_planar else found  # of which no signal needs to be whole


def _names_signals(mapping: Mapping) -> bool:
    signals = (mapping.linear_acceleration, mapping.angular_velocity, mapping.angular_acceleration)
    return any(s is not None and (s.x or s.y or s.z) for s in signals)


def _named_signals(mapping: Mapping | None) -> frozenset[SignalName]:
    """The signals of which a mapping says every axis and the unit, or that they are none: no heading need tell them."""
    if mapping is None:
        return frozenset()
    sent = {name: mapping.columns_of(name) for name in SIGNALS if name in mapping.model_fields_set}
    return frozenset(name for name, s in sent.items() if s is None or (s.unit and s.x and s.y and s.z))


def _laid_out(plan: Plan, headings: Headings) -> Layout:
    """The layout, or why there is none, with the preset whose columns these are unless one was named."""
    try:
        return lay_out(plan.mapping, headings, plan.required)
    except Problem as found:
        problem = found
        if is_no_signal(found):
            problem = with_remedies(headings.written, plan.options, plan.format, single_axes(headings))
        names = [] if plan.options.preset is not None else fitting(headings, but=plan.preset)
        if not names:
            raise problem from None
        detail = f"{problem.detail} The headings are those of the preset {' or '.join(names)}: name it beside the file."
        [fault, *_] = problem.errors
        raise layout_problem(detail, code=fault.code, pointer=fault.pointer) from None


def _require_sensor(mapping: Mapping) -> None:
    """Refuse a mounting of signals that are said to be the head's: it would change nothing."""
    if mapping.mounting is not None and mapping.location != "sensor":
        raise layout_problem(
            "A mounting is for signals of the sensor: give location sensor with it.",
            code="mounting-not-needed",
            pointer="/mounting",
        )


def _require_read(layout: Layout, headings: Headings, options: ImportOptions, table: Table) -> Layout:
    """Refuse columns that seem to be a signal and would not be read; where a mapping says which are, note them."""
    left = left_signals(layout, headings, table)
    if options.mapping is None or not _names_signals(options.mapping):
        for signal, columns in left.items():
            raise not_read(signal, columns)
        beside = (*unnamed(layout, headings, table), *given_twice(layout, headings, table))
        return replace(layout, notes=beside)
    # an angular acceleration beside a velocity that is read would only be its derivative
    derived = {"angular_acceleration"} if "angular_velocity" in layout.signals else set[str]()
    said = {*derived, *(name for name in SIGNALS if _is_null(options.mapping, name))}
    notes = [not_named(signal, columns) for signal, columns in left.items() if signal not in said]
    return replace(layout, notes=tuple(notes))


def _is_null(mapping: Mapping, name: SignalName) -> bool:
    return name in mapping.model_fields_set and getattr(mapping, name) is None


def _require_no_other_device(layout: Layout, plan: Plan, headings: Headings) -> None:
    """Refuse a signal that only another preset would read, unless a mapping says which columns are signals."""
    if plan.options.mapping is not None and _names_signals(plan.options.mapping):
        return
    read = set(layout.numbers)
    for preset, signal, columns in signals_of_presets(headings):
        if signal not in layout.signals and read.isdisjoint(columns):
            written = ", ".join(headings.written[column] for column in columns)
            raise layout_problem(
                f"The columns {written} are the {words(signal)} of the preset {preset} and would not be read: name it, "
                "or the columns of every signal in a mapping.",
                code="columns-not-read",
                pointer=f"/{signal}",
            )


def _names_columns(mapping: Mapping) -> Iterator[str]:
    """The fields of a sent mapping whose columns must be there: a signal of which only the unit is given need not."""
    for name in mapping.model_fields_set:
        value = getattr(mapping, name)
        if value is None or (hasattr(value, "unit") and not (value.x or value.y or value.z)):
            continue
        yield name
        yield from (f"{name}.{kind}" for kind in ("resultant", "peak") if getattr(value, kind, None) is not None)
        if name in {"context", "reading"}:
            yield from (f"{name}.{field}" for field, spellings in value.items() if spellings is not None)


def _says_axes(layout: Layout, plan: Plan) -> bool:
    """Whether the sender, a column that is read or the device's layout says the direction of the axes."""
    sent = plan.options.mapping
    if plan.options.axes is not None or "axes" in layout.reading or plan.mapping.axes == "sae_j211":
        return True
    return sent is not None and (sent.axes is not None or (sent.reading or {}).get("axes", ()) is None)


def _require_no_other_axes(layout: Layout, plan: Plan, table: Table) -> None:
    """Refuse to take the axes for anatomical where a row above the headings says that they are SAE's."""
    if _says_axes(layout, plan) or (stated := axes_stated([*table.above, *table.beside])) is None:
        return
    raise unclear_axes("A row above the headings", stated)


def _require_rate(layout: Layout, plan: Plan) -> None:
    stated = plan.options.sample_rate_hz is not None or plan.mapping.sample_rate_hz is not None
    if stated or layout.clock is not None or "sample_rate_hz" in layout.reading:
        return
    without = [words(name) for name, signal in layout.signals.items() if not signal.is_apart]
    if without:
        whose = "The file has" if len(without) == len(layout.signals) else f"The {' and the '.join(without)} has"
        raise file_fault(
            f"{whose} no column of times that is known: give the sample rate, or name the times in a mapping, for all "
            'signals ({"time": {"column": "t", "unit": "ms"}}) or within a signal for that one.',
            "rate-missing",
            parameter="sample_rate_hz",
        )


def _require_no_other_rate(layout: Layout, plan: Plan, headings: Headings) -> None:
    """Refuse to take a device's usual rate where the file seems to say its own, in a way that is not read."""
    usual = plan.mapping.sample_rate_hz is not None and "sample_rate_hz" not in plan.required
    if not usual or plan.options.sample_rate_hz is not None or layout.is_timed or "sample_rate_hz" in layout.reading:
        return
    unread = set(range(len(headings.written))) - {*layout.numbers, *layout.texts}
    for column in sorted(unread):
        if speaks_of_times(headings.written[column]):
            by_name = "" if column in headings.lone else "name it in a mapping's time, with its unit, or "
            raise file_fault(
                f"The column {headings.written[column]} seems to say times or a rate and is not read: {by_name}give "
                f"sample_rate_hz beside the file ({plan.preset} would take {plan.mapping.sample_rate_hz:g} Hz).",
                "rate-unclear",
                parameter="sample_rate_hz",
            )
