"""What cells of an Arrow type hold: numbers, lists, times, text."""

from __future__ import annotations

import pyarrow as pa


def is_number(kind: pa.DataType) -> bool:
    """Whether cells of this type are numbers."""
    types = pa.types
    return bool(
        types.is_integer(kind) or types.is_floating(kind) or types.is_decimal(kind) or types.is_null(kind)
    )  # a column without any value is of no type


def is_list(kind: pa.DataType) -> bool:
    """Whether cells of this type are lists, of whatever."""
    return bool(pa.types.is_list(kind) or pa.types.is_large_list(kind) or pa.types.is_fixed_size_list(kind))


def is_list_of_numbers(kind: pa.DataType) -> bool:
    """Whether cells of this type are lists of samples."""
    return is_list(kind) and is_number(kind.value_type)


def is_instant(kind: pa.DataType) -> bool:
    """Whether cells of this type are times of a day, with its date or without."""
    return bool(pa.types.is_timestamp(kind) or pa.types.is_time(kind))


def is_text(kind: pa.DataType) -> bool:
    """Whether cells of this type are text."""
    plain = kind.value_type if pa.types.is_dictionary(kind) else kind
    return bool(pa.types.is_string(plain) or pa.types.is_large_string(plain))


def is_told(kind: pa.DataType) -> bool:
    """Whether cells of this type can be read as text."""
    types = pa.types
    kind = kind.value_type if types.is_dictionary(kind) else kind
    told = (types.is_null, types.is_string, types.is_large_string, types.is_integer, types.is_floating)
    return any(is_one(kind) for is_one in (*told, types.is_timestamp, types.is_time, types.is_boolean, types.is_date))
