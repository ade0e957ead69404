"""A newcomer's first minutes (slow): what the front page tells to type. The tutorials are run by `.ci/docs`."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

import pytest

import lptn
from tests.docs.pages import ROOT, Page

_SERVES = "lptn open"  # until Ctrl-C; `tests/workbench` opens it


FRONT = Page("README.md", (ROOT / "README.md").read_text(encoding="utf-8"))


def commands() -> list[str]:
    """What the front page tells to type, in its order; what installs, and the tests themselves, are running already."""
    lines = [line for block in FRONT.blocks("") for line in block.splitlines()]
    return [line for line in lines if line.startswith("lptn ") and not line.startswith(_SERVES)]


def test_the_front_page_has_its_commands() -> None:
    assert commands()


@pytest.mark.long
def test_the_front_page_shows_what_its_command_prints() -> None:
    """Word for word, but for lines that are broken, and an end that is left out."""
    (shown,) = (block for block in FRONT.blocks("") if block.startswith("Verdict: "))
    tclab = ROOT / "examples" / "tclab"
    study = lptn.Study(tclab / "two_heaters.toml", fit=tclab / "log.csv", holdout_after=300)
    printed = " ".join(map(str, study.improve().narrative()))
    assert printed.startswith(" ".join(shown.split()).removesuffix("…"))


@pytest.mark.slow
def test_every_command_of_the_front_page_works(tmp_path: Path) -> None:
    shutil.copytree(ROOT / "examples", tmp_path / "examples", ignore=shutil.ignore_patterns("__pycache__"))
    surroundings = os.environ | {"PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"}
    for command in commands():
        began = time.monotonic()
        done = subprocess.run(
            ["bash", "-c", command], cwd=tmp_path, env=surroundings, capture_output=True, text=True, check=False
        )
        print(f"{time.monotonic() - began:5.0f} s  {command}")
        assert done.returncode == 0, f"{command}\n{done.stdout}{done.stderr}"
        assert not done.stderr, f"{command}\n{done.stderr}"
    made = {path.name for path in tmp_path.iterdir()}
    assert {"better.toml", "story.html"} <= made
