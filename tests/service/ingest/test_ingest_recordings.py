"""The four public recordings through the importer, against the reference values of tests/data/recordings.json."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from ingest_files import RECORDINGS, ROOT, body, encoded, needs_recordings, one, signal, zipped

from headimpact.cut_offs import NO_FILTER, PAPER
from headimpact.preparation import prepare
from headimpact.scoring import score
from headimpact_service.ingest.impact_reading import read_impact
from headimpact_service.ingest.record import ImpactRecord

pytestmark = needs_recordings

REFERENCE: dict[str, Any] = json.loads((ROOT / "tests/data/recordings.json").read_text())["recordings"]
PRESETS = {
    "nhtsa_v10146_driver": "nhtsa",
    "headsport_rugby_img_raw": "headsport",
    "camlab_example_impact0": "generic_six_axis",
    "kinmet_example1": "generic_six_axis",
}
FILTERS = {"paper": PAPER, "none": NO_FILTER}


def upload(name: str) -> bytes:
    folder = RECORDINGS / name
    if folder.is_dir():
        return zipped({f"{name}/{path.name}": path.read_bytes() for path in sorted(folder.iterdir())})
    return (RECORDINGS / f"{name}.csv").read_bytes()


def numbers(value: Any) -> list[float]:
    return list(value.values()) if isinstance(value, dict) else list(np.atleast_1d(value))


def pairs(record: ImpactRecord, expected: dict[str, Any]) -> Iterator[tuple[str, Any, Any]]:
    found = score(prepare(record.recording))
    for key, reference in expected["criteria"].items():
        criterion = found.criteria[key]
        yield key, numbers(criterion.value), numbers(reference["value"])
        yield f"{key} probability", criterion.probability, reference["probability"]
    for key, window in expected["windows"].items():
        yield f"{key} window", found.criteria[key].window_ms, window["ms"]
    for name, peak in expected["peaks"].items():
        yield name, getattr(found.peaks, name), peak


@pytest.mark.parametrize("choice", ["paper", "none"])
@pytest.mark.parametrize("name", list(PRESETS))
@pytest.mark.parametrize("named", [False, True])
def test_a_recording_goes_in_as_it_is_and_its_reference_comes_out(name: str, choice: str, named: bool):
    record = one(upload(name), low_pass=FILTERS[choice], preset=PRESETS[name] if named else None)
    assert record.metadata["preset"] == PRESETS[name]
    for what, value, expected in pairs(record, REFERENCE[name][choice]):
        np.testing.assert_allclose(value, expected, rtol=1e-9, err_msg=what)


def test_the_crash_tests_hic15_is_the_laboratorys():
    record = one(upload("nhtsa_v10146_driver"))
    hic15 = score(prepare(record.recording)).criteria["hic15"]
    assert hic15.value == pytest.approx(record.metadata["laboratory"]["hic"], abs=1.0)
    assert hic15.window_ms == pytest.approx((77.7, 92.7))
    assert record.recording.pre_trigger_ms == 50.0


@pytest.mark.parametrize("name", list(PRESETS))
def test_a_recording_sent_as_json_gives_the_same_numbers(name: str):
    recording = one(upload(name)).recording
    document: dict[str, Any] = {"axes": recording.axes, "filter": recording.low_pass.name}
    if recording.pre_trigger_ms is not None:
        document["pre_trigger_ms"] = recording.pre_trigger_ms
    for key, sent in recording.signals():
        times = {} if sent.time_s is None else {"time_ms": (sent.time_s * 1000.0).tolist()}
        document[key] = signal(sent.unit, sent.values, **(times or {"sample_rate_hz": sent.sample_rate_hz}))
    by_json = score(prepare(read_impact(encoded(body(kinematics=document))).recording))
    by_file = score(prepare(recording))
    for key, criterion in by_file.criteria.items():
        np.testing.assert_allclose(numbers(by_json.criteria[key].value), numbers(criterion.value), rtol=1e-12)
