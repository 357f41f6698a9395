"""Arrow columns of structs and of lists within lists, as the columns of numbers and of lists that they hold.

`acc` of structs with x, y and z is `acc_x`, `acc_y` and `acc_z`; so are lists of such structs, lists of triples, and
three lists in one. How long lists within lists are says the first row; another row must have as many. Lists that all
have three numbers, or six, are the vectors of samples and no impacts of so few.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal, NamedTuple

import pyarrow as pa
import pyarrow.compute as pc

from headimpact_service.ingest.guarded.array_table import AXES
from headimpact_service.ingest.guarded.arrow_types import is_list, is_list_of_numbers
from headimpact_service.ingest.guarded.contents import MAX_COLUMNS, unreadable

Batches = Callable[[list[int]], Iterator[pa.RecordBatch]]
"""Reads the columns of these places, in their order, batch by batch."""

MAX_DEPTH = 4
MAX_WIDTH = 16
"""Components of one sample: six axes, perhaps with their resultants."""
VECTORS = {3, 6}
FACTS = frozenset({"context", "meta", "metadata", "info", "reading"})
"""Structs of what is said of an impact: their fields are called by their own names, which no other column has."""
FIRST_ROWS = 8
"""Rows by which lists are told to be vectors: a table of fewer impacts may have lists of any length."""

Within = Literal["field", "field of each", "part", "part of each"]


class _Step(NamedTuple):
    """One level down: into a field of structs or a component of vectors, or of each that a list holds."""

    within: Within
    number: int
    width: int
    """How many of them there are."""


@dataclass(frozen=True, slots=True)
class _Leaf:
    """A column as it is laid out: which column of the file it is within, and where there."""

    field: pa.Field
    column: int
    steps: tuple[_Step, ...] = ()


def laid_out(schema: pa.Schema, batches: Batches) -> tuple[pa.Schema, Batches]:
    """A schema without structs and lists within lists, and its batches; what holds none of them stays as it is."""
    nested = [place for place, kind in enumerate(schema.types) if _is_nested(kind)]
    widths = _vectors(schema, batches)
    if not nested and not widths:
        return schema, batches
    first = _first_row(batches, nested)
    leaves: list[_Leaf] = []
    for place, field in enumerate(schema):
        whole = _Leaf(field, place)
        width = widths.get(place)
        parts = (
            _leaves(whole, first.get(place)) if width is None else _vector(whole, field.type.value_type, width, "part")
        )
        for leaf in _by_own_names(field.name, parts, schema.names):
            if len(leaves) > MAX_COLUMNS:  # refused with that bound by whoever takes the schema
                break
            leaves.append(leaf)

    def taken(places: list[int]) -> Iterator[pa.RecordBatch]:
        chosen = [leaves[place] for place in places]
        columns = sorted({leaf.column for leaf in chosen})
        for batch in batches(columns):
            arrays = [_within(batch.column(columns.index(leaf.column)), leaf) for leaf in chosen]
            yield pa.RecordBatch.from_arrays(arrays, schema=pa.schema([leaf.field for leaf in chosen]))

    return pa.schema([leaf.field for leaf in leaves]), taken


def _vectors(schema: pa.Schema, batches: Batches) -> dict[int, int]:
    """The widths of lists of numbers that hold a vector a row, by the first rows: if each has one, and some have three.

    Lists that hold nothing yet have none, and are no columns; those of words are none of the samples'.
    """
    places = [place for place, kind in enumerate(schema.types) if is_list_of_numbers(kind) and not _is_nested(kind)]
    if not places:
        return {}
    lengths: list[set[int]] = [set() for _ in places]
    rows = 0
    for batch in batches(places):
        rows += batch.num_rows
        for found, column in zip(lengths, batch.columns, strict=True):
            found |= set(pc.list_value_length(column).drop_null().to_pylist())
        if any(length > MAX_WIDTH for found in lengths for length in found):
            return {}
        if rows >= FIRST_ROWS:
            break
    told = {place: found for place, found in zip(places, lengths, strict=True) if found - {0}}
    widths = {place: min(found) for place, found in told.items() if len(found) == 1}
    if rows < FIRST_ROWS or len(widths) < len(told) or VECTORS.isdisjoint(widths.values()):
        return {}
    return dict.fromkeys(places, 0) | widths


def _is_nested(kind: pa.DataType) -> bool:
    """Whether a column of this type is laid out: a vector of one size is, a list of any length holds samples."""
    if pa.types.is_fixed_size_list(kind):
        return True
    return bool(pa.types.is_struct(kind)) or (is_list(kind) and _is_nested_within(kind.value_type))


def _is_nested_within(kind: pa.DataType) -> bool:
    return bool(pa.types.is_struct(kind)) or is_list(kind)


def _first_row(batches: Batches, places: list[int]) -> dict[int, Any]:
    """What the columns hold where each has something first, within the first batch."""
    batch = next((batch for batch in batches(places) if batch.num_rows), None) if places else None
    if batch is None:
        return {}
    told = {place: column.drop_null() for place, column in zip(places, batch.columns, strict=True)}
    return {place: column[0] for place, column in told.items() if len(column)}


def _leaves(leaf: _Leaf, first: pa.Scalar | None) -> Iterator[_Leaf]:
    """The columns that one comes to; one that nobody can lay out stays, and holds no numbers."""
    parts = list(_parts(leaf, first)) if len(leaf.steps) < MAX_DEPTH else []
    if not parts:
        yield leaf
    for part, sample in parts:
        yield from _leaves(part, sample)


def _parts(leaf: _Leaf, first: pa.Scalar | None) -> Iterator[tuple[_Leaf, pa.Scalar | None]]:
    """What a column holds one level below, each with what stands there first."""
    kind = leaf.field.type
    if pa.types.is_struct(kind):
        for number, field in enumerate(kind):
            yield _below(leaf, field.name, field, _Step("field", number, kind.num_fields)), _held(first, number)
    elif pa.types.is_fixed_size_list(kind) and not _is_nested_within(kind.value_type):
        yield from ((part, None) for part in _vector(leaf, kind.value_type, kind.list_size, "part"))
    elif is_list(kind) and pa.types.is_struct(kind.value_type):
        for number, field in enumerate(kind.value_type):
            step = _Step("field of each", number, kind.value_type.num_fields)
            yield _below(leaf, field.name, _listed(field), step), None
    elif is_list(kind) and is_list(kind.value_type) and _length(first):
        outer, inner = _length(first), _length(_held(first, 0))
        if outer == len(AXES) and inner > MAX_WIDTH:  # three lists of samples
            yield from ((part, None) for part in _vector(leaf, kind.value_type, outer, "part"))
        elif inner <= MAX_WIDTH:
            listed = pa.list_(kind.value_type.value_type)
            yield from ((part, None) for part in _vector(leaf, listed, inner, "part of each"))


def _vector(leaf: _Leaf, kind: pa.DataType, width: int, within: Within) -> Iterator[_Leaf]:
    if not 0 < width <= MAX_WIDTH:
        return
    names = AXES if width == len(AXES) else [str(number) for number in range(1, width + 1)]
    for number, name in enumerate(names):
        yield _below(leaf, name, pa.field(name, kind), _Step(within, number, width))


def _below(leaf: _Leaf, name: str, field: pa.Field, step: _Step) -> _Leaf:
    """A part of a column, with that one's metadata, its unit, where it has none of its own."""
    named = pa.field(f"{leaf.field.name}_{name}", field.type, metadata=field.metadata or leaf.field.metadata)
    return _Leaf(named, leaf.column, (*leaf.steps, step))


