"""The API's description and the list of problems, as files."""

from __future__ import annotations

from pathlib import Path

from headimpact_service.app import OPERATIONS
from headimpact_service.openapi import as_text, document
from headimpact_service.pages.problems import as_markdown


def write(output: Path, problems: Path) -> None:
    """Write both."""
    for path, text in ((output, as_text(document(OPERATIONS))), (problems, as_markdown())):
        path.write_text(text, encoding="utf-8")
        print(path)
