"""Progress: quiet at first, then elapsed time, and what is left where a total is known; a line a minute when piped."""

from __future__ import annotations

import io

import pytest
from rich.console import Console

from lptn.basics.progress import ProgressLine, duration
from lptn.cli import terminal
from lptn.cli.terminal import ProgressOfALongJob


class Clock:
    """A clock that the test turns."""

    now = 0.0

    def __call__(self) -> float:
        return self.now


def test_time_is_said_from_two_seconds_on() -> None:
    clock = Clock()
    line = ProgressLine("fitting [K]", clock)
    assert line.__rich__() == r"fitting \[K]"
    clock.now = 75.0
    assert line.__rich__() == r"fitting \[K] (1 min 15 s)"


def test_a_count_tells_what_is_left() -> None:
    clock = Clock()
    line = ProgressLine("reading", clock)
    clock.now = 10.0
    line.say("log 1 of 5")
    assert line.__rich__() == "log 1 of 5 (10 s)"  # nothing is done yet
    clock.now = 18.0
    line.say("log 3 of 5")  # two in 8 s, and three to go
    assert line.__rich__() == "log 3 of 5 (18 s, about 12 s left)"
    line.say("drawing")
    assert line.__rich__() == "drawing (18 s)"


def test_a_long_job_that_nobody_watches_says_a_line_a_minute(capsys: pytest.CaptureFixture[str]) -> None:
    clock = Clock()
    line = ProgressOfALongJob("reading", clock)
    for clock.now, message in ((59.0, "fitting"), (70.0, "step 1: fan at [a]"), (129.0, "step 2"), (200.0, "step 3")):
        line.say(message)
    assert capsys.readouterr().err.splitlines() == [
        "lptn: step 1: fan at [a] (1 min 10 s)",
        "lptn: step 3 (3 min 20 s)",
    ]


def test_durations() -> None:
    assert [duration(seconds) for seconds in (0.4, 59.6, 3600.0, 7800.0)] == [
        "0 s",
        "1 min 0 s",
        "1 h 0 min",
        "2 h 10 min",
    ]


def test_nothing_is_said_into_a_pipe_before_that(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for watched in (True, False):
        written = io.StringIO()
        monkeypatch.setattr(terminal, "err", Console(file=written, force_terminal=watched, width=80))
        with terminal.progress("fitting") as report:
            report("log 1 of 2")
        assert ("log 1 of 2" in written.getvalue()) == watched
    assert not capsys.readouterr().err
