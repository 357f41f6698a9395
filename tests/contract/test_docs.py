"""The documents are held to the code: what they name exists, and what exists is named."""

from __future__ import annotations

import ast
import json
import re
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from documents import PAGES, ROOT, anchors, blocks, links, prose, section, spans, table, text, tracked
from sending import Api

from headimpact.criteria import CRITERIA
from headimpact.criteria.extra import EXTRA_CRITERIA
from headimpact.quality import CODES
from headimpact_service import __version__
from headimpact_service.__main__ import app
from headimpact_service.app import OPERATIONS
from headimpact_service.deps import SCOPES
from headimpact_service.settings import Settings
from headimpact_service.store.tables import metadata

PYPROJECT = tomllib.loads(text("pyproject.toml"))


def name_of(page: Path) -> str:
    return str(page.relative_to(ROOT))


# Links and commands


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_every_link_inside_a_page_leads_somewhere(page: Path) -> None:
    for target in links(page):
        path, _, anchor = target.partition("#")
        file = (page.parent / path).resolve() if path else page
        assert file.exists(), target
        assert not anchor or anchor in anchors(file), target


def test_every_page_of_docs_is_linked_from_another() -> None:
    linked = {(page.parent / target.partition("#")[0]).resolve() for page in PAGES for target in links(page)}
    assert [name_of(page) for page in PAGES if page.is_relative_to(ROOT / "docs") and page not in linked] == []


@pytest.mark.parametrize("command", ["pip install uv && uv run headimpact serve", "pip install uv && uv run pytest"])
def test_the_readme_has_each_of_its_two_commands_on_a_line_of_its_own(command: str) -> None:
    assert any(command in block.splitlines() for block in blocks("README.md"))


@pytest.mark.parametrize(
    "words", ["research use", "adult men", "not a diagnosis", "published", "interpolated", "fitted"]
)
def test_the_readme_states_the_limits(words: str) -> None:
    assert words in re.sub(r"\s+", " ", text("README.md"))


def test_ci_runs_the_readmes_test_command_as_it_is_written() -> None:
    assert "pip install uv && uv run pytest" in text(".ci/run")
    assert (ROOT / ".ci/run").stat().st_mode & 0o111


def test_the_readmes_call_sends_an_example_to_an_operation() -> None:
    (path,) = re.findall(r"http://127\.0\.0\.1:8000(\S+)", CALL)
    assert ("POST", path) in {(operation.method, operation.path) for operation in OPERATIONS}


def test_the_readmes_answer_is_the_one_that_the_service_gives(api: Api) -> None:
    (example,) = re.findall(r"--data @(\S+)", CALL)
    answer = api.post("/v1/score", json=json.loads(text(example))).json()
    assert_shortens(ANSWER, answer)


def assert_shortens(shown: Any, whole: Any) -> None:
    """`shown` is `whole` with some members left out, which an ellipsis says, and numbers of six digits."""
    match shown:
        case dict():
            assert (shown.keys() == whole.keys()) != ("…" in shown)
            for key in shown.keys() - {"…"}:
                assert_shortens(shown[key], whole[key])
        case [*_, "…"]:
            for part, other in zip(shown[:-1], whole, strict=False):
                assert_shortens(part, other)
        case list():
            assert len(shown) == len(whole)
            for part, other in zip(shown, whole, strict=True):
                assert_shortens(part, other)
        case float():
            assert f"{shown:.6g}" == f"{whole:.6g}"
        case _:
            assert shown == whole


CALL = next(block for block in blocks("README.md") if block.startswith("curl"))
ANSWER = json.loads(next(block for block in blocks("README.md") if block.startswith("{")))


# Names and units


def test_the_nomenclature_lists_every_criterion_in_order_with_its_values_unit_and_source() -> None:
    listed = [(*spans(key), int(n), unit, source) for key, n, unit, _, source in table(NOMENCLATURE, "## Criteria")]
    assert listed == [(c.key, c.components, c.unit, c.source) for c in CRITERIA]


def test_the_nomenclature_lists_every_extra_criterion_with_its_unit_and_source() -> None:
    listed = [(*spans(key), unit, source) for key, unit, _, source in table(NOMENCLATURE, "## Extra criteria")]
    assert listed == [(c.key, c.unit, c.source) for c in EXTRA_CRITERIA.values()]


NOMENCLATURE = "docs/nomenclature.md"


# Quality notes


def test_every_quality_code_of_the_code_has_a_meaning_and_a_remedy_and_no_other_has() -> None:
    listed = table("docs/quality.md", "# Quality notes")
    documented = {
        (code, word) for cell, severity, *_ in listed for word in severity.split(", ") for code in spans(cell)
    }
    assert documented == set(quality_notes())
    assert {code for code, _ in documented} == set(CODES)
    assert all(meaning and remedy for *_, meaning, remedy in listed)


def quality_notes() -> Iterator[tuple[str, str]]:
    """Code and severity of every note that the packages make, read from their source."""
    for root in ("models/headimpact", "service/headimpact_service"):
        for module in (ROOT / root).rglob("*.py"):
            nodes = list(ast.walk(ast.parse(module.read_text("utf-8"))))
            constants = dict(constant for node in nodes for constant in _constant(node))
            for node in nodes:
                yield from _note(node, constants)


def _constant(node: ast.AST) -> Iterator[tuple[str, str]]:
    match node:
        case ast.Assign(targets=[ast.Name(name)], value=ast.Constant(str(value))):
            yield name, value


