"""A fresh installation by the container file's own steps: outside the repository, in an empty folder."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import venv
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from urllib.request import urlopen

import pytest
from documents import ROOT
from test_container_image import BUILD, of

pytestmark = pytest.mark.campaign


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The commands of an environment that holds the locked dependencies and the wheel, and nothing else."""
    folder = tmp_path_factory.mktemp("image")
    builder = folder / "builder"
    venv.create(builder, with_pip=True)
    for name in {source for line in of(BUILD, "COPY") for source in line.split()[:-1]}:
        copy = shutil.copytree if (ROOT / name).is_dir() else shutil.copy
        copy(ROOT / name, folder / name)
    path = f"{builder / 'bin'}{os.pathsep}{os.environ['PATH']}"
    for line in of(BUILD, "RUN"):
        moved = line.replace("/opt/headimpact", str(folder / "headimpact")).replace("/build", str(folder))
        subprocess.run(["sh", "-euc", moved], cwd=folder, env=os.environ | {"PATH": path}, check=True)
    return folder / "headimpact" / "bin"


@contextmanager
def serving(commands: Path, folder: Path) -> Iterator[tuple[str, list[str]]]:
    """A service that runs in a folder; its address, and what it printed until it listened."""
    command = [str(commands / "headimpact"), "serve", "--port", "0"]
    clean = {name: value for name, value in os.environ.items() if not name.startswith(("HEADIMPACT_", "PYTHON"))}
    with subprocess.Popen(command, cwd=folder, env=clean, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        printed: list[str] = []
        for line in process.stdout:
            printed.append(line.rstrip("\n"))
            found = re.match(r"Listening on (http://\S+)", line)
            if found is not None:
                yield found[1], printed
                break
        process.terminate()


def test_the_wheel_serves_from_an_empty_folder_and_the_call_it_prints_works(installed: Path, tmp_path: Path) -> None:
    with serving(installed, tmp_path) as (address, printed):
        with urlopen(f"{address}/readyz") as answer:
            assert json.load(answer)["status"] == "ok"
        start = next(number for number, line in enumerate(printed) if line.startswith("curl "))
        call = "\n".join(printed[start : printed.index("", start)])
        answered = subprocess.run(["sh", "-c", call], capture_output=True, check=True, text=True).stdout
    assert json.loads(answered)["score"]["state"] == "scored"
    assert (tmp_path / "headimpact.db").is_file()


def test_the_environment_of_the_image_holds_no_installer_and_no_tool_of_development(installed: Path) -> None:
    listing = "import importlib.metadata as m; print(*sorted(d.name.lower() for d in m.distributions()))"
    command = [str(installed / "python"), "-c", listing]
    names = subprocess.run(command, capture_output=True, check=True, text=True).stdout.split()
    assert "headimpact" in names
    assert {"pip", "hatchling", "pytest", "ruff"}.isdisjoint(names)
