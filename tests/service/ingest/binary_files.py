"""Parquet, Arrow, npz, MATLAB and xlsx files of our own making."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Callable, Mapping, Sequence
from typing import Any
from xml.sax.saxutils import escape

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from scipy.io import savemat

COLUMNS = ("ax_g", "ay_g", "az_g", "wx_rad_s", "wy_rad_s", "wz_rad_s")


def noise(impacts: int = 3, samples: int = 40) -> np.ndarray:
    """Samples of our own, impacts x samples x 6, no two alike."""
    return np.random.default_rng(7).normal(size=(impacts, samples, 6))


def wide(values: np.ndarray) -> pa.Table:
    """A row a sample, the impacts told apart by a column."""
    impacts, samples, _ = values.shape
    columns: dict[str, Any] = {
        "external_id": np.repeat([f"i{number}" for number in range(impacts)], samples),
        "t_ms": np.tile(np.arange(samples) * 1.0, impacts),
    }
    flat = values.reshape(-1, 6)
    return pa.table(columns | {name: flat[:, place] for place, name in enumerate(COLUMNS)})


def nested(values: np.ndarray) -> pa.Table:
    """A row an impact, its samples in lists."""
    impacts, samples, _ = values.shape
    columns: dict[str, Any] = {
        "external_id": [f"i{number}" for number in range(impacts)],
        "t_ms": [np.arange(samples) * 1.0] * impacts,
    }
    return pa.table(columns | {name: list(values[:, :, place]) for place, name in enumerate(COLUMNS)})


def parquet(table: pa.Table, **options: Any) -> bytes:
    """A Parquet file."""
    buffer = io.BytesIO()
    pq.write_table(table, buffer, **options)
    return buffer.getvalue()


def arrow(table: pa.Table, opened: Callable[..., Any] = pa.ipc.new_file, **options: Any) -> bytes:
    """An Arrow IPC file, or with `pa.ipc.new_stream` a stream."""
    buffer = io.BytesIO()
    with opened(buffer, table.schema, options=pa.ipc.IpcWriteOptions(**options)) as writer:
        writer.write_table(table)
    return buffer.getvalue()


def npz(**arrays: Any) -> bytes:
    """A NumPy archive."""
    buffer = io.BytesIO()
    np.savez_compressed(buffer, **arrays)
    return buffer.getvalue()


def mat(variables: Mapping[str, Any], **options: Any) -> bytes:
    """A MATLAB file of version 5."""
    buffer = io.BytesIO()
    savemat(buffer, dict(variables), **options)
    return buffer.getvalue()


def structs(*impacts: Mapping[str, Any]) -> np.ndarray:
    """A struct array, 1 x n as MATLAB has it."""
    array = np.zeros((1, len(impacts)), dtype=[(name, object) for name in impacts[0]])
    for place, impact in enumerate(impacts):
        array[0, place] = tuple(impact.values())
    return array


_MAIN = "http://schemas.openxmlformats.org/spreadsheetml/2006/main"
_LINKS = "http://schemas.openxmlformats.org/officeDocument/2006/relationships"
_PACKAGE = "http://schemas.openxmlformats.org/package/2006/relationships"
SHEET = "xl/worksheets/sheet1.xml"
"""The part that holds the first sheet."""

Rows = Sequence[Sequence[Any]]


def xlsx(sheets: Mapping[str, Rows]) -> bytes:
    """A workbook; texts are written into their cells, numbers as they are, None leaves a cell out."""
    listed = [
        f'<sheet name="{escape(name)}" sheetId="{place}" r:id="r{place}"/>' for place, name in enumerate(sheets, 1)
    ]
    linked = [
        f'<Relationship Id="r{place}" Type="{_LINKS}/worksheet" Target="worksheets/sheet{place}.xml"/>'
        for place in range(1, len(sheets) + 1)
    ]
    parts = {
        "_rels/.rels": f'<Relationships xmlns="{_PACKAGE}"><Relationship Id="r1" Type="{_LINKS}/officeDocument" '
        'Target="xl/workbook.xml"/></Relationships>',
        "xl/workbook.xml": f'<workbook xmlns="{_MAIN}" xmlns:r="{_LINKS}">'
        f"<sheets>{''.join(listed)}</sheets></workbook>",
        "xl/_rels/workbook.xml.rels": f'<Relationships xmlns="{_PACKAGE}">{"".join(linked)}</Relationships>',
    }
    for place, rows in enumerate(sheets.values(), 1):
        body = "".join(_row(number, row) for number, row in enumerate(rows, 1))
        parts[f"xl/worksheets/sheet{place}.xml"] = (
            f'<worksheet xmlns="{_MAIN}"><sheetData>{body}</sheetData></worksheet>'
        )
    return zipped_parts(parts)


def zipped_parts(parts: Mapping[str, str | bytes]) -> bytes:
    """Parts of a workbook, zipped."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, part in parts.items():
            archive.writestr(name, part)
    return buffer.getvalue()


def with_part(workbook: bytes, name: str, changed: Callable[[bytes], bytes]) -> bytes:
    """A workbook with one of its parts changed."""
    with zipfile.ZipFile(io.BytesIO(workbook)) as archive:
        parts = {other: archive.read(other) for other in archive.namelist()}
    return zipped_parts(parts | {name: changed(parts[name])})


def _row(number: int, row: Sequence[Any]) -> str:
    return f'<row r="{number}">{"".join(_cell(chr(65 + place), number, cell) for place, cell in enumerate(row))}</row>'


def _cell(column: str, row: int, cell: Any) -> str:
    if cell is None:
        return ""
    if isinstance(cell, str):
        return f'<c r="{column}{row}" t="inlineStr"><is><t>{escape(cell)}</t></is></c>'
    return f'<c r="{column}{row}"><v>{float(cell)!r}</v></c>'