def _note(node: ast.AST, constants: dict[str, str]) -> Iterator[tuple[str, str]]:
    match node:
        case ast.Call(func=ast.Name("QualityNote"), args=[ast.Constant(str(code)), ast.Constant(str(severity)), *_]):
            yield code, severity
        case ast.Call(func=ast.Name("_warning") | ast.Attribute(attr="_note"), args=[ast.Constant(str(code)), *_]):
            yield code, "warning"
        case ast.Dict(
            [ast.Constant("code"), ast.Constant("severity"), *_], [ast.Name(code), ast.Constant(str(word)), *_]
        ):
            yield constants[code], word


# Operations


def test_the_configuration_table_has_every_setting_with_its_default() -> None:
    listed = {
        spans(name)[0]: (spans(default) or ["None"])[0] for name, default, _ in table(OPERATING, "## Configuration")
    }
    prefix = str(Settings.model_config["env_prefix"])
    assert listed == {prefix + name.upper(): str(field.default) for name, field in Settings.model_fields.items()}


OPERATING = "docs/operations.md"


def test_the_scope_table_has_every_scope() -> None:
    assert sorted(scope for cell, _ in table(OPERATING, "## Keys") for scope in spans(cell)) == sorted(SCOPES)


def test_a_scope_that_is_said_to_open_nothing_opens_nothing() -> None:
    unused = next(spans(cell) for cell, purpose in table(OPERATING, "## Keys") if purpose.startswith("nothing yet"))
    assert set(unused) == set(SCOPES) - {operation.access for operation in OPERATIONS}


def test_every_table_that_holds_data_is_named() -> None:
    named = {name for cell, _ in table(OPERATING, "## What is stored, and how it is erased") for name in spans(cell)}
    assert named == set(metadata.tables)


def test_every_path_that_the_documents_name_is_an_operation() -> None:
    known = {(operation.method, re.sub(r"{\w+(:path)?}", "{}", operation.path)) for operation in OPERATIONS}
    named = {
        (page.name, method, re.sub(r"{\w+}", "{}", path))
        for page in PAGES
        for method, path in re.findall(r"`(GET|POST|PUT|PATCH|DELETE) (/[\w/{}]+)`", prose(page))
    }
    assert named
    assert {(method, path) for _, method, path in named} <= known


def test_every_command_that_the_documents_name_exists() -> None:
    known = {command.name or command.callback.__name__ for command in app.registered_commands if command.callback}
    known |= {str(group.name) for group in app.registered_groups}
    shown = [part for page in PAGES for part in [*spans(prose(page)), *blocks(name_of(page))]]
    named = {name for part in shown for name in re.findall(r"\bheadimpact ([a-z]+)\b", part)}
    assert {"serve", "keys", "score"} <= named <= known


# Versions and decisions


def test_the_changelog_has_a_heading_for_this_version_and_one_for_changes_of_values() -> None:
    assert __version__ == PYPROJECT["project"]["version"]
    assert re.search(rf"^## {re.escape(__version__)} - ", text("CHANGELOG.md"), flags=re.MULTILINE)
    assert "### Changes of a score's value" in text("CHANGELOG.md")


def test_decisions_are_numbered_without_a_gap_and_listed_by_their_titles() -> None:
    pages = sorted(ROOT.glob("docs/adr/0*.md"))
    assert [page.name[:4] for page in pages] == [f"{number:04}" for number in range(1, len(pages) + 1)]
    titles = [f"# {number} {title}" for number, title in DECISIONS]
    assert titles == [page.read_text("utf-8").splitlines()[0] for page in pages]


def test_the_first_decision_shows_the_order_of_imports_that_is_held() -> None:
    (shown,) = blocks("docs/adr/0001-two-source-roots.md")
    (contract,) = [c for c in PYPROJECT["tool"]["importlinter"]["contracts"] if c["type"] == "layers"]
    held = " -> ".join(contract["layers"]).replace("headimpact_service.", "")
    assert shown.split() == held.split()


def test_every_page_that_code_points_to_exists() -> None:
    for file in tracked():
        if file.suffix in {".py", ".toml", ".html"}:
            for page in re.findall(r"\bdocs/[\w/-]+\.md\b", file.read_text("utf-8")):
                assert (ROOT / page).is_file(), f"{name_of(file)} points to {page}"


DECISIONS = [
    (re.sub(r"\[(\d+)\].*", r"\1", number), title)
    for line in text("docs/adr/README.md").splitlines()
    if line.startswith("| [")
    for number, title in [[cell.strip() for cell in line.strip("|").split("|")]]
]


@pytest.mark.parametrize("page", sorted(ROOT.glob("docs/adr/0*.md")), ids=name_of)
def test_a_decision_says_what_was_decided_why_what_else_was_considered_and_what_follows(page: Path) -> None:
    for word in ("**Decided.**", "**Why.**", "**Considered.**", "**What follows.**"):
        assert word in page.read_text("utf-8")


def test_every_campaign_figure_has_a_date() -> None:
    for heading in re.findall(r"^## .+$", text("docs/campaigns.md"), flags=re.MULTILINE):
        assert re.search(r"\b20\d\d-\d\d-\d\d\b", section("docs/campaigns.md", heading)), heading


# What no file may hold


FORBIDDEN = [
    *(
        "pypi" + ".org",
        "python" + "hosted.org",
        "registry.npm" + "js.org",
        "docker" + ".io",
        "ghcr" + ".io",
        "quay" + ".io",
    ),
    *("deb.debian" + ".org", "/work" + "/main", "/work" + "/shared", "/root" + "/", "/opt" + "/pypi", "/tmp" + "/hi"),
]


def test_no_file_names_a_package_registry_or_a_machines_own_path() -> None:
    found = [
        f"{name_of(file)}: {words}" for file in tracked() for words in FORBIDDEN if words.encode() in file.read_bytes()
    ]
    assert found == []
