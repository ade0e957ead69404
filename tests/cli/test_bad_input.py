"""Bad input: one line that says file, place, found and expected; exit status 2; nothing written."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from lptn.cli.main import main
from lptn.robots.presets import presets

TIME = np.arange(0.0, 120.0)
GOOD = pd.DataFrame(
    {
        "time": TIME,
        "temperature.motor": 25 + 0.1 * TIME,
        "torque.motor": 5.0,
        "temperature.ambient": 22.0,
    }
)
MODEL = presets()["single-motor"]


def _missing_column(folder: Path) -> list[object]:
    GOOD.drop(columns="torque.motor").to_csv(folder / "log.csv", index=False)
    return ["log.csv", "torque.motor", "no such column"]


def _text_in_a_number(folder: Path) -> list[object]:
    table = GOOD.astype(object)
    table.loc[7, "torque.motor"] = "ERROR"
    table.to_csv(folder / "log.csv", index=False)
    return ["log.csv", "line 9", "ERROR", "number"]


def _time_backwards(folder: Path) -> list[object]:
    GOOD.assign(time=[*TIME[:50], 10.0, *TIME[51:]]).to_csv(folder / "log.csv", index=False)
    return ["log.csv", "line 52", "10", "49"]


def _kelvin(folder: Path) -> list[object]:
    GOOD.assign(**{"temperature.motor": GOOD["temperature.motor"] + 273.15}).to_csv(folder / "log.csv", index=False)
    return ["log.csv", "temperature.motor", "kelvin", "degC"]


def _unknown_effect(folder: Path) -> list[object]:
    (folder / "model.toml").write_text(MODEL.replace('"copper_loss"', '"coper_loss"'))
    return ["model.toml", "line 17", "effects[0].kind", "coper_loss", "copper_loss"]


def _bound_above_its_upper(folder: Path) -> list[object]:
    (folder / "model.toml").write_text(MODEL.replace("bounds = [20, 3000]", "bounds = [3000, 20]"))
    return ["model.toml", "line 9", "capacity.bounds", "3000", "20"]


def _isolated_node(folder: Path) -> list[object]:
    (folder / "model.toml").write_text(MODEL + "\n[nodes.gearbox]\ncapacity = 100\n")
    return ["model.toml", "gearbox", "isolated", "between"]


def _empty_log(folder: Path) -> list[object]:
    (folder / "log.csv").write_text("")
    return ["log.csv", "expected"]


def _truncated_parquet(folder: Path) -> list[object]:
    GOOD.to_parquet(folder / "log.parquet")
    whole = (folder / "log.parquet").read_bytes()
    (folder / "log.parquet").write_bytes(whole[: len(whole) // 2])
    (folder / "log.csv").unlink()
    return ["log.parquet", "Parquet"]


def _place_that_matches_nothing(folder: Path) -> list[object]:
    (folder / "model.toml").write_text(MODEL.replace('at = "motor"', 'at = "*_calf"'))
    return ["model.toml", "line 18", "*_calf", "motor"]


BAD = [
    _missing_column,
    _text_in_a_number,
    _time_backwards,
    _kelvin,
    _unknown_effect,
    _bound_above_its_upper,
    _isolated_node,
    _empty_log,
    _truncated_parquet,
    _place_that_matches_nothing,
]


@pytest.mark.parametrize("spoil", BAD, ids=lambda spoil: spoil.__name__.strip("_"))
@pytest.mark.parametrize("command", ["fit", "improve"])
def test_one_line_status_two_nothing_written(
    spoil: Callable[[Path], list[object]],
    command: str,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    (tmp_path / "model.toml").write_text(MODEL)
    GOOD.to_csv(tmp_path / "log.csv", index=False)
    said = spoil(tmp_path)
    (log,) = (path for path in tmp_path.iterdir() if path.stem == "log")
    before = sorted(tmp_path.iterdir())
    words = [command, tmp_path / "model.toml", log, "-o", tmp_path / "out.toml", "--json", tmp_path / "out.json"]
    with pytest.raises(SystemExit) as stop:
        main([str(word) for word in words])
    seen = capsys.readouterr()
    assert stop.value.code == 2
    assert seen.out == ""
    assert seen.err.count("\n") == 1
    for word in ("found", "expected", *map(str, said)):
        assert word in seen.err
    assert sorted(tmp_path.iterdir()) == before


def test_an_output_folder_that_does_not_exist_is_said(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stop:
        main(["new", "leg", "-o", str(tmp_path / "nowhere" / "leg.toml")])
    assert stop.value.code == 2
    assert "nowhere" in capsys.readouterr().err


@pytest.mark.parametrize("words", [["new", "leg"], ["motor"]], ids=" ".join)
def test_a_file_to_begin_with_does_not_take_the_place_of_an_edited_one(
    words: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "mine.toml"
    for _ in range(2):  # once more changes nothing
        with pytest.raises(SystemExit) as stop:
            main([*words, "-o", str(path)])
        assert stop.value.code == 0
    edited = "# edited\n" + path.read_text()
    path.write_text(edited)
    said = _refused([*words, "-o", path], capsys)
    assert "mine.toml" in said
    assert "there already" in said
    assert path.read_text() == edited


def _refused(words: list[object], capsys: pytest.CaptureFixture[str]) -> str:
    with pytest.raises(SystemExit) as stop:
        main([str(word) for word in words])
    seen = capsys.readouterr()
    assert stop.value.code == 2
    assert seen.err.count("\n") == 1
    return seen.err


def test_the_same_log_twice_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "model.toml").write_text(MODEL)
    GOOD.to_csv(tmp_path / "log.csv", index=False)
    GOOD.to_csv(tmp_path / "copy.csv", index=False)
    words: list[object] = ["fit", tmp_path / "model.toml", tmp_path / "log.csv", "--holdout", tmp_path / "copy.csv"]
    assert "the same data as" in _refused(words, capsys)


def test_outputs_are_checked_before_the_work(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "model.toml").write_text(MODEL)
    GOOD.to_csv(tmp_path / "log.csv", index=False)
    both = [tmp_path / "model.toml", tmp_path / "log.csv"]
    assert "no such folder" in _refused(["fit", *both, "-o", tmp_path / "no" / "x.toml"], capsys)
    assert "no such folder" in _refused(["improve", *both, "--json", tmp_path / "no" / "x.json"], capsys)
    assert "found a folder; expected a file in it" in _refused(["fit", *both, "--json", tmp_path], capsys)
    one = tmp_path / "one.json"
    assert "found one file for two results" in _refused(["fit", *both, "--json", one, "-o", one], capsys)
    assert ".png, .svg or .pdf" in _refused(["compare", *both, "--plot", tmp_path / "x.jpg"], capsys)


def test_a_start_that_is_not_at_rest_gives_no_ambient(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    model = MODEL.replace('ambient = "temperature.ambient"', 'ambient = "start"')
    (tmp_path / "model.toml").write_text(
        model.replace("[nodes.motor]", "[nodes.gearbox]\ncapacity = 100\n\n[nodes.motor]")
        + '\n[[links]]\nbetween = ["gearbox", "ambient"]\n'
    )
    GOOD.assign(**{"temperature.gearbox": 60.0}).to_csv(tmp_path / "log.csv", index=False)
    line = _refused(["fit", tmp_path / "model.toml", tmp_path / "log.csv"], capsys)
    assert (
        "motor at 25.2 degC, and gearbox at 60.0 degC" in line or "gearbox at 60.0 degC, and motor at 25.2 degC" in line
    )


def test_numbers_out_of_range_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "model.toml").write_text(MODEL)
    GOOD.to_csv(tmp_path / "log.csv", index=False)
    both = [tmp_path / "model.toml", tmp_path / "log.csv"]
    assert "--jobs" in _refused(["diagnose", *both, "--jobs", 0], capsys)
    assert "--symmetry-penalty" in _refused(["fit", *both, "--symmetry-penalty", -5], capsys)


def test_an_ending_that_cannot_be_written_is_said_before_the_work(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "model.toml").write_text(MODEL)
    GOOD.to_csv(tmp_path / "log.csv", index=False)
    monkeypatch.setattr("lptn.identify.data.load_model", None)
    words: list[object] = ["simulate", tmp_path / "model.toml", tmp_path / "log.csv", "-o", tmp_path / "x.xlsx"]
    assert ".csv or .parquet" in _refused(words, capsys)


@pytest.mark.parametrize(("run", "said"), [("mnday", True), ("monday", False), ("mon*", False), ("tues*", True)])
@pytest.mark.parametrize("command", ["check", "compare", "fit"])
def test_an_effect_in_a_run_that_no_log_is_is_said(
    command: str, run: str, said: bool, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    offset = (
        f'\n[[effects]]\nkind = "constant_heat"\nat = "motor"\npower = {{ value = 1, fixed = true }}\nrun = "{run}"\n'
    )
    (tmp_path / "model.toml").write_text(MODEL + offset)
    GOOD.to_csv(tmp_path / "monday.csv", index=False)
    with pytest.raises(SystemExit) as stop:
        main([command, str(tmp_path / "model.toml"), str(tmp_path / "monday.csv")])
    assert stop.value.code in (0, None)
    line = f'lptn: constant_heat at motor acts only in run "{run}", and no log is that run (here: monday): it is off\n'
    assert (line in capsys.readouterr().err) == said


@pytest.mark.parametrize("unit", ["degC", "degF"])
@pytest.mark.parametrize(
    "words",
    [
        "check",
        "fit -o fitted.toml",
        "compare",
        "diagnose",
        "improve -o fitted.toml",
        "forecast --limit motor=80",
        "monitor",
        "simulate -o simulated.csv",
    ],
)
def test_kelvin_under_another_unit_is_refused_alike_by_every_command(
    words: str, unit: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    columns = [key for key in map(str, GOOD) if key.startswith("temperature")]
    stated = "".join(f'"{key}" = {{ column = "{key}", unit = "{unit}" }}\n' for key in columns)
    Path("model.toml").write_text(f"{MODEL}\n[columns]\n{stated}", encoding="utf-8")
    offset = 273.15 if unit == "degC" else 473.15
    GOOD.assign(**{key: GOOD[key] + offset for key in columns}).to_csv("log.csv", index=False)
    command, *options = words.split()
    with pytest.raises(SystemExit) as stop:
        main([command, "model.toml", "log.csv", *options])
    (line,) = [line for line in capsys.readouterr().err.splitlines() if "found" in line]
    assert stop.value.code == 2
    assert line.startswith("lptn: log.csv: column 'temperature.")
    assert f"in the unit that is stated, {unit}" in line
    assert "valid = [" in line
