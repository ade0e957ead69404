"""Commands killed in the middle leave whole files, and run again; `python -m tests.hardening.kill` kills more often."""

from __future__ import annotations

from pathlib import Path
from random import Random

import pytest

from tests.hardening.kill import COMMANDS, prepare, trial


def _killed(name: str, kills: int, folder: Path) -> None:
    prepare(folder, name)
    tally = trial(name, kills, Random(1), folder)
    assert tally.wrong == []
    assert tally.kills == kills
    assert tally.ended_before < kills


@pytest.mark.slow
def test_logs_of_a_virtual_robot_that_was_killed_are_whole(tmp_path: Path) -> None:
    _killed("virtual", 2, tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("name", COMMANDS)
def test_what_was_killed_leaves_whole_files_and_runs_again(name: str, tmp_path: Path) -> None:
    _killed(name, 8, tmp_path)
