"""The package's public names: complete, documented, and light to import."""

from __future__ import annotations

import ast
import importlib
import inspect
import pkgutil
import re
import subprocess
import sys
from pathlib import Path

import pytest

import headimpact

PACKAGE = Path(headimpact.__file__).parent


def modules() -> list[str]:
    return [m.name for m in pkgutil.walk_packages(headimpact.__path__, "headimpact.")]


def definitions() -> list[tuple[str, ast.AST]]:
    """Public functions and classes of every module, and the public functions of public classes."""
    found = []
    for path in sorted(PACKAGE.rglob("*.py")):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        for node in tree.body:
            if isinstance(node, ast.FunctionDef | ast.ClassDef) and not node.name.startswith("_"):
                name = f"{path.relative_to(PACKAGE)}::{node.name}"
                found.append((name, node))
                members = node.body if isinstance(node, ast.ClassDef) else []
                found += [
                    (f"{name}.{member.name}", member)
                    for member in members
                    if isinstance(member, ast.FunctionDef) and not member.name.startswith("_")
                ]
    return found


def test_all_is_sorted_and_every_name_in_it_can_be_had():
    assert len(set(headimpact.__all__)) == len(headimpact.__all__)
    assert dir(headimpact) == sorted(headimpact.__all__)
    for name in headimpact.__all__:
        assert getattr(headimpact, name) is not None


def test_the_names_for_type_checkers_are_those_that_are_found_at_run_time():
    tree = ast.parse((PACKAGE / "__init__.py").read_text(encoding="utf-8"))
    (block,) = [node for node in tree.body if isinstance(node, ast.If)]
    typed = {
        alias.name: statement.module.removeprefix("headimpact.")
        for statement in block.body
        for alias in statement.names
    }
    assert typed == headimpact._HOME
    assert set(typed) == set(headimpact.__all__)


@pytest.mark.parametrize("name", headimpact.__all__)
def test_every_public_name_is_the_one_its_module_holds(name):
    module = importlib.import_module(f"headimpact.{headimpact._HOME[name]}")
    value = getattr(module, name)
    assert getattr(headimpact, name) is value
    if inspect.isclass(value) or inspect.isfunction(value):
        assert value.__module__ == module.__name__  # defined there, not passed through
        assert value.__doc__


RESULTS = ("Preparation", "ImpactScore", "CriterionScore", "OperatingPoint", "CriticalValue", "RiskModel", "Criterion")


@pytest.mark.parametrize("name", RESULTS)
def test_what_a_result_is_made_of_is_public_too(name):
    # so that whoever reads it can name the classes of its parts
    words = set(re.findall(r"[A-Z]\w+", " ".join(map(str, getattr(headimpact, name).__annotations__.values()))))
    own = words - {"None", "Mapping", "Components", "Family", "ForwardRef", "Literal", "Any"}
    assert own <= set(headimpact.__all__)


def test_every_error_that_is_raised_on_purpose_is_public():
    from headimpact import errors

    raised = {name for name, value in vars(errors).items() if inspect.isclass(value)}
    assert raised <= set(headimpact.__all__)
    assert all(issubclass(getattr(headimpact, name), headimpact.HeadimpactError) for name in raised)


def test_a_name_that_does_not_exist_is_an_attribute_error():
    with pytest.raises(AttributeError, match="brian_angle"):
        _ = headimpact.brian_angle


@pytest.mark.parametrize(("name", "node"), definitions(), ids=[name for name, _ in definitions()])
def test_every_public_function_and_class_has_a_docstring(name, node):
    assert ast.get_docstring(node)


@pytest.mark.parametrize("name", modules())
def test_every_module_says_what_it_is(name):
    assert importlib.import_module(name).__doc__


def loaded_by(code: str) -> set[str]:
    """Top-level and second-level modules that a fresh interpreter holds after running `code`."""
    script = f"import sys\n{code}\nprint(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    return set(done.stdout.split())


def test_importing_the_package_loads_neither_numpy_nor_scipy():
    assert not loaded_by("import headimpact") & {"numpy", "scipy", "headimpact.scoring"}


def test_an_error_class_can_be_had_without_scipy():
    assert "scipy" not in loaded_by("from headimpact import TraceError")


def test_scoring_loads_no_statistics_package_no_database_and_no_web_framework():
    unwanted = {
        "scipy.signal",
        "scipy.stats",
        "statsmodels",
        "pandas",
        "matplotlib",
        "sqlalchemy",
        "fastapi",
        "starlette",
        "pydantic",
    }
    assert not loaded_by("from headimpact import *") & unwanted
