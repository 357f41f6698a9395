"""Whether there is room to write where the service writes."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

LOW = 64 * 1024 * 1024
"""Free bytes below which an operator is warned."""

PRIVATE = 0o600
"""Files of people's measurements are for this user only."""


def exposed(file: Path, what: str) -> list[str]:
    """What an operator should know of a file that other users can read, as one that was restored may be."""
    try:
        mode = file.stat().st_mode & 0o777
    except OSError:
        return []
    if mode & ~PRIVATE == 0:
        return []
    return [f"Other users of this machine may read {what} ({mode:04o}): chmod {PRIVATE:o} {file.name}"]


def warnings(folder: Path, what: str) -> list[str]:
    """What an operator should know of a folder that is written to, as sentences; it is made if it is not there."""
    try:
        folder.mkdir(parents=True, exist_ok=True, mode=0o700)
        free = shutil.disk_usage(folder).free
    except OSError as error:
        return [f"The folder of {what} cannot be used: {error.strerror}."]
    if not os.access(folder, os.W_OK):
        return [f"The folder of {what} cannot be written to."]
    if free < LOW:
        return [f"The disk of {what} has {free // 1024**2} MiB left."]
    return []
