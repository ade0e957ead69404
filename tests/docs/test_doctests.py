"""Every name on the front door has an example, and it prints what it says."""

from __future__ import annotations

import doctest
from pathlib import Path

import matplotlib as mpl
import pytest

import lptn
from tests.docs.pages import ROOT

LONG = {"Study", "improve"}
names = pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[pytest.mark.long] if name in LONG else []) for name in lptn.__all__]
)


@pytest.mark.long
@names
def test_the_example_runs_as_printed(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "examples").symlink_to(ROOT / "examples")  # what an example writes goes elsewhere
    monkeypatch.chdir(tmp_path)
    mpl.use("agg")
    finder = doctest.DocTestFinder(recurse=False)
    (example,) = finder.find(getattr(lptn, name), name, module=False)
    assert example.examples, f"{name} has no example"
    said: list[str] = []
    runner = doctest.DocTestRunner(optionflags=doctest.NORMALIZE_WHITESPACE)
    runner.run(example, out=said.append)
    assert not runner.failures, "".join(said)
