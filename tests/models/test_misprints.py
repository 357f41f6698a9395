"""The ledger of misprints names tests that exist, and names one for each entry that a number depends on."""

from __future__ import annotations

import ast
import re
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
LEDGER = (ROOT / "docs" / "misprints.md").read_text(encoding="utf-8")
NAMED = sorted(set(re.findall(r"`(tests/[\w/]+\.py)::(\w+)`", LEDGER)))
ENTRIES = dict(re.findall(r"^## (\d+)\. .*?\n(.*?)(?=^## )", LEDGER, re.MULTILINE | re.DOTALL))
# No number depends on these: a description, a sentence, a threshold that nothing uses yet.
WITHOUT_TEST = {"6", "8", "12"}


@pytest.mark.parametrize(("path", "name"), NAMED, ids=[name for _, name in NAMED])
def test_every_test_that_the_ledger_names_exists(path, name):
    tree = ast.parse((ROOT / path).read_text(encoding="utf-8"))
    assert name in {node.name for node in tree.body if isinstance(node, ast.FunctionDef)}


def test_the_ledger_has_the_twelve_misprints_each_with_what_is_printed_and_what_is_used():
    assert list(ENTRIES) == [str(n) for n in range(1, 13)]
    for text in ENTRIES.values():
        assert "**Printed:**" in text
        assert "**Used:**" in text


@pytest.mark.parametrize("number", ENTRIES)
def test_an_entry_that_a_number_depends_on_names_the_test_that_settles_it(number):
    assert ("**Settled by:**" in ENTRIES[number]) == (number not in WITHOUT_TEST)


def test_data_files_and_code_point_only_at_misprints_that_are_there():
    for path in (ROOT / "models").rglob("*"):
        if path.suffix in (".py", ".toml"):
            for number in re.findall(r"misprints?(?:\.md)?,? (\d+)", path.read_text(encoding="utf-8")):
                assert number in ENTRIES, path


def test_the_provenance_page_has_every_data_file_and_every_table_in_it():
    folder = ROOT / "models" / "headimpact" / "data"
    page = (folder / "README.md").read_text(encoding="utf-8")
    for path in folder.glob("*.toml"):
        assert f"`{path.name}`" in page
    for name in ("criteria", "extra_criteria"):
        for table in tomllib.loads((folder / f"{name}.toml").read_text(encoding="utf-8")):
            assert f"`[{table}]`" in page or (table.startswith("rwe_") and "`[rwe_...]`" in page), table


def test_every_data_file_says_where_its_numbers_come_from_before_the_first_of_them():
    for path in (ROOT / "models" / "headimpact" / "data").glob("*.toml"):
        assert path.read_text(encoding="utf-8").startswith("# ")
