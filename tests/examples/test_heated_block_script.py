"""The heated block's script, in its fast mode, as a user runs it."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

SCRIPT = Path(__file__).parents[2] / "examples" / "heated_block" / "heated_block.py"


@pytest.mark.long
def test_the_script_prints_its_tables_and_draws(tmp_path: Path) -> None:
    words = [sys.executable, "-W", "error", str(SCRIPT), "--fast", "--figures", str(tmp_path / "figures")]
    done = subprocess.run(words, capture_output=True, text=True, check=True, env=os.environ | {"MPLBACKEND": "Agg"})
    lines = done.stdout.splitlines()
    row = next(line for line in lines if line.startswith("plain T-network"))
    assert "+12.5000  +12.5000    +16.6667     +10.5000" in row
    assert lines[-1].split() == ["38.333333", "38.333333"]
    assert all((tmp_path / "figures" / f"{name}.png").stat().st_size > 10_000 for name in ("steady", "transient"))