def _by_own_names(column: str, leaves: Iterable[_Leaf], taken: Sequence[str]) -> Iterator[_Leaf]:
    """The parts of a column; of one that holds facts by the names that they have in it, unless a column has one."""
    for leaf in leaves:
        own = leaf.field.name.removeprefix(f"{column}_")
        is_fact = column.lower() in FACTS and own not in taken
        yield replace(leaf, field=leaf.field.with_name(own)) if is_fact else leaf


def _listed(field: pa.Field) -> pa.Field:
    return pa.field(field.name, pa.list_(field.type), metadata=field.metadata)


def _length(value: pa.Scalar | None) -> int:
    return 0 if value is None or not value.is_valid else len(value)


def _held(value: pa.Scalar | None, number: int) -> pa.Scalar | None:
    """What a struct or a list holds in a place."""
    if value is None or not value.is_valid or len(value) <= number:
        return None
    return value.values[number] if is_list(value.type) else value[number]


def _within(column: pa.Array, leaf: _Leaf) -> pa.Array:
    """The cells of a laid-out column, of the column that it is within."""
    for step in leaf.steps:
        if step.within == "field":
            column = pc.struct_field(column, [step.number])
        elif step.within == "part":
            column = _part(column, step, leaf)
        elif step.within == "field of each":
            column = _lists(column, pc.struct_field(column.flatten(), [step.number]))
        else:
            column = _lists(column, _part(column.flatten(), step, leaf))
    return column if column.type == leaf.field.type else column.cast(leaf.field.type)


def _part(column: pa.Array, step: _Step, leaf: _Leaf) -> pa.Array:
    """One component of vectors that all have as many; of one that is null, null."""
    lengths = pc.list_value_length(column)
    if pc.any(pc.not_equal(lengths, step.width)).as_py():
        name = leaf.field.name.rpartition("_")[0]
        raise unreadable(f"The lists within {name} differ in length: the first has {step.width} components.")
    return pc.list_element(column, step.number)


def _lists(lists: pa.Array, values: pa.Array) -> pa.Array:
    """Other values in lists of the same lengths; a null list is an empty one."""
    lengths = pc.fill_null(pc.list_value_length(lists), 0)
    offsets = pa.concat_arrays([pa.array([0], pa.int64()), pc.cumulative_sum(lengths.cast(pa.int64()))])
    return pa.LargeListArray.from_arrays(offsets, values)
