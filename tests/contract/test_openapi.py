"""openapi/openapi.json, docs/problems.md and the examples are what the code says, and the examples work."""

from __future__ import annotations

import json
import re
import runpy
from pathlib import Path
from typing import Any

import pytest
from conforming import ROOT as DOCUMENT
from conforming import document
from jsonschema import Draft202012Validator
from referencing import Registry, Resource
from referencing.jsonschema import DRAFT202012
from sending import Api

from headimpact_service.app import OPERATIONS
from headimpact_service.deps import SCOPES
from headimpact_service.errors import PROBLEMS
from headimpact_service.openapi import as_text
from headimpact_service.operation import ANY_KEY, PUBLIC
from headimpact_service.pages.problems import as_markdown

REPOSITORY = Path(__file__).parents[2]
EXAMPLES = REPOSITORY / "openapi" / "examples"
METHODS = {"get", "put", "post", "patch", "delete"}

# example -> (method, path, schema of the body, status)
SENT = {
    "score.json": ("POST", "/v1/score", 200),
    "score-with-traces.json": ("POST", "/v1/score", 200),
    "impact.json": ("POST", "/v1/impacts", 201),
    "impact-sensor.json": ("POST", "/v1/impacts", 201),
    "athlete.json": ("POST", "/v1/athletes", 201),
    "device.json": ("PUT", "/v1/devices/mg-0042", 201),
    "settings.json": ("PATCH", "/v1/settings", 200),
    "key.json": ("POST", "/v1/keys", 201),
}
FILES = {"import.csv", "import.ndjson", "mapping.json", "new-score.json"}
"""Examples that go with another request; below."""


def example(name: str) -> Any:
    return json.loads((EXAMPLES / name).read_text("utf-8"))


class TestGenerated:
    def test_the_committed_document_is_the_code_s(self) -> None:
        committed = (REPOSITORY / "openapi" / "openapi.json").read_text("utf-8")
        assert committed == as_text(document()), "run `headimpact openapi`"

    def test_the_committed_list_of_problems_is_the_code_s(self) -> None:
        committed = (REPOSITORY / "docs" / "problems.md").read_text("utf-8")
        assert committed == as_markdown(), "run `headimpact openapi`"

    def test_the_service_serves_the_committed_document(self, api: Api) -> None:
        assert api.get("/openapi.json", key=None).json() == document()

    def test_the_examples_are_those_that_their_script_makes(self) -> None:
        made = runpy.run_path(str(REPOSITORY / "openapi" / "make_examples.py"))["files"]()
        assert {path.name: path.read_text("utf-8") for path in EXAMPLES.iterdir()} == made


class TestDocument:
    def test_every_schema_is_valid_and_every_reference_leads_somewhere(self) -> None:
        resource = Resource.from_contents(document(), default_specification=DRAFT202012)
        resolver = Registry().with_resource(DOCUMENT, resource).resolver(DOCUMENT)
        for schema in document()["components"]["schemas"].values():
            Draft202012Validator.check_schema(schema)
        references = re.findall(r'"\$ref": "([^"]+)"', json.dumps(document()))
        assert references
        for reference in set(references):
            resolver.lookup(reference)

    def test_operations_have_names_of_their_own(self) -> None:
        names = [operation["operationId"] for path in document()["paths"].values() for operation in path.values()]
        assert len(names) == len(set(names))

    def test_every_parameter_in_a_path_is_declared(self) -> None:
        for path, operations in document()["paths"].items():
            assert set(operations) <= METHODS
            for operation in operations.values():
                declared = {p["name"] for p in operation.get("parameters", []) if p["in"] == "path"}
                assert declared == set(re.findall(r"{(\w+)}", path))

    def test_every_operation_says_its_scope(self) -> None:
        for operation in OPERATIONS:
            if operation.documented:
                described = document()["paths"][operation.path.replace(":path", "")][operation.method.lower()]
                assert bool(described["security"]) == (operation.access != PUBLIC)
                if operation.access not in {PUBLIC, ANY_KEY}:
                    assert operation.access in SCOPES
                    assert f"Scope: `{operation.access}`" in described["description"]

    def test_every_problem_type_is_an_answer_of_some_operation(self) -> None:
        described = json.dumps(document()["paths"])
        undescribed = {slug for slug in PROBLEMS if f"`{slug}`" not in described}
        # 405 answers what no operation is there for; the others say what became of a job.
        assert undescribed <= {"method-not-allowed", "idempotency-conflict", "job-cancelled", "job-crashed"}


class TestExamples:
    def test_every_example_is_sent_by_a_test(self) -> None:
        assert {path.name for path in EXAMPLES.iterdir()} == set(SENT) | FILES

    @pytest.mark.parametrize("name", SENT)
    def test_it_is_taken_without_a_warning(self, api: Api, name: str) -> None:
        method, path, status = SENT[name]
        answer = api.send(method, path, json=example(name))
        assert answer.status_code == status, answer.text
        score = answer.json() if name.startswith("score") else answer.json().get("score")
        if score is not None:
            assert [note for note in score["quality"] if note["severity"] == "warning"] == []

    @pytest.mark.parametrize("name", SENT)
    def test_it_fits_its_schema(self, name: str) -> None:
        method, path, _ = SENT[name]
        path = path.replace("mg-0042", "{serial}")
        body = document()["paths"][path][method.lower()]["requestBody"]["content"]["application/json"]["schema"]
        resource = Resource.from_contents(document(), default_specification=DRAFT202012)
        registry = Registry().with_resource(DOCUMENT, resource)
        Draft202012Validator({"$ref": DOCUMENT + body["$ref"]}, registry=registry).validate(example(name))

    def test_a_new_score_is_made_of_a_stored_impact(self, api: Api) -> None:
        impact = api.post("/v1/impacts", json=example("impact.json")).json()
        answer = api.post(f"/v1/impacts/{impact['id']}/scores", json=example("new-score.json"))
        assert answer.status_code == 201
        assert answer.json()["extra_criteria"]["ubric_mps"]["value"] > 0

    def test_the_table_is_imported_by_its_mapping(self, api: Api) -> None:
        fields = {"mapping": json.dumps(example("mapping.json")), "athlete": "p-17"}
        answer = api.post(
            "/v1/imports", files={"file": ("import.csv", (EXAMPLES / "import.csv").read_bytes())}, data=fields
        )
        assert answer.json()["summary"] == {"created": 1, "unchanged": 0, "failed": 0}

    def test_the_lines_are_imported_as_they_are(self, api: Api) -> None:
        lines = (EXAMPLES / "import.ndjson").read_bytes()
        answer = api.post("/v1/imports", content=lines, headers={"Content-Type": "application/x-ndjson"})
        assert answer.json()["summary"] == {"created": 3, "unchanged": 0, "failed": 0}
