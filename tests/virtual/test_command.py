"""Check the command ``python -m lptn.virtual``."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pandas as pd
import pytest

from lptn.virtual import Hidden, leg_logs
from lptn.virtual.__main__ import main


def test_command_writes_what_the_function_makes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = "leg --hidden forced_convection --at FR_thigh --size 1"
    text += " --hidden conduction --at FR_calf~FR_hip --size 0.5 --seed 3 --noise 0.1 --quantisation 1 --rate 1"
    assert main([*text.split(), "-o", str(tmp_path)]) == 0
    hidden = [Hidden("forced_convection", "FR_thigh"), Hidden("conduction", "FR_calf~FR_hip", 0.5)]
    logs = leg_logs(hidden, seed=3, noise=0.1, quantisation=1, rate=1)
    assert capsys.readouterr().out.split() == [str(tmp_path / f"{name}.parquet") for name in logs]
    for name, log in logs.items():
        pd.testing.assert_frame_equal(pd.read_parquet(tmp_path / f"{name}.parquet"), log)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ("--hidden gremlins --at FR_hip", "effect: found 'gremlins'; expected one of"),
        ("--hidden radiation --at FL_hip", "place of radiation: found 'FL_hip'; expected one of FR_hip"),
        ("--hidden radiation", "--at: found 0; expected one for each --hidden, so 1"),
        ("--hidden radiation --at * --size 1 --size 2", "--size: found 2; expected none or one"),
        ("--seed -4", "seed: found -4"),
    ],
)
def test_mistake_is_said_in_one_line(
    options: str, message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["leg", *options.split(), "-o", str(tmp_path / "new")]) == 2
    said = capsys.readouterr()
    assert message in said.err
    assert said.err.count("\n") == 1
    assert not said.out
    assert not (tmp_path / "new").exists()


@pytest.mark.parametrize("options", ["leg", "arm -o x", "", "leg -o x --seed many", "leg -o x --frobnicate"])
def test_unreadable_options_are_said_in_one_line(options: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stop:
        main(options.split())
    assert stop.value.code == 2
    assert capsys.readouterr().err.count("\n") == 1


def test_folder_that_cannot_be_made(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "taken").write_text("a file")
    assert main(["leg", "-o", str(tmp_path / "taken")]) == 2
    assert capsys.readouterr().err.count("\n") == 1


def test_module_runs() -> None:
    done = subprocess.run([sys.executable, "-m", "lptn.virtual", "leg"], capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert "-o/--output" in done.stderr
    assert done.stderr.count("\n") == 1
