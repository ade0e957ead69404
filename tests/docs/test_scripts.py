"""The examples' scripts run as they stand, and as notebooks."""

from __future__ import annotations

import ast
import runpy
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.docs.pages import ROOT

EXAMPLES = ROOT / "examples"
NOTEBOOKS = ("leg/whole_leg", "tclab/step_by_step", "tclab/history_picture")


@pytest.mark.long
def test_a_whole_leg_from_logs_to_forecast(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "argv", ["whole_leg.py", "--fast"])
    runpy.run_path(str(EXAMPLES / "leg" / "whole_leg.py"))
    said = capsys.readouterr().out
    assert "verdict: missing" in said
    first = said[said.index("verdict") :].splitlines()[1]
    assert first.startswith("  forced_convection at FR_thigh: ")
    assert "nothing is missing any more" in said
    assert said.rstrip().splitlines()[-1].startswith("FR_calf: in ")


@pytest.mark.slow
def test_the_picture_of_the_front_page(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    drawn = tmp_path / "history.png"
    monkeypatch.setattr(sys, "argv", ["history_picture.py", str(drawn)])
    runpy.run_path(str(EXAMPLES / "tclab" / "history_picture.py"))
    assert 10_000 < drawn.stat().st_size < 60_000


@pytest.mark.parametrize("name", NOTEBOOKS)
def test_a_script_is_made_of_cells_that_know_no_file(name: str) -> None:
    text = (EXAMPLES / f"{name}.py").read_text()
    assert text.startswith("# %% [markdown]\n# # ")
    assert text.count("\n# %%") >= 2
    ast.parse(text)
    # A notebook has no `__file__`.
    assert all('"__file__" in globals()' in line for line in text.splitlines() if "__file__" in line)


@pytest.mark.slow
@pytest.mark.parametrize("name", NOTEBOOKS)
def test_a_script_runs_as_a_notebook(name: str, tmp_path: Path) -> None:
    pytest.importorskip("jupytext")
    pytest.importorskip("nbmake")
    for path in (EXAMPLES / name).parent.iterdir():
        if path.is_file():
            shutil.copy(path, tmp_path)
    script = tmp_path / f"{Path(name).name}.py"
    for words in (
        ["-m", "jupytext", "--to", "notebook", str(script)],
        ["-m", "pytest", "-n", "0", "-p", "no:cacheprovider", "--nbmake", str(script.with_suffix(".ipynb"))],
    ):
        done = subprocess.run([sys.executable, *words], cwd=tmp_path, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stdout + done.stderr
