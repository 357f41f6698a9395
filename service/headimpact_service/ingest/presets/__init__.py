"""The layouts of known devices, one file each: adding a device needs no code."""

from __future__ import annotations

import tomllib
from collections.abc import Collection, Iterator, Sequence
from functools import cache
from importlib.resources import files
from typing import Annotated, Any, Literal

from pydantic import Field

from headimpact.recording import AXES, SIGNALS, SignalName
from headimpact_service.errors import invalid_parameter
from headimpact_service.ingest.axis_peaks import axis_peaks, without
from headimpact_service.ingest.headings import Headings, Vocabulary
from headimpact_service.ingest.impact_json import FilterBody, Strict
from headimpact_service.ingest.mapping import DateAndTime, Mapping, SignalColumns

Requirement = Literal["sample_rate_hz", "units", "occurred_at"]


class Preset(Strict):
    """One device's layout, as its file has it.

    `recognised` says that a table with these headings is this device's without anyone naming the preset; that needs
    headings which name their units or are the device's alone. `requires` is what the layout cannot say and the sender
    must; `usual_rate_hz` is what the device samples at, to be known and not to be assumed.
    """

    name: Annotated[str, Field(pattern=r"^[a-z0-9_]+$")]
    title: str
    source: str
    format: Literal["table", "nhtsa", "iso_mme", "dts"] = "table"
    recognised: bool = False
    requires: list[Requirement] = Field(default_factory=list)
    usual_rate_hz: dict[SignalName, float] = Field(default_factory=dict)
    notes: list[str] = Field(default_factory=list)
    file_name: str | None = Field(None, description="A pattern of names without their ending, with what they tell.")
    mapping: Mapping
    vocabulary: dict[str, Any] | None = None

    def mapping_for(self, headings: Headings, but: Collection[SignalName] = ()) -> Mapping:
        """The preset's mapping, completed by what the headings say: all that its vocabulary reads, or units only.

        Signals that are named elsewhere are of no account in headings (`but`).
        """
        if self.vocabulary is None:
            own = _with_units(self.mapping, headings) if "units" in self.requires else self.mapping
            return _with_names(own, headings)
        spoken = _vocabulary(self.name).mapping(without(headings, self.axis_peaks(headings)), but)
        return spoken.model_copy(update={name: getattr(self.mapping, name) for name in self.mapping.model_fields_set})

    def axis_peaks(self, headings: Headings) -> dict[int, SignalName]:
        """The columns of each axis' peak that its vocabulary would take for a signal's, each with the signal."""
        return {} if self.vocabulary is None else axis_peaks(_vocabulary(self.name), headings)

    def fits(self, headings: Headings) -> bool:
        """Whether a table with these headings is of this layout: every signal's columns are there.

        Those of one signal are enough beside other columns of this device: those that tell its impacts apart, or the
        resultants that it writes itself.
        """
        mapping = self.mapping_for(headings)
        signals = [columns for name in SIGNALS if (columns := mapping.columns_of(name)) is not None]
        there = [columns for columns in signals if _is_there(columns, headings)]
        return bool(there) and (len(there) == len(signals) or self._is_marked(headings, there))

    def _is_marked(self, headings: Headings, there: Sequence[SignalColumns]) -> bool:
        if self.vocabulary is not None:
            return False
        keys, resultants = self.mapping.group_by or [], [columns.resultant for columns in there]
        apart = len(keys) > 1 and all(headings.find(key) is not None for key in keys)
        return apart or all(names and set(names) & set(headings.written) for names in resultants)


def _with_names(mapping: Mapping, headings: Headings) -> Mapping:
    """The mapping with the generic columns of names, times and reading, where a table has them beside a device's own.

    Whoever joins a device's files into one table adds them.
    """
    of_any = generic().mapping
    fields = ("external_id", "athlete", "device", "session_id", "occurred_at")
    added: dict[str, Any] = {name: getattr(of_any, name) for name in fields if getattr(mapping, name) is None}
    if not mapping.group_by:
        added["group_by"] = of_any.group_by
    if not _has_times(mapping, headings) and (times := _vocabulary(generic().name).time(headings)):
        added["time"] = times
    spellings = (of_any.reading or {}).items()
    reading = {name: spelled for name, spelled in spellings if spelled and headings.find(spelled) is not None}
    if reading:
        added["reading"] = reading | (mapping.reading or {})
    return mapping.model_copy(update=added)


def _has_times(mapping: Mapping, headings: Headings) -> bool:
    """Whether one of the layout's own columns of times is there."""
    own = [columns.time or () for name in SIGNALS if (columns := mapping.columns_of(name)) is not None]
    return any(headings.nearest(time.column, 0) is not None for times in (mapping.time or (), *own) for time in times)


