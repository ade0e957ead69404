"""The controller in a leg's loop and between ROS 2 messages, as a user runs the scripts."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from lptn.basics.c_library import compiler

SCRIPTS = Path(__file__).parents[2] / "examples" / "robot_loop"
pytestmark = [pytest.mark.long, pytest.mark.skipif(compiler() is None, reason="no C compiler")]


def said(folder: Path, script: str, *words: str) -> list[str]:
    """What a script prints."""
    command = [sys.executable, "-W", "error", str(SCRIPTS / script), *words]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines()


def test_a_leg_without_simulator_keeps_its_limit(tmp_path: Path) -> None:
    without, controlled, sensor, *_ = said(tmp_path, "leg_in_loop.py", "--plain", "--duration", "140")
    assert float(without.split("motor ")[1].split()[0]) > 61
    assert float(controlled.split("motor ")[1].split()[0]) < 60
    assert sensor.startswith("FR_calf has read ")
    assert (tmp_path / "controller" / "lptn_loop.c").is_file()


@pytest.mark.filterwarnings("ignore")
def test_commands_of_a_bag_are_limited(tmp_path: Path) -> None:
    pytest.importorskip("rosbags")
    scales, *given_up = said(tmp_path, "ros2_loop.py")
    least = [float(word) for word in scales.replace(",", "").split()[3::2]]
    assert least[2] < least[1] < least[0] <= 1
    assert least[2] < 0.5
    assert any(line.startswith("FR_calf has read ") for line in given_up)
    assert any((tmp_path / "limited").iterdir())
