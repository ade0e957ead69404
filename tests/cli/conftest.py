"""The command as a user runs it, in this process; a model of two joints."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from lptn.cli.main import main
from tests.diagnose.pair_runs import MODEL

Lptn = Callable[..., tuple[int, str, str]]


@pytest.fixture
def lptn(capsys: pytest.CaptureFixture[str]) -> Lptn:
    """Runs `lptn` with words; returns exit status, standard output, error output."""

    def run(*words: object) -> tuple[int, str, str]:
        with pytest.raises(SystemExit) as stop:
            main([str(word) for word in words])
        seen = capsys.readouterr()
        return int(stop.value.code or 0), seen.out, seen.err

    return run


@pytest.fixture
def model(tmp_path: Path) -> Path:
    """A model of two joints."""
    path = tmp_path / "model.toml"
    path.write_text(MODEL)
    return path
