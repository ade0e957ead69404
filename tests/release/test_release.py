"""Releases: one version, bounds that say what they mean, and (slow) a wheel that works without the checkout."""

from __future__ import annotations

import subprocess
import sys
import tomllib
from importlib.metadata import version
from pathlib import Path

import pytest

import lptn

ROOT = Path(__file__).parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())


def test_the_version_is_said_in_one_place() -> None:
    said = PROJECT["project"]["version"]
    assert version("lptn") == lptn.__version__ == said
    assert f"## {said}" in (ROOT / "CHANGELOG.md").read_text()
    words = ["git", "grep", "-lF", f'"{said}"', "--", "*.py", "*.pyi", "*.toml", "*.j2", "*.c", "*.h"]
    files = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=False).stdout.split()
    assert set(files) <= {"pyproject.toml", "examples/own_effect/pyproject.toml"}


def test_each_package_and_its_files_are_in_the_wheel() -> None:
    setup = PROJECT["tool"]["setuptools"]
    places = {name: ROOT / place for name, place in setup["package-dir"].items()}
    places |= {name: places["lptn"].joinpath(*name.split(".")[1:]) for name in setup["packages"] if name not in places}
    assert all((place / "__init__.py").is_file() for place in places.values())
    on_disk = {path.parent for top in ("src/lptn", "fmu", "planners") for path in (ROOT / top).rglob("__init__.py")}
    assert {place.resolve() for place in places.values()} == {path.resolve() for path in on_disk}
    data = setup["package-data"]
    everywhere = data.get("*", [])  # setuptools' word for all packages
    carried = {
        path
        for name, place in places.items()
        for pattern in [*everywhere, *data.get(name, [])]
        for path in place.glob(pattern)
    }
    assert data.keys() - {"*"} <= places.keys()
    kinds = (".c", ".h", ".j2", ".css", ".pyi", ".typed", ".toml")
    tops = [places["lptn"], ROOT / "fmu", ROOT / "planners"]
    needed = {path for top in tops for path in top.rglob("*") if path.suffix in kinds or path.name == "py.typed"}
    assert not {path for path in needed if "reference" not in path.parts} - carried


def test_lowest_versions_are_read_from_the_project() -> None:
    project = PROJECT["project"]
    for part, wanted in {"base": project["dependencies"], "fmu": project["optional-dependencies"]["fmu"]}.items():
        words = [sys.executable, str(ROOT / ".ci" / "lowest.py"), str(ROOT / "pyproject.toml"), part]
        lines = subprocess.run(words, capture_output=True, text=True, check=True).stdout.split()
        assert len(lines) == len(wanted)
        assert all("==" in line for line in lines)


@pytest.mark.slow
@pytest.mark.parametrize("script", ["wheel", "bounds"])
def test_installed_without_the_checkout(script: str) -> None:
    done = subprocess.run([ROOT / ".ci" / script], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "all commands ran" in done.stdout
