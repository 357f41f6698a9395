"""Digests: one impact has one, however it is written; any change of its content gives another."""

from __future__ import annotations

import json
from copy import deepcopy
from dataclasses import replace
from datetime import timedelta
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from ingest_files import body, csv_text, encoded, kinematics, one, six_axis

from headimpact_service.ingest.digest import content_digest, input_digest, shown
from headimpact_service.ingest.impact_reading import read_impact


def digest_of(document: Any) -> bytes:
    return content_digest(read_impact(encoded(document)))


def backwards(value: Any) -> Any:
    if isinstance(value, dict):
        return {name: backwards(value[name]) for name in reversed(value)}
    return value


def test_spelling_makes_no_difference():
    plain = body()
    reference = digest_of(plain)
    assert len(reference) == 32
    assert digest_of(backwards(plain)) == reference
    spelled = deepcopy(plain)
    spelled["occurred_at"] = "2026-11-20T21:04:05.123000+02:00"
    for signal in ("linear_acceleration", "angular_velocity"):
        spelled["kinematics"][signal]["sample_rate_hz"] = 1000.0
        for axis in "xyz":
            values = spelled["kinematics"][signal][axis]
            spelled["kinematics"][signal][axis] = [int(v) if v == int(v) else v for v in values]
    assert digest_of(spelled) == reference
    text = json.dumps(plain, indent=4).replace("[\n    0.0,", "[\n -0.0,").encode()
    assert content_digest(read_impact(text)) == reference


def test_defaults_said_or_left_out_make_no_difference():
    document = body()
    reference = digest_of(document)
    for name in ("axes", "location", "filter", "angular_acceleration"):
        del document["kinematics"][name]
    assert digest_of(document) == reference


@pytest.mark.parametrize(
    "changes",
    [
        {"external_id": "another"},
        {"operating_points": [{"criterion": "bam", "sensitivity": 0.9}]},
        {"include": ["traces"]},
        {"extra_criteria": ["damage"]},
    ],
)
def test_what_is_asked_and_what_it_is_called_are_not_content(changes: dict[str, Any]):
    assert digest_of(body(**changes)) == digest_of(body())


@pytest.mark.parametrize(
    "changes",
    [
        {"athlete": {"external_id": "p-18"}},
        {"athlete": {"id": "p-17"}},
        {"occurred_at": "2026-11-20T19:04:05.124Z"},
        {"occurred_at": None},
        {"device": {"serial": "mg-0043"}},
        {"context": {"session_id": "g-2026-11-20"}},
        {"context": None},
    ],
)
def test_who_when_and_with_what_are_content_but_not_input(changes: dict[str, Any]):
    assert digest_of(body(**changes)) != digest_of(body())
    assert input_digest(read_impact(encoded(body(**changes)))) == input_digest(read_impact(encoded(body())))


@pytest.mark.parametrize(
    "changes",
    [
        {"axes": "sae_j211"},
        {"filter": "none"},
        {"filter": {"linear_acceleration": 300}},
        {"pre_trigger_ms": 11},
        {"pre_trigger_ms": None},
        {"location": "sensor"},
        {"constrained_plane": "sagittal"},
        {"angular_velocity": None},
    ],
)
def test_how_the_samples_are_read_is_content_and_input(changes: dict[str, Any]):
    changed = body(kinematics=kinematics(six_axis(), **changes))
    assert digest_of(changed) != digest_of(body())
    assert input_digest(read_impact(encoded(changed))) != input_digest(read_impact(encoded(body())))


@given(row=st.integers(0, 39), column=st.integers(0, 5))
def test_one_changed_bit_of_one_sample_changes_both_digests(row: int, column: int):
    samples = six_axis()
    before = read_impact(encoded(body(kinematics=kinematics(samples))))
    samples[row, column] = np.nextafter(samples[row, column], np.inf)
    after = read_impact(encoded(body(kinematics=kinematics(samples))))
    assert content_digest(after) != content_digest(before)
    assert input_digest(after) != input_digest(before)


def test_a_digest_of_the_kinematics_that_is_known_is_not_made_again():
    record = read_impact(encoded(body()))
    assert content_digest(record, input_digest(record)) == content_digest(record)
    assert content_digest(record, bytes(32)) != content_digest(record)


def test_json_and_csv_of_one_impact_have_one_digest():
    document = {"kinematics": kinematics(six_axis(), pre_trigger_ms=None), "athlete": {"external_id": "p-17"}}
    as_csv, as_json = one(csv_text(), athlete="p-17"), read_impact(encoded(document))
    assert (input_digest(as_csv), content_digest(as_csv)) == (input_digest(as_json), content_digest(as_json))


def test_microseconds_count_in_any_year():
    record = read_impact(encoded(body(occurred_at="9990-01-01T00:00:00Z")))
    assert record.occurred_at is not None
    later = replace(record, occurred_at=record.occurred_at + timedelta(microseconds=1))
    assert content_digest(record) != content_digest(later)


def test_the_canonical_bytes_are_fixed():
    """Digests are stored: a change of these values breaks the recognition of every impact delivered before."""
    record = read_impact(encoded(body(kinematics=kinematics(np.arange(24.0).reshape(4, 6)))))
    assert shown(input_digest(record)) == "sha256:a603754a65bde2fbcb2c35f18e2d250fd51edd9a4e971a33ff1b7ccdaea7f570"
    assert shown(content_digest(record)) == "sha256:1346b7ac7c9e84a99b0500eb2383f0cfce4a9986220a7e2e8715951414116363"
