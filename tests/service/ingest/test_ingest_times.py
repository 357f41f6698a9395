"""When an impact happened: offsets, local times and their zones."""

from __future__ import annotations

from datetime import UTC, datetime

import pytest
from ingest_files import body, codes, encoded

from headimpact_service.errors import Problem
from headimpact_service.ingest.impact_reading import read_impact
from headimpact_service.ingest.times import TimeError, instant, nanoseconds


@pytest.mark.parametrize(
    ("text", "zone"),
    [
        ("2026-11-20T19:04:05.123Z", None),
        ("2026-11-20T19:04:05.123+00:00", None),
        ("2026-11-20t19:04:05.123z", None),
        ("2026-11-20 19:04:05.123Z", None),
        ("2026-11-20T20:04:05.123+01:00", None),
        ("2026-11-20T14:04:05.123", "America/New_York"),
        ("2026-11-20T14:04:05.123-05:00", "Europe/Dublin"),
    ],
)
def test_one_instant_in_all_its_spellings(text: str, zone: str | None):
    assert instant(text, zone) == datetime(2026, 11, 20, 19, 4, 5, 123000, tzinfo=UTC)
    assert instant(text, zone).tzinfo is UTC


@pytest.mark.parametrize(
    ("text", "zone", "code", "field"),
    [
        ("2026-11-20T19:04:05", None, "offset-missing", "occurred_at"),
        ("2026-10-25T01:30:00", "Europe/Dublin", "ambiguous-time", "occurred_at"),
        ("2026-03-29T01:30:00", "Europe/Dublin", "nonexistent-time", "occurred_at"),
        ("2026-11-20T19:04:05", "Europe/Atlantis", "unknown-zone", "time_zone"),
        ("2026-11-20T19:04:05", "../../etc/passwd", "unknown-zone", "time_zone"),
        ("2026-11-20T19:04:05", "/etc/localtime", "unknown-zone", "time_zone"),
        ("2026-11-20T19:04:05", "localtime", "unknown-zone", "time_zone"),
        ("2026-11-20T19:04:05", "America", "unknown-zone", "time_zone"),
        ("2026-11-20T19:04:05", "", "unknown-zone", "time_zone"),
        ("2026-11-20T19:04:05", "A" * 10_000, "unknown-zone", "time_zone"),
        ("2026-11-20T19:04:05", "Europe/Dub\x00lin", "unknown-zone", "time_zone"),
        ("2026-02-30T19:04:05Z", None, "not-a-time", "occurred_at"),
        ("2026-11-20T25:04:05Z", None, "not-a-time", "occurred_at"),
        ("2026-11-20", None, "not-a-time", "occurred_at"),
        ("20261120T190405Z", None, "not-a-time", "occurred_at"),
        ("1763665445123", None, "not-a-time", "occurred_at"),
        ("", None, "not-a-time", "occurred_at"),
        ("0001-01-01T00:00:00+14:00", None, "out-of-range", "occurred_at"),
        ("9999-12-31T23:59:59-14:00", None, "out-of-range", "occurred_at"),
        ("0001-01-01T00:00:00", "Asia/Tokyo", "out-of-range", "occurred_at"),
    ],
)
def test_a_time_that_cannot_be_placed_is_refused(text: str, zone: str | None, code: str, field: str):
    with pytest.raises(TimeError) as caught:
        instant(text, zone)
    assert (caught.value.code, caught.value.field) == (code, field)


@pytest.mark.parametrize(
    ("text", "after"),
    [
        ("1970-01-01T00:00:00Z", 0),
        ("1970-01-01 00:00:01.5", 1_500_000_000),
        ("1970-01-01t01:00:00.000000001+01:00", 1),
        ("1969-12-31T23:59:59.999999999Z", -1),
        ("2026-10-03T14:05:22.113000Z", 1_791_036_322_113_000_000),
        ("0001-01-01T00:00:00+14:00", -62_135_647_200 * 10**9),
        ("2026-02-30T00:00:00Z", None),
        ("2026-10-03T14:05:22.Z", None),
        ("2026-10-03", None),
        ("1791036322", None),
        ("2026-10-03T14:05:22.113000Z\n", None),
        ("٢026-10-03T14:05:22Z", None),
    ],
)
def test_a_time_counts_from_1970_to_the_nanosecond(text: str, after: int | None):
    assert nanoseconds(text) == after


@pytest.mark.parametrize(
    ("changes", "fault"),
    [
        ({"occurred_at": "2026-11-20T19:04:05"}, ("/occurred_at", "offset-missing")),
        ({"occurred_at": "2026-10-25T01:30:00", "time_zone": "Europe/Dublin"}, ("/occurred_at", "ambiguous-time")),
        ({"occurred_at": "2026-11-20T19:04:05Z", "time_zone": "Mars/Olympus"}, ("/time_zone", "unknown-zone")),
        ({"occurred_at": None, "time_zone": "Mars/Olympus"}, ("/time_zone", "unknown-zone")),
        ({"occurred_at": 1763665445}, ("/occurred_at", "wrong-type")),
    ],
)
def test_a_body_says_which_of_its_fields_cannot_be_placed(changes: dict[str, object], fault: tuple[str, str]):
    with pytest.raises(Problem) as caught:
        read_impact(encoded(body(**changes)))
    assert caught.value.status == 422
    assert codes(caught.value) == [fault]


def test_a_local_time_with_its_zone_is_taken():
    record = read_impact(encoded(body(occurred_at="2026-07-01T12:00:00", time_zone="Europe/Dublin")))
    assert record.occurred_at == datetime(2026, 7, 1, 11, tzinfo=UTC)
