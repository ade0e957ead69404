"""Check the files and the command that makes them: all formats, nothing left behind."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from lptn.virtual import (
    Bout,
    Hidden,
    Job,
    leg_logs,
    quadruped_logs,
    write_logs,
)
from lptn.virtual.__main__ import main

RUNS = {"mix": Job((Bout("trot", 500, 0.5), Bout("rest", 200)))}


def test_files_hold_what_the_function_makes(tmp_path: Path) -> None:
    log = quadruped_logs(seed=1, runs=RUNS, rate=100, dropouts=0.05)["mix"]
    files = write_logs(tmp_path / "new", {"mix": log})
    assert files == [tmp_path / "new" / "mix.parquet"] == list((tmp_path / "new").iterdir())
    assert len(log) == 70000
    pd.testing.assert_frame_equal(pd.read_parquet(files[0]), log, check_exact=True)


def test_csv_holds_the_log(tmp_path: Path) -> None:
    table = pd.DataFrame({"time": np.arange(6.0), "temperature.pc": [20.5, np.nan, 21, 22, 23, 24]})
    (file,) = write_logs(tmp_path, {"log": table}, "csv")
    pd.testing.assert_frame_equal(pd.read_csv(file), table, check_dtype=False)


def test_broken_off_log_leaves_no_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def broken_off(_table: pd.DataFrame, file: Path, **_options: object) -> None:
        file.write_text("half")
        raise OSError("no room")

    monkeypatch.setattr(pd.DataFrame, "to_parquet", broken_off)
    with pytest.raises(OSError, match="no room"):
        write_logs(tmp_path / "new", {"log": pd.DataFrame({"time": [0.0]})})
    assert not list((tmp_path / "new").iterdir())


def test_files_that_stand_there_are_replaced(tmp_path: Path) -> None:
    for value in (1.0, 2.0):
        (file,) = write_logs(tmp_path, {"log": pd.DataFrame({"time": [value]})})
    assert pd.read_parquet(file)["time"].tolist() == [2.0]


def test_command_writes_what_the_quadruped_s_function_makes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = "quadruped --runs tests --physics plain --hidden sensor_lag --at *_calf --size 0.5"
    text += " --hidden conduction --at FL_calf~FR_calf --size 1 --seed 3 --quantisation 0.5 --truth"
    assert main([*text.split(), "-o", str(tmp_path)]) == 0
    hidden = [("sensor_lag", "*_calf", 0.5), ("conduction", "FL_calf~FR_calf", 1.0)]
    logs = quadruped_logs(hidden, seed=3, runs="tests", physics="plain", quantisation=0.5)
    assert capsys.readouterr().out.split() == [str(tmp_path / f"{name}.parquet") for name in logs]
    for name, log in logs.items():
        pd.testing.assert_frame_equal(pd.read_parquet(tmp_path / f"{name}.parquet"), log)
        pd.testing.assert_frame_equal(pd.read_parquet(tmp_path / "truth" / f"{name}.parquet"), logs.truth[name])


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ("--hidden iron_loss --at pc", "place of iron_loss: found 'pc'; expected one of FR_hip"),
        ("--rate 10", "rate: found 10; expected one of 1, 100 Hz"),
        ("--seed -4", "seed: found -4"),
        ("--scatter 9", "scatter: found 9; expected 0 to 2"),
    ],
)
def test_mistake_of_the_quadruped_is_said_in_one_line(
    options: str, message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["quadruped", *options.split(), "-o", str(tmp_path / "new")]) == 2
    said = capsys.readouterr()
    assert message in said.err
    assert said.err.count("\n") == 1
    assert not (tmp_path / "new").exists()


def test_unknown_format_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="format: found 'xls'; expected one of parquet, csv"):
        write_logs(tmp_path / "new", {}, "xls")  # type: ignore[arg-type]
    assert not (tmp_path / "new").exists()


# --- the command ``python -m lptn.virtual`` ------------------------------------------------------------------------


@pytest.mark.long
def test_command_writes_what_the_leg_s_function_makes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
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
def test_mistake_of_the_leg_is_said_in_one_line(
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


@pytest.mark.long
def test_module_runs() -> None:
    done = subprocess.run([sys.executable, "-m", "lptn.virtual", "leg"], capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert "-o/--output" in done.stderr
    assert done.stderr.count("\n") == 1


@pytest.mark.long
def test_command_takes_runs(tmp_path: object, capsys: pytest.CaptureFixture[str]) -> None:
    text = "leg --hidden surface_scale --at * --run fit2 --hidden radiation --at FR_calf --run * --rate 1 --columns all"
    assert main([*text.split(), "-o", str(tmp_path)]) == 0
    hidden = [Hidden("surface_scale", "*", run="fit2"), Hidden("radiation", "FR_calf")]
    expected = leg_logs(hidden, seed=0, rate=1, columns="all")
    for name, log in expected.items():
        pd.testing.assert_frame_equal(pd.read_parquet(f"{tmp_path}/{name}.parquet"), log)
    capsys.readouterr()
    assert main(["leg", "--hidden", "solar", "--at", "*", "--run", "fit1", "-o", str(tmp_path)]) == 2
    assert capsys.readouterr().err.count("\n") == 1
