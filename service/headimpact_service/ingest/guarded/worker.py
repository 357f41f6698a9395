"""The process that parses files of one format: a file comes in as a descriptor, its tables go out as frames.

Started by :mod:`headimpact_service.ingest.guard` as ``python -m headimpact_service.ingest.guarded.worker FORMAT FD``.
It ends when the service does, when nothing came for a while, and after any file that took too much.
"""

from __future__ import annotations

import gc
import io
import os
import socket
import sys
from collections.abc import Callable, Iterator
from importlib import import_module

import numpy as np

from headimpact_service import memory
from headimpact_service.errors import Problem
from headimpact_service.ingest.cells import Words
from headimpact_service.ingest.guarded import limits
from headimpact_service.ingest.guarded.contents import Content, Lines, NamedTable
from headimpact_service.ingest.guarded.wire import Array, Deadline, Frame, WireError, receive, send
from headimpact_service.ingest.table import Columns

FORMATS = {
    "arrow": "columnar_file",
    "npz": "npz_file",
    "mat": "mat_file",
    "xlsx": "xlsx_file",
}
IDLE_S = 60.0

Reader = Callable[[io.BufferedIOBase], Iterator[Content]]


def main() -> None:
    """Serve one connection."""
    memory.give_back()
    kind, descriptor = sys.argv[1], int(sys.argv[2])
    with memory.without_pandas(), socket.socket(fileno=descriptor) as connection:
        try:
            serve(connection, kind)
        except WireError:
            return


def serve(connection: socket.socket, kind: str) -> None:
    """Say whether the format can be read here, then answer file after file."""
    try:
        reader = reader_of(kind)
    except ImportError as error:
        send(connection, Frame("absent", {"library": (error.name or "").partition(".")[0]}))
        return
    gc.collect()
    gc.freeze()
    memory.let_go_of_code()
    allowed = limits.Memory()
    limits.close_doors()
    send(connection, Frame("ready"))
    while True:
        stream = _next_file(connection)
        if stream is None:
            return
        with stream:
            allowed.before_file(_size(stream))
            sound = answer(connection, reader, stream)
        stays = sound and not allowed.has_grown()
        send(connection, Frame("rest", {"stays": stays}))
        if not stays:
            return


def reader_of(kind: str) -> Reader:
    """The reader of a format, its libraries loaded and used once, so that nothing is opened later.

    Raises
    ------
    ImportError
        A library is not installed.
    """
    module = import_module(f"headimpact_service.ingest.guarded.{FORMATS[kind]}")
    module.warm_up()
    reader: Reader = module.contents
    return reader


def answer(connection: socket.socket, reader: Reader, stream: io.BufferedIOBase) -> bool:
    """Send what a file holds, or why it is not read; False where this process should end after it."""
    try:
        for content in reader(stream):
            if isinstance(content, Lines):
                _send_lines(connection, content)
            elif not _offer(connection, content):
                break
        send(connection, Frame("end"))
    except WireError:
        raise
    except Problem as problem:
        send(connection, _refusal("refused", problem))
    except MemoryError:
        send(connection, Frame("exhausted"))
        return False
    except Exception as error:  # whatever a library makes of a broken file
        send(connection, Frame("broken", {"error": type(error).__name__}))
        return not isinstance(error, RecursionError)
    return True


def _offer(connection: socket.socket, content: NamedTable) -> bool:
    """Show a table's headings, then send the columns that are wanted; False where no more is wanted."""
    table = content.table
    units = {str(column): unit for column, unit in table.units.items()}
    shown = {
        "name": content.name,
        "headings": table.headings,
        "units": units,
        "above": [list(row) for row in table.above],
        "beside": [list(row) for row in table.beside],
        "dated": list(table.dated),
        "wordless": list(table.wordless),
        "parted": table.parted,
        "sampled": "".join("1" if table.has_samples(place) else "0" for place in range(len(table.headings))),
    }
    send(connection, Frame("table", shown))
    wanted = receive(connection, Deadline(None))
    if wanted.kind != "read":
        return wanted.kind == "skip"
    try:
        for block in table.blocks(wanted.fields["numbers"], wanted.fields["texts"]):
            send(connection, _block(block))
    except Problem as problem:
        if content.name is None:
            raise
        send(connection, _refusal("table_refused", problem))  # the others are read
    else:
        send(connection, Frame("table_end"))
    return True


def _refusal(kind: str, problem: Problem) -> Frame:
    return Frame(kind, {"slug": problem.slug, "detail": problem.detail})


def _block(block: Columns) -> Frame:
    """Numbers as they are; texts as places in a list of what occurs, as names of impacts repeat row by row."""
    numbers: list[Array] = [np.asarray(values, "<f8") for values in block.numbers.values()]
    texts = [Words.of(cells) for cells in block.texts.values()]
    places: list[Array] = [np.asarray(words.places, "<i4") for words in texts]
    fields = {
        "rows": block.rows,
        "lengths": block.lengths,
        "words": [list(words.known) for words in texts],
        "joined": block.joined,
    }
    return Frame("block", fields, [*numbers, *places])


def _send_lines(connection: socket.socket, lines: Lines) -> None:
    """JSON lines, in pieces."""
    send(connection, Frame("lines"))
    for piece in lines.pieces:
        send(connection, Frame("piece", arrays=[np.frombuffer(piece, "u1")]))
    send(connection, Frame("lines_end"))


def _next_file(connection: socket.socket) -> io.BufferedReader | None:
    """The next file's descriptor, as a stream; None where none comes."""
    connection.settimeout(IDLE_S)
    try:
        data, descriptors, _, _ = socket.recv_fds(connection, 1, 1)
    except OSError:
        return None
    if not data or not descriptors:
        return None
    return os.fdopen(descriptors[0], "rb")


def _size(stream: io.BufferedReader) -> int:
    return os.fstat(stream.fileno()).st_size


if __name__ == "__main__":
    main()
