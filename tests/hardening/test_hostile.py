"""The fast part of the hostile commands, and that their trial sees what is wrong."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from tests.hardening.hostile import Case, cases, good_files, wrong

LPTN = shutil.which("lptn") or "lptn"
EACH = 40  # a case of so many; all of them are a program of their own
CASES = cases()


@pytest.fixture(scope="module")
def good(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Good files."""
    folder = tmp_path_factory.mktemp("good")
    good_files(folder, LPTN)
    return folder


@pytest.mark.long
@pytest.mark.parametrize("case", CASES[::EACH], ids=lambda case: str(case)[:80])
def test_a_hostile_command_ends_by_itself_with_a_line(case: Case, good: Path, tmp_path: Path) -> None:
    assert wrong(case, good, tmp_path, LPTN) == ""


def test_there_are_eight_hundred_of_all_kinds() -> None:
    commands = {case.words.split()[0] for case in CASES}
    assert len(CASES) >= 800
    assert len({str(case) for case in CASES}) == len(CASES)
    assert {"check", "fit", "compare", "improve", "simulate", "report", "forecast", "monitor"} <= commands
    assert {"fmu", "cosim", "trade", "plan", "motor", "new", "effects", "add"} <= commands


@pytest.mark.parametrize(
    ("program", "said"),
    [
        ("echo 'Traceback (most recent call last)'; echo 'ValueError: x'; exit 1", "a traceback: ValueError: x"),
        ("exit 3", "exit status 3"),
        ("kill -SEGV $$", "exit status"),
        ("sleep 9", "no end within 0.5 s"),
        ("touch ../x", "files outside: a/b/x"),
        ("touch ../../../x", "files outside: x"),
        ("touch $TMPDIR/x", "files outside: tmp/x"),
        ("touch x $XDG_CACHE_HOME/x $XDG_STATE_HOME/x; exit 2", ""),
    ],
)
def test_what_is_wrong_is_seen(program: str, said: str, tmp_path: Path) -> None:
    script, desk = tmp_path / "lptn", tmp_path / "desk"
    script.write_text(f"#!/bin/sh\n{program}\n")
    script.chmod(0o700)
    desk.mkdir()
    what = wrong(Case("anything", "check"), desk, tmp_path, str(script), longest=0.5)
    assert what.startswith(said)
    assert bool(what) == bool(said)
