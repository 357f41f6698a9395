"""JSON and NDJSON files: one impact or many, each with its own fate."""

from __future__ import annotations

import json
import time
import tracemalloc
from datetime import UTC, datetime
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from ingest_files import body, codes, encoded, one, outcome, read, refused, statuses

from headimpact.cut_offs import NO_FILTER
from headimpact.preparation import prepare
from headimpact_service.errors import Problem
from headimpact_service.ingest import json_format, ndjson_format
from headimpact_service.ingest.digest import content_digest
from headimpact_service.ingest.impact_reading import read_impact
from headimpact_service.ingest.json_items import items
from headimpact_service.ingest.mapping import Mapping
from headimpact_service.ingest.record import ImpactRecord, RefusedImpact


@pytest.mark.parametrize("name", [7, "x" * 201, ["a"]])
def test_a_name_that_is_none_is_not_given_back(name: Any):
    for data in (json.dumps([body(), body(external_id=name)]).encode(), lines(body(), body(external_id=name))):
        refusal = read(data)[1]
        assert isinstance(refusal, RefusedImpact)
        assert refusal.external_id is None


def ids(items: list[ImpactRecord | Problem]) -> list[str | None]:
    return [item.external_id if isinstance(item, ImpactRecord) else item.slug for item in items]


def lines(*documents: Any) -> bytes:
    return b"\n".join(document if isinstance(document, bytes) else encoded(document) for document in documents)


@pytest.mark.parametrize("indent", [None, 2])
def test_a_file_of_one_impact_is_that_impact(indent: int | None):
    record = one(json.dumps(body(), indent=indent))
    assert content_digest(record) == content_digest(read_impact(encoded(body())))
    assert record.metadata == {"format": "json"}


@pytest.mark.parametrize("wrap", [lambda many: many, lambda many: {"data": many}, lambda many: {"impacts": many}])
def test_a_file_may_hold_a_list(wrap: Any):
    many = [body(external_id="a"), body(external_id="b", athlete=None)]
    assert ids(read(json.dumps(wrap(many)))) == ["a", "b"]


@pytest.mark.parametrize(
    "text", [encoded(body()).decode(), json.dumps([body()], indent=2), f"\n{json.dumps(body())}\n{{}}"]
)
@pytest.mark.parametrize(("mark", "encoding"), [(b"\xff\xfe", "utf-16-le"), (b"\xfe\xff", "utf-16-be")])
def test_json_in_utf16_is_refused_and_hears_of_utf8(text: str, mark: bytes, encoding: str):
    problem = refused(mark + text.encode(encoding))
    assert (problem.slug, problem.detail) == ("unreadable-file", "The file is JSON in UTF-16: write it in UTF-8.")


def test_a_bad_impact_of_a_list_is_its_own_problem():
    bad = body(external_id="b")
    bad["kinematics"]["angular_velocity"]["unit"] = "rpm"
    first, second, third, last = read(json.dumps([body(external_id="a"), bad, 7, body(external_id="d")]))
    assert ids([first, second, third, last]) == ["a", "invalid-payload", "invalid-payload", "d"]
    assert isinstance(second, Problem)
    assert codes(second) == [("/kinematics/angular_velocity/unit", "not-allowed")]
    assert isinstance(second, RefusedImpact)
    assert second.external_id == "b"
    assert isinstance(third, Problem)
    assert codes(third) == [("", "wrong-type")]


def test_numbers_that_are_not_finite_or_no_numbers_are_refused_in_files_too():
    text = json.dumps(body()).replace("30.0,", "%s,", 1)
    for value in ("NaN", "Infinity", "1e400", "true", '"1"', "null", "1" + "0" * 400):
        problem = refused(text % value)
        assert problem.slug == "invalid-payload"
        assert problem.errors[0].pointer is not None
        assert problem.errors[0].pointer.startswith("/kinematics/linear_acceleration/x/")


