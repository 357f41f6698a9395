"""Schemathesis against the running service: no 500, no answer that the document does not describe."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from running import Service

# `positive_data_acceptance` is left out: a schema cannot say that stamps increase, that lists are of one length or
# that a file is a CSV, so bodies that fit it are rightly refused with 422.
LEFT_OUT = "positive_data_acceptance"


def fuzz(folder: Path, *, examples: int, phases: str, seconds: float) -> None:
    service = Service(folder)
    try:
        command = [
            str(Path(sys.executable).with_name("schemathesis")),
            "run",
            f"{service.address}/openapi.json",
            "--header",
            f"Authorization: Bearer {service.key}",
            "--checks=all",
            f"--exclude-checks={LEFT_OUT}",
            f"--max-examples={examples}",
            f"--phases={phases}",
            "--continue-on-failure",
            "--no-color",
        ]
        ended = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=seconds, check=False)
        log = (folder / "log.jsonl").read_text("utf-8")
    finally:
        service.stop()
    assert ended.returncode == 0, ended.stdout[-8000:]
    assert '"level":"error"' not in log


def test_a_short_walk_over_every_operation_finds_nothing(tmp_path: Path) -> None:
    fuzz(tmp_path, examples=3, phases="examples,fuzzing", seconds=240)


@pytest.mark.campaign
def test_a_long_walk_finds_nothing(tmp_path: Path) -> None:
    fuzz(tmp_path, examples=300, phases="examples,coverage,fuzzing,stateful", seconds=3600)
