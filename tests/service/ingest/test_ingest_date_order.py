"""Dates that do not begin with their year: read in the order that a mapping says, and never in a guessed one."""

from __future__ import annotations

from datetime import UTC, datetime

import pytest
from ingest_files import codes, csv_text, one, read, refused
from test_ingest_mapping import swa

from headimpact_service.errors import Problem
from headimpact_service.ingest.date_order import year_first
from headimpact_service.ingest.mapping import Mapping
from headimpact_service.ingest.record import ImpactRecord

BESIDE = {"sample_rate_hz": 1000.0, "time_zone": "UTC"}
WHEN = datetime(2026, 3, 4, 19, 4, 5, 123000, tzinfo=UTC)


def ordered(order: str | None, **columns: str) -> Mapping:
    return Mapping.model_validate({"occurred_at": (columns or {"date": "Date", "time": "Time"}) | {"order": order}})


@pytest.mark.parametrize(
    ("date", "order"),
    [
        ("04/03/2026", "dmy"),
        ("04.03.2026", "dmy"),
        ("4-3-2026", "dmy"),
        ("03/04/2026", "mdy"),
        ("2026/3/4", "ymd"),
        ("2026.03.04", "ymd"),
    ],
)
def test_a_date_is_read_in_the_order_that_the_mapping_says(date: str, order: str) -> None:
    record = one(swa("1", date=date), **BESIDE, mapping=ordered(order))
    assert record.occurred_at == WHEN
    assert record.metadata["preset"] == "swa"
    text = csv_text(before={"When": f"{date} 19:04:05.123"})
    assert one(text, time_zone="UTC", mapping=ordered(order, date="When")).occurred_at == WHEN
    zoned = csv_text(before={"When": f"{date}T20:04:05.123+01:00"})
    assert one(zoned, mapping=ordered(order, date="When")).occurred_at == WHEN


@pytest.mark.parametrize("date", ["25/03/2026", "25.03.2026", "03/25/2026", "04/03/2026", "04/03/26"])
def test_without_an_order_it_is_refused_with_the_mapping_that_helps(date: str) -> None:
    problem = refused(swa("1", date=date), **BESIDE)
    assert codes(problem) == [("/occurred_at/order", "date-order-missing")]
    assert '{"occurred_at": {"date": "Date", "time": "Time", "order": "dmy"}}' in problem.detail
    assert problem.detail.index("order") < problem.detail.index("give occurred_at beside the file")
    alone = refused(csv_text(before={"occurred_at": f"{date} 19:04:05"}), time_zone="UTC")
    assert '{"occurred_at": {"date": "occurred_at", "order": "dmy"}}' in alone.detail


@pytest.mark.parametrize(
    ("date", "order"),
    [("03/25/2026", "dmy"), ("25/03/2026", "mdy"), ("2026-03-25", "dmy"), ("25/03/2026", "ymd"), ("25/03/26", "dmy")],
)
def test_a_date_that_contradicts_the_order_is_a_fault_of_its_impact(date: str, order: str) -> None:
    good = {"dmy": "04/03/2026", "mdy": "03/04/2026", "ymd": "2026/03/04"}[order]
    text = swa("1", date=good) + "\n" + swa("2", date=date).split("\n", 1)[1]
    first, second = read(text, **BESIDE, mapping=ordered(order))
    assert isinstance(first, ImpactRecord)
    assert first.occurred_at == WHEN
    assert isinstance(second, Problem)
    assert codes(second) == [("/occurred_at/order", "date-order")]


def test_a_time_beside_the_file_still_stands_for_all_and_a_missing_time_is_none() -> None:
    assert one(swa("1", date="25/03/2026"), sample_rate_hz=1000.0, occurred_at=WHEN).occurred_at == WHEN
    assert one(swa("1", date="", time=""), **BESIDE, mapping=ordered("dmy")).occurred_at is None


def test_a_date_with_its_time_in_one_column_needs_no_order_where_its_year_is_first() -> None:
    text = csv_text(before={"When": "2026/03/04 19:04:05.123"})
    assert one(text, time_zone="UTC", mapping=ordered(None, date="When")).occurred_at == WHEN


def test_days_in_the_order_that_is_said_tell_several_impacts() -> None:
    days = [csv_text(before={"When": f"{day}/03/2026 19:04:05"}) for day in (4, 5)]
    text = days[0] + days[1].split("\n", 1)[1].replace("0.0", "1.0", 1)
    problem = refused(text.replace("t_s", "n"), **BESIDE, mapping=ordered("dmy", date="When"))
    assert codes(problem) == [(None, "several-impacts")]


def test_a_day_that_does_not_exist_is_no_time() -> None:
    problem = refused(swa("1", date="30/02/2026"), **BESIDE, mapping=ordered("dmy"))
    assert codes(problem) == [("occurred_at", "not-a-time")]


@pytest.mark.parametrize("text", ["37:10.6", "", "1763665445", "25/03-2026", "4 March 2026"])
def test_what_is_no_date_in_numbers_is_left_to_the_rule_of_times(text: str) -> None:
    assert year_first(text, "dmy") == text.replace("/", "-")