@pytest.mark.parametrize(
    ("data", "said"),
    [
        (b"{", "not JSON"),
        (b"[" * 10_000, "is not closed"),
        (b"[" * 500 + b"]" * 500, "nested too deeply"),
        (b'[{"a": 1}', "or the end of the list"),
        (b'[{"a": 1},]', "or the end of the list"),
        (b'[{"a": 1} {"a": 1}]', "or the end of the list"),
        (b'[{"a": "\\"}]', "is not closed"),
        (b'["a]', "a value was expected"),
        (b"[,]", "a value was expected"),
        (b"[1] 2", "more than a list of impacts"),
        (b'{"data": [1], "next_cursor": null}', "more than a list of impacts"),
        (b'{"data": [1]', "more than a list of impacts"),
        (b"[nul]", "not JSON"),
        (b'[{"a": "\\ud800"}]', "not JSON"),
        (b"[]", "no impact"),
        (b'{"data": []}', "no impact"),
    ],
)
def test_a_file_that_is_not_json_or_empty_is_refused(data: bytes, said: str):
    problem = refused(data)
    assert problem.slug == "unreadable-file"
    assert said in problem.detail


any_json = st.recursive(
    st.none() | st.integers() | st.text(),
    lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner),
)


@pytest.mark.parametrize("indent", [None, 1])
@given(many=st.lists(any_json, max_size=5))
def test_a_list_is_parted_into_its_items(indent: int | None, many: list[Any]):
    for wrapped in (many, {"data": many}, {"impacts": many}):
        text = json.dumps(wrapped, indent=indent, ensure_ascii=False).encode("utf-8", "surrogatepass")
        assert [json.loads(item) for item in items(text)] == many


@pytest.mark.parametrize("whole", ["{}", '{"data": 1}', '{"a": [1]}', "7", '"a"', " {}"])
def test_what_is_no_list_is_one_item(whole: str):
    assert list(items(whole.encode())) == [whole.encode()]


@pytest.mark.parametrize(
    "inside",
    [
        b"[]" + b",[]" * 3_000_000,
        b"{}" + b",{}" * 3_000_000,
        b"[" + b"[]," * 2_000_000 + b"[]]",
        b"1" + b",1" * 4_000_000,
    ],
    ids=["lists", "objects", "nested", "numbers"],
)
def test_millions_of_small_values_never_become_objects(inside: bytes):
    tracemalloc.start()
    try:
        refused(b"[" + inside + b"]", max_impacts=1000)
        assert tracemalloc.get_traced_memory()[1] < 3 * len(inside)
    finally:
        tracemalloc.stop()


def test_quotes_that_never_close_cost_no_more_than_their_text():
    start = time.process_time()
    assert "is not closed" in refused(b'[{"a": "' + b'\\"' * 1_000_000).detail
    assert time.process_time() - start < 2.0


def test_an_impact_of_thousands_of_members_is_refused():
    crowded = body(external_id="b", context={f"k{i}": 1 for i in range(6000)})
    for data in (json.dumps([body(), crowded]).encode(), lines(body(), crowded)):
        good, bad = read(data)
        assert isinstance(good, ImpactRecord)
        assert isinstance(bad, Problem)
        assert bad.slug == "unreadable-file"
        assert "5000 members" in bad.detail


def test_ndjson_is_an_impact_a_line_and_empty_lines_are_passed_over():
    data = b"\xef\xbb\xbf" + lines(body(external_id="a"), b"", b"  ", body(external_id="b")) + b"\r\n"
    assert ids(read(data)) == ["a", "b"]


def test_a_bad_line_is_that_lines_problem():
    data = lines(body(external_id="a"), b'{"kinematics": ', body(external_id="c", colour="red"), body(external_id="d"))
    items = read(data)
    assert ids(items) == ["a", "unreadable-file", "invalid-payload", "d"]
    assert isinstance(items[1], Problem)
    assert "line 2" in items[1].detail
    assert isinstance(items[2], Problem)
    assert codes(items[2]) == [("/colour", "unknown-field")]
    assert [item.external_id for item in items if isinstance(item, RefusedImpact)] == [None, "c"]


def test_one_line_is_ndjson_by_name_or_type():
    data = lines(b'{"kinematics": ')
    assert refused(data, filename="x.NDJSON").slug == "unreadable-file"
    assert len(read(data, filename="x.jsonl")) == 1
    assert len(read(data, content_type="application/x-ndjson; charset=utf-8")) == 1