def _with_units(mapping: Mapping, headings: Headings) -> Mapping:
    """The mapping with the units that headings name behind what the layout calls its columns."""
    without = {name: found for name in SIGNALS if (found := mapping.columns_of(name)) and found.unit is None}
    return mapping.model_copy(update={name: _in_unit(name, columns, headings) for name, columns in without.items()})


def _in_unit(name: SignalName, columns: SignalColumns, headings: Headings) -> SignalColumns:
    for unit, spellings in _spoken_units()[name].items():
        for spelling in spellings:
            named = {axis: [f"{column} {spelling}" for column in getattr(columns, axis) or ()] for axis in AXES}
            if all(headings.find(candidates) is not None for candidates in named.values()):
                return columns.model_copy(update={**named, "unit": unit})
    return columns


@cache
def _spoken_units() -> dict[SignalName, dict[str, list[str]]]:
    """How headings spell each signal's units."""
    words = generic().vocabulary or {}
    return {name: words[name]["units"] for name in SIGNALS}


def beside_signals(headings: Headings) -> Mapping:
    """The generic columns of names, times and reading of a table whose signals a mapping names."""
    return _with_names(Mapping.model_construct(), headings)


def spoken_of(headings: Headings) -> dict[SignalName, list[str]]:
    """The columns that seem to be those of a signal, whatever layout they are read by."""
    return _vocabulary(generic().name).components(headings)


def keys_of(headings: Headings) -> list[int]:
    """The columns that tell impacts apart wherever no layout says which do."""
    return [column for spelled in generic().mapping.group_by or () if (column := headings.find(spelled)) is not None]


def times_of(headings: Headings) -> set[int]:
    """The columns whose headings are words for the samples' times, whatever layout they are read by."""
    vocabulary = _vocabulary(generic().name)
    return {column for column, said in enumerate(headings.spoken) if vocabulary.says_time(said)}


@cache
def _vocabulary(name: str) -> Vocabulary:
    return Vocabulary(presets()[name].vocabulary or {})


def _is_there(columns: SignalColumns, headings: Headings) -> bool:
    """Whether a signal's three columns are there, and its times where it has its own."""
    if columns.time and all(headings.nearest(time.column, 0) is None for time in columns.time):
        return False
    spellings = [getattr(columns, axis) for axis in AXES]
    return all(names is not None and headings.find(names) is not None for names in spellings)


@cache
def presets() -> dict[str, Preset]:
    """Every preset by its name; those of one device before the generic ones, which fit more."""
    folder = files(__name__)
    texts = (entry.read_text("utf-8") for entry in folder.iterdir() if entry.name.endswith(".toml"))
    read = [Preset.model_validate(tomllib.loads(text)) for text in texts]
    return {preset.name: preset for preset in sorted(read, key=lambda p: (p.vocabulary is not None, p.name))}


def preset_named(name: str) -> Preset:
    """The preset of that name; 422 if there is none."""
    preset = presets().get(name)
    if preset is None:
        known = ", ".join(presets())
        raise invalid_parameter("preset", f"There is no such preset; the presets are {known}.", "not-allowed")
    return preset


def recognise(headings: Headings) -> Preset | None:
    """The preset that a table's headings are of."""
    candidates = (preset for preset in presets().values() if preset.recognised and preset.format == "table")
    return next((preset for preset in candidates if preset.fits(headings)), None)


def generic() -> Preset:
    """The preset that reads headings by their words, whatever device they are of."""
    return next(preset for preset in presets().values() if preset.vocabulary is not None)


def names_plane(headings: Headings) -> bool:
    """Whether a column says the plane of each impact's motion."""
    spelled = (generic().mapping.reading or {}).get("constrained_plane")
    return spelled is not None and headings.find(spelled) is not None


def single_axes(headings: Headings) -> list[str]:
    """The columns that are said to be a component of a signal, whether or not its others are there."""
    told = zip(headings.written, _vocabulary(generic().name).meanings(headings), strict=True)
    return [heading for heading, meaning in told if meaning is not None and meaning.signal is not None]


def unit_of(heading: str) -> str | None:
    """The unit of a signal that a heading names, if it is made of known words."""
    meaning = _vocabulary(generic().name).understand(heading)
    return None if meaning is None or meaning.signal is None else meaning.unit


def fitting(headings: Headings, *, but: str | None) -> list[str]:
    """The presets whose columns a table has all, `but` the one that it is read by and the generic ones."""
    tables = (preset for preset in presets().values() if preset.format == "table" and preset.vocabulary is None)
    return [preset.name for preset in tables if preset.name != but and preset.fits(headings)]


