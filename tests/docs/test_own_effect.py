"""The example of an effect in a package of its own: found by its entry point, held to the contract."""

from __future__ import annotations

import os
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from lptn.robots.presets import preset_text
from tests.docs.pages import ROOT

PACKAGE = ROOT / "examples" / "own_effect"


@pytest.fixture(scope="module")
def surroundings(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """The package as pip would install it: its modules, and a folder with its metadata, both on the path."""
    site = tmp_path_factory.mktemp("site")
    project = tomllib.loads((PACKAGE / "pyproject.toml").read_text())["project"]
    about = site / f"{project['name'].replace('-', '_')}-{project['version']}.dist-info"
    about.mkdir()
    (about / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {project['name']}\nVersion: {project['version']}\n")
    entries = project["entry-points"]["lptn.effects"]
    lines = ["[lptn.effects]", *(f"{name} = {where}" for name, where in entries.items())]
    (about / "entry_points.txt").write_text("\n".join(lines) + "\n")
    path = os.pathsep.join([str(site), str(PACKAGE / "src")])
    return os.environ | {"PYTHONPATH": path, "COLUMNS": "200"}


def _run(words: list[str], surroundings: dict[str, str], folder: Path) -> str:
    done = subprocess.run(
        [sys.executable, *words], env=surroundings, cwd=folder, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr + done.stdout
    return done.stdout


@pytest.mark.long
def test_it_is_in_the_catalogue_and_in_a_model_file(surroundings: dict[str, str], tmp_path: Path) -> None:
    assert "thermostat's setting" in _run(["-m", "lptn", "effects", "thermostat_fan"], surroundings, tmp_path)
    (tmp_path / "leg.toml").write_text(preset_text("leg"))
    words = ["add", "leg.toml", "thermostat_fan", "--at", "FR_calf", "-o", "next.toml"]
    _run(["-m", "lptn", *words], surroundings, tmp_path)
    assert 'kind = "thermostat_fan"' in (tmp_path / "next.toml").read_text()


@pytest.mark.long
def test_it_keeps_the_contract(surroundings: dict[str, str]) -> None:
    words = ["-m", "pytest", "-n", "0", "-q", "-p", "no:cacheprovider", "tests/effects/test_contract.py", "-k"]
    assert " passed" in _run([*words, "thermostat_fan"], surroundings, ROOT)