def test_a_line_is_bounded(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(json_format, "MAX_IMPACT", 5000)
    monkeypatch.setattr(ndjson_format, "MAX_IMPACT", 5000)
    items = read(lines(body(external_id="a"), b"{" + b" " * 6000 + b"}", body(external_id="c")))
    assert ids(items) == ["a", "unreadable-file", "c"]


def test_the_number_of_impacts_is_bounded():
    for data in (json.dumps([body()] * 3).encode(), lines(body(), body(), body())):
        assert len(read(data, max_impacts=3)) == 3
        with pytest.raises(Problem) as caught:
            read(data, max_impacts=2)
        assert caught.value.slug == "import-too-large"


@pytest.mark.parametrize("data", [json.dumps([body(athlete={"id": "ath_1"})]).encode(), lines(body(), b"{")])
def test_fields_beside_the_file_override_what_is_in_it(data: bytes):
    when = datetime(2027, 1, 1, tzinfo=UTC)
    record = read(
        data,
        athlete="p-9",
        device="d-9",
        occurred_at=when,
        axes="sae_j211",
        low_pass=NO_FILTER,
        sample_rate_hz=1000.5,
        filename="delivery.json",
    )[0]
    assert isinstance(record, ImpactRecord)
    assert (record.athlete_id, record.athlete_external_id, record.device_serial) == (None, "p-9", "d-9")
    assert record.occurred_at == when
    assert record.recording.axes == "sae_j211"
    assert record.recording.low_pass is NO_FILTER
    assert [signal.sample_rate_hz for _, signal in record.recording.signals()] == [1000.5, 1000.5]
    assert record.metadata == {"format": "json", "file": "delivery.json"}


def test_a_rate_beside_the_file_that_the_file_contradicts_is_refused():
    for kinematics in (body(), stamped()):
        [problem] = read(json.dumps(kinematics), sample_rate_hz=2000.0)
        assert codes(problem) == [("sample_rate_hz", "rate-differs")]


def stamped() -> dict[str, Any]:
    sent = body()
    for name in ("linear_acceleration", "angular_velocity"):
        signal = sent["kinematics"][name]
        rate = signal.pop("sample_rate_hz")
        signal["time_ms"] = [1000.0 * n / rate for n in range(len(signal["x"]))]
    return sent


def test_a_zone_beside_the_file_places_its_local_times():
    data = json.dumps(body(occurred_at="2026-07-01T12:00:00"))
    assert codes(refused(data)) == [("/occurred_at", "offset-missing")]
    assert one(data, time_zone="Europe/Dublin").occurred_at == datetime(2026, 7, 1, 11, tzinfo=UTC)


def test_a_file_that_names_its_fields_takes_neither_preset_nor_mapping():
    for data in (json.dumps(body()).encode(), lines(body(), body())):
        assert "neither preset nor mapping" in refused(data, preset="swa").detail
        assert "neither preset nor mapping" in refused(data, mapping=Mapping.model_validate({})).detail


json_values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=8), inner, max_size=3),
    max_leaves=10,
)
places = st.lists(
    st.sampled_from(["kinematics", "linear_acceleration", "x", "unit", "filter", "context", "mounting", "device"]),
    min_size=1,
    max_size=3,
)


@settings(max_examples=200, suppress_health_check=[HealthCheck.too_slow], deadline=None)
@given(steps=places, value=json_values)
def test_any_value_anywhere_is_read_or_refused(steps: list[str], value: Any):
    document = body()
    node = document
    for step in steps[:-1]:
        node = node.setdefault(step, {}) if isinstance(node.get(step, {}), dict) else node
    node[steps[-1]] = value
    items = outcome(json.dumps([document]))
    assert len(items) == 1
    assert statuses(items) <= {422}


def test_what_a_signal_lacks_may_be_said_beside_the_file():
    sent = body()
    for name in ("linear_acceleration", "angular_velocity"):
        for field in ("sample_rate_hz", "time_ms"):
            sent["kinematics"][name].pop(field, None)
    problem = refused(encoded(sent))
    assert problem.status == 422
    rates = {signal.sample_rate_hz for _, signal in one(encoded(sent), sample_rate_hz=2000.0).recording.signals()}
    assert rates == {2000.0}
    gap = body()
    gap["kinematics"]["linear_acceleration"]["x"][5] = None
    assert "fill_gaps" in refused(encoded(gap)).errors[0].detail
    filled = one(encoded(gap), fill_gaps=True).recording
    assert filled.fill_gaps
    assert "gaps_filled" in [note.code for note in prepare(filled).notes]