def signals_of_presets(headings: Headings) -> Iterator[tuple[str, SignalName, list[int]]]:
    """Where a table has the three columns of a signal of a preset: the preset's name, the signal, and the columns."""
    for preset in presets().values():
        for name in SIGNALS if preset.format == "table" and preset.vocabulary is None else ():
            columns = preset.mapping.columns_of(name)
            if columns is not None and _is_there(columns, headings):
                places = (headings.find(getattr(columns, axis)) for axis in AXES)
                yield preset.name, name, [place for place in places if place is not None]


def list_presets() -> list[dict[str, Any]]:
    """The presets as ``GET /v1/presets`` shows them: columns, units, axes, and what the sender must add."""
    return [_shown(preset) for preset in presets().values()]


def _shown(preset: Preset) -> dict[str, Any]:
    mapping = preset.mapping
    return {
        "name": preset.name,
        "title": preset.title,
        "source": preset.source,
        "format": preset.format,
        "recognised": preset.recognised,
        "requires": list(preset.requires),
        "axes": mapping.axes or "anatomical",
        "location": mapping.location or "head_cg",
        "filter": _filter_shown(mapping),
        "sample_rate_hz": mapping.sample_rate_hz,
        "usual_rate_hz": dict(preset.usual_rate_hz),
        "ranges": _ranges_shown(mapping),
        "pre_trigger_ms": mapping.pre_trigger_ms,
        "time": _times_shown(mapping),
        "drop_rows": mapping.drop_rows or 0,
        "file_name": preset.file_name,
        "group_by": list(mapping.group_by or ()),
        "columns": _columns_shown(preset),
        "notes": list(preset.notes),
    }


def _ranges_shown(mapping: Mapping) -> dict[str, Any]:
    """The sensors' full scales, where the layout's signals are those of the sensors."""
    found = {signal: columns for signal in SIGNALS if (columns := mapping.columns_of(signal)) is not None}
    return {
        signal: {"range": columns.range, "unit": columns.unit} for signal, columns in found.items() if columns.range
    }


def _times_shown(mapping: Mapping) -> list[dict[str, Any]]:
    """The columns of times: those that all signals share, and those of one signal."""
    shared: list[dict[str, Any]] = [{"signal": None, **time.model_dump()} for time in mapping.time or ()]
    own = ((signal, mapping.columns_of(signal)) for signal in SIGNALS)
    return shared + [
        {"signal": signal, **time.model_dump()}
        for signal, columns in own
        if columns is not None
        for time in columns.time or ()
    ]


def _filter_shown(mapping: Mapping) -> Any:  # noqa: ANN401 - as in an impact: a name or an object
    choice = mapping.filter or "paper"
    return choice.model_dump() if isinstance(choice, FilterBody) else choice


def _columns_shown(preset: Preset) -> list[dict[str, Any]]:
    columns = [
        {"signal": signal, "axis": axis, "unit": signal_columns.unit, "headings": getattr(signal_columns, axis)}
        for signal in SIGNALS
        if (signal_columns := preset.mapping.columns_of(signal)) is not None
        for axis in AXES
    ]
    columns += [
        {"signal": signal, "axis": kind, "unit": signal_columns.unit, "headings": named}
        for signal in SIGNALS
        if (signal_columns := preset.mapping.columns_of(signal)) is not None
        for kind, named in (("resultant", signal_columns.resultant), ("peak", signal_columns.peak))
        if named
    ]
    if preset.vocabulary is not None:
        columns += [_vocabulary_shown(signal, preset.vocabulary[signal]) for signal in SIGNALS]
    return columns + _labels_shown(preset.mapping)


def _vocabulary_shown(signal: str, words: dict[str, Any]) -> dict[str, Any]:
    """What a generic preset takes: any of the words with an axis and one of the unit's spellings."""
    return {"signal": signal, "axis": None, "unit": None, "words": words["words"], "units": words["units"]}


_LABELS = (
    "external_id",
    "athlete",
    "device",
    "session_id",
    "occurred_at",
    "unscorable",
    "time_base",
    "sample_number",
)


def _labels_shown(mapping: Mapping) -> list[dict[str, Any]]:
    labels: list[dict[str, Any]] = []
    for name in _LABELS:
        spellings = getattr(mapping, name)
        parts = [spellings.date, spellings.time] if isinstance(spellings, DateAndTime) else [spellings]
        labels += [{"field": name, "headings": part} for part in parts if part is not None]
    for table in (mapping.context, mapping.reading):
        labels += [{"field": field, "headings": spellings} for field, spellings in (table or {}).items()]
    return labels
