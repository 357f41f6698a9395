"""Blank lines in a text: between blocks of rows without times they may part impacts, elsewhere they say nothing."""

from __future__ import annotations

import numpy as np
import pytest
from ingest_files import codes, csv_text, one, read, refused, six_axis

from headimpact_service.ingest import csv_format
from headimpact_service.ingest.mapping import Mapping
from headimpact_service.ingest.record import ImpactRecord

HEADING = "ax_g,ay_g,az_g,wx_rad_s,wy_rad_s,wz_rad_s"
SAMPLES = six_axis()
ROWS = [",".join(map(repr, row)) for row in SAMPLES.tolist()]


def blocks(*parts: list[str], gap: int = 1, heading: str = HEADING) -> str:
    """Rows without times in blocks with blank lines between."""
    return heading + "\n" + ("\n" * (gap + 1)).join("\n".join(part) for part in parts) + "\n"


def untimed(text: str, **options: object) -> np.ndarray:
    record = one(text, sample_rate_hz=1000.0, **options)
    assert record.recording.linear_acceleration is not None
    return record.recording.linear_acceleration.values


@pytest.mark.parametrize("at_once", [4096, 40, 7])
@pytest.mark.parametrize("gap", [1, 2])
def test_blocks_of_rows_without_times_are_refused_with_what_helps(
    gap: int, at_once: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(csv_format, "ROWS_AT_ONCE", at_once)
    problem = refused(blocks(ROWS, ROWS, gap=gap), sample_rate_hz=1000.0)
    assert codes(problem) == [(None, "several-impacts")]
    assert "Blank lines part the rows" in problem.detail
    assert "impact_id or a mapping's group_by" in problem.detail


def test_blocks_of_a_double_spaced_text_are_refused_too() -> None:
    spaced = "\n\n".join(ROWS)
    assert codes(refused(f"{HEADING}\n{spaced}\n\n\n{spaced}\n", sample_rate_hz=1000.0)) == [(None, "several-impacts")]


def test_a_sender_who_says_that_all_rows_are_one_impact_is_believed() -> None:
    values = untimed(blocks(ROWS[:20], ROWS[20:]), mapping=Mapping(group_by=[]))
    np.testing.assert_array_equal(values, SAMPLES[:, :3])


@pytest.mark.parametrize(
    "text",
    [
        HEADING + "\n" + "\n\n".join(ROWS) + "\n\n",
        HEADING + "\r\r\n" + "\r\r\n".join(ROWS) + "\r\r\n",
        blocks(ROWS) + "\n\n\n",
        blocks(ROWS, []) + "   \n",
        blocks([], ROWS),
        "\n\n" + blocks([], [], ROWS),
    ],
)
def test_a_double_spaced_text_and_blank_lines_around_the_rows_are_read(text: str) -> None:
    np.testing.assert_array_equal(untimed(text), SAMPLES[:, :3])


def test_rows_that_have_times_or_numbers_or_are_told_apart_are_read() -> None:
    heading, *rows = csv_text().splitlines()
    assert len(one(blocks(rows[:15], rows[15:], heading=heading)).recording.linear_acceleration.values) == 40
    numbered = [f"{row},{number}" for number, row in enumerate(ROWS)]
    text = blocks(numbered[:15], numbered[15:], heading=f"{HEADING},n")
    assert len(untimed(text, mapping=Mapping(sample_number="n"))) == 40
    told = [[f"{row},{name}" for row in ROWS] for name in ("a", "b")]
    apart = read(blocks(*told, heading=f"{HEADING},impact_id"), sample_rate_hz=1000.0)
    assert [isinstance(record, ImpactRecord) for record in apart] == [True, True]
