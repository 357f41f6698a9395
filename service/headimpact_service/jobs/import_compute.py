"""What the child process of an import does first: read the file to its end, then have it scored part by part.

What scoring needs is loaded once the file is known to be readable: 20 MB that a hostile one does not come to take.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from headimpact_service import memory
from headimpact_service.errors import Problem
from headimpact_service.ingest.options import ImportOptions
from headimpact_service.ingest.upload import read_upload

if TYPE_CHECKING:
    from headimpact_service.jobs.import_score import Chunk


def compute(arguments: dict[str, Any]) -> Iterator[int | Chunk]:
    """How many impacts the file holds, unless that is known; then its chunks, from the first that is not stored.

    The file is read to its end before anything of it is scored: one that breaks in its midst stores nothing, as in a
    request.
    """
    path = Path(arguments["path"])
    options = ImportOptions.from_fields(arguments["fields"], **arguments["known"])
    if not path.exists():
        raise Problem("unreadable-file", "The file that was uploaded is no longer there.")
    if arguments["total"] is None:
        yield sum(1 for _ in read_upload(path, options))
    from headimpact_service.jobs.import_score import scored

    memory.spare_the_collector()
    memory.let_go_of_code()
    yield from scored(read_upload(path, options), arguments)
