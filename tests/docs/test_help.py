"""Help: every command says what it does and how it is typed, and what is typed so is understood."""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from lptn.cli.main import app, main

COMMANDS = [name for name in app if name not in ("--help", "-h", "--version")]
_EXAMPLE = re.compile(r"Example: lptn (.*?)(?:\n\s*\n|╭|$)", re.DOTALL)


def _help(command: str, capsys: pytest.CaptureFixture[str]) -> str:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("COLUMNS", "400")
        app([command, "--help"] if command else ["--help"], exit_on_error=False, result_action="return_value")
    return capsys.readouterr().out


@pytest.mark.parametrize("command", ["", *COMMANDS], ids=lambda name: name or "lptn")
def test_help_has_an_example_that_is_understood(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    said = _help(command, capsys)
    examples = _EXAMPLE.findall(said)
    assert examples
    assert not re.search(r"default: (None|False)?\]", said)  # what says nothing
    for example in examples:
        words = shlex.split(example)
        assert not command or words[0] == command
        app.parse_args(words, print_error=False, exit_on_error=False)


@pytest.mark.parametrize("command", COMMANDS)
def test_an_unknown_option_is_refused_in_one_line(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as left:
        main([command, "--nonsense", "3"])
    assert left.value.code == 2
    said = capsys.readouterr()
    assert not said.out
    assert len(said.err.splitlines()) == 1
    assert "nonsense" in said.err


def test_the_shell_completes_options(tmp_path: Path) -> None:
    result = _run(["--install-completion", "--shell", "bash"], tmp_path)
    assert result.returncode == 0
    script = tmp_path / ".local/share/bash-completion/completions/lptn"
    asked = f"source {script}; COMP_WORDS=(lptn fit --hold); COMP_CWORD=2; _lptn; echo ${{COMPREPLY[@]}}"
    options = subprocess.run(["bash", "-c", asked], capture_output=True, text=True, check=True).stdout.split()
    assert {"--holdout", "--holdout-after"} <= set(options)


def test_a_shell_that_is_not_known_is_said_in_one_line(tmp_path: Path) -> None:
    result = _run(["--install-completion"], tmp_path, SHELL="/bin/tcsh")
    assert result.returncode == 2
    assert result.stderr.startswith(
        "lptn: --install-completion: $SHELL: found 'tcsh'; expected --shell and one of bash,"
    )
    assert not list(tmp_path.iterdir())


def _run(words: list[str], home: Path, **variables: str) -> subprocess.CompletedProcess[str]:
    surroundings = os.environ | {"HOME": str(home)} | variables
    typed = [sys.executable, "-m", "lptn", *words]
    return subprocess.run(typed, env=surroundings, capture_output=True, text=True, check=False)
