"""`lptn plan` as a user runs it: torque plans and admissible torques from task files, and every mistake in them."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from lptn.cli.main import main
from lptn.planners.tasks import KINDS, kind_of

EXAMPLES = Path(__file__).parents[2] / "examples" / "plan"
Plan = Callable[..., tuple[int, str, str]]

TRACK = """
[task]
kind = "track"
[limits]
"*" = 60
[start]
"*" = 50
[current_limits]
"*" = 30
[conditions]
"temperature.ambient" = 25
"velocity.*" = 1
"velocity_rms.*" = 1
"powered.*" = 1
"speed.base" = 0.5
[[phases]]
duration = 100
torque = { "*" = 4, "FR_calf" = 12 }
[[phases]]
duration = 50
torque = { "*" = 2 }
conditions = { "speed.base" = 1.0 }
"""
LIMIT = """
[task]
kind = "limit"
horizons = [10, 60]
[limits]
"*" = 60
[start]
"*" = 50
[load]
"*" = 1
[conditions]
"temperature.ambient" = 25
"velocity.*" = 1
"velocity_rms.*" = 1
"powered.*" = 1
"speed.base" = 0.5
"""
FIRMWARE = (EXAMPLES / "firmware.toml").read_text().replace('"power.pc" = 20\n', "")


@pytest.fixture(scope="module")
def leg(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The preset leg as a file."""
    path = tmp_path_factory.mktemp("model") / "leg.toml"
    main_of("new", "leg", "--model", "full", "-o", path)
    return path


def main_of(*words: object) -> int:
    try:
        main([str(word) for word in words])
    except SystemExit as stop:
        return int(stop.code or 0)
    return 0


@pytest.fixture
def plan(leg: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Plan:
    """Runs `lptn plan` on a task's text; returns exit status, output, error output."""

    def run(text: str, *words: object, model: Path = leg) -> tuple[int, str, str]:
        task = tmp_path / "task.toml"
        task.write_text(text, encoding="utf-8")
        capsys.readouterr()
        status = main_of("plan", model, task, *words)
        seen = capsys.readouterr()
        return status, seen.out, seen.err

    return run


def test_the_power_of_a_plan_is_limited_and_told(plan: Plan, tmp_path: Path) -> None:
    csv, limit = tmp_path / "plan.csv", 25.0
    status, out, err = plan(TRACK.replace('"track"', f'"track"\npower_limit = {limit}'), "-o", csv)
    assert (status, err) == (0, "")
    assert out.startswith("Power at the supply: at most 25 W of 25 W.")
    table, taken = pd.read_csv(csv), []
    for joint in ("FR_hip", "FR_thigh", "FR_calf"):  # copper loss and torque x speed, written again
        torque, ends = table[f"torque.{joint} [N*m]"], table[f"temperature.{joint} [degC]"]
        middle = (ends + ends.shift(1, fill_value=50.0)) / 2
        taken.append(0.15 * (1 + 0.0039 * (middle - 25)) * (torque / 0.84357) ** 2 + torque * 1.0)
    np.testing.assert_allclose(table["power [W]"], np.sum(taken, axis=0), rtol=1e-5)
    assert table["power [W]"].max() < limit * 1.001
    assert table["requested.FR_calf [N*m]"].max() == 12.0


def test_a_torque_plan_as_table_json_and_picture(plan: Plan, tmp_path: Path) -> None:
    csv, target, picture = tmp_path / "plan.csv", tmp_path / "plan.json", tmp_path / "plan.png"
    status, out, err = plan(TRACK, "-o", csv, "--json", target, "--plot", picture)
    assert (status, err) == (0, "")
    assert "FR_calf" in out
    table, written = pd.read_csv(csv), json.loads(target.read_text())
    assert len(table) == 30
    assert table["requested.FR_calf [N*m]"].iloc[0] == 12
    assert np.all(table["torque.FR_calf [N*m]"] <= table["requested.FR_calf [N*m]"] + 1e-9)
    assert table["temperature.FR_calf [degC]"].max() <= 60
    assert written["joints"]["FR_calf"]["admitted"] == pytest.approx(table["torque.FR_calf [N*m]"].tolist())
    assert written["given_up"] == []
    assert 0 < written["cost"] < 1
    assert picture.read_bytes().startswith(b"\x89PNG")


def test_a_start_above_the_limit_is_answered_and_said_first(plan: Plan, tmp_path: Path) -> None:
    status, out, _ = plan(TRACK.replace('"*" = 50\n[current', '"*" = 63\n[current'), "--json", tmp_path / "p.json")
    assert status == 0
    assert out.startswith("Given up: a limit less its margin can't be met: FR_hip by ")
    written = json.loads((tmp_path / "p.json").read_text())
    assert 2 < written["nodes"]["FR_hip"]["slack"] < 3.2


def test_without_a_compiler_ipopt_plans_the_same(plan: Plan, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    plan(TRACK, "--json", tmp_path / "c.json")
    monkeypatch.setenv("CC", "no-such-compiler")
    status, out, _ = plan(TRACK, "--json", tmp_path / "ipopt.json")
    assert status == 0
    assert "IPOPT, for there is no C compiler" in out
    one, other = (json.loads((tmp_path / f"{name}.json").read_text()) for name in ("c", "ipopt"))
    assert other["cost"] == pytest.approx(one["cost"], rel=1e-3)
    for joint in one["joints"]:
        np.testing.assert_allclose(other["joints"][joint]["admitted"], one["joints"][joint]["admitted"], atol=0.02)


def test_admissible_torques_as_table_json_and_picture(plan: Plan, tmp_path: Path) -> None:
    csv, target, picture = tmp_path / "limits.csv", tmp_path / "limits.json", tmp_path / "limits.svg"
    status, out, err = plan(LIMIT, "-o", csv, "--json", target, "--plot", picture)
    assert (status, err) == (0, "")
    assert "continuous" in out
    table, written = pd.read_csv(csv), json.loads(target.read_text())
    assert written["seconds"] == [10, 60, None]
    assert table["60 s [N*m]"].tolist() == pytest.approx([row[1] for row in written["admissible"].values()])
    assert written["scale"][0] > written["scale"][1] > written["scale"][2]
    assert picture.read_text().startswith("<?xml")


def test_no_compiler_does_not_stop_the_limiter(plan: Plan, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    plan(LIMIT, "--json", tmp_path / "c.json")
    monkeypatch.setenv("CC", "no-such-compiler")
    assert plan(LIMIT, "--json", tmp_path / "vm.json")[0] == 0
    one, other = (json.loads((tmp_path / f"{name}.json").read_text())["admissible"] for name in ("c", "vm"))
    assert {k: pytest.approx(v) for k, v in one.items()} == other


def test_numbers_for_firmware_as_table_json_page_and_picture(plan: Plan, tmp_path: Path) -> None:
    names = {name: tmp_path / name for name in ("n.csv", "n.json", "n.svg", "n.html")}
    words = ("-o", names["n.csv"], "--json", names["n.json"], "--plot", names["n.svg"], "--report", names["n.html"])
    status, out, err = plan(FIRMWARE, *words)
    assert (status, err) == (0, "")
    assert "the model has no standard errors, give a margin." in out
    table, written = pd.read_csv(names["n.csv"], index_col="joint"), json.loads(names["n.json"].read_text())
    assert table["trip [degC]"].to_dict() == {k: pytest.approx(v["trip"]) for k, v in written["joints"].items()}
    assert 0 < written["joints"]["FR_calf"]["continuous"] < written["joints"]["FR_calf"]["peak"] == 25
    assert names["n.svg"].read_text().startswith("<?xml")
    assert "FR_calf" in names["n.html"].read_text()


def test_standard_errors_of_the_model_file_count(plan: Plan, leg: Path, tmp_path: Path) -> None:
    fitted = tmp_path / "fitted.toml"
    fitted.write_text(leg.read_text() + '\n[fit.standard_errors]\n"capacity.FR_calf" = 40\n"capacity.FR_hip" = 40\n')
    status, out, _ = plan(FIRMWARE, model=fitted)
    assert status == 0
    assert "K are kept for the model's standard errors." in out


@pytest.mark.parametrize(
    ("text", "file", "what"),
    [
        (TRACK, "main.c", "the controller in C"),
        (LIMIT, "main.c", "the limiter in C"),
        (FIRMWARE, "drive.c", "the drives' limiters in C"),
    ],
)
def test_c_code_is_written_into_a_folder(plan: Plan, tmp_path: Path, text: str, file: str, what: str) -> None:
    status, out, _ = plan(text, "--emit-c", tmp_path / "robot")
    assert status == 0
    assert file in {path.name for path in (tmp_path / "robot").iterdir()}
    assert f"robot ({what})." in out


def test_the_shipped_tasks_are_planned(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    model, csv = tmp_path / "quadruped.toml", tmp_path / "plan.csv"
    main_of("new", "quadruped", "-o", model)
    assert main_of("plan", model, EXAMPLES / "track_trot.toml", "-o", csv) == 0
    table = pd.read_csv(csv)
    assert len(table) == 180
    assert table.filter(like="slack.").to_numpy().max() == 0
    assert main_of("plan", model, EXAMPLES / "limit_now.toml") == 0
    assert "continuous" in capsys.readouterr().out


# --- mistakes -----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (
            ('kind = "track"', 'kind = "trace"'),
            "task.kind: found 'trace'; expected one of track, limit, firm",
        ),
        (('kind = "track"', ""), "task.kind: found no such key"),
        (('[limits]\n"*" = 60', '[limits]\n"FL_*" = 60'), 'limits."FL_*": found no such place'),
        (('[limits]\n"*" = 60', "[limits]"), "limits: found none; expected at least 1 entry"),
        (('[start]\n"*" = 50', "[start]\nFR_hip = 50"), "start: found no temperature of FR_thigh"),
        (('"speed.base" = 0.5\n', ""), "conditions: found no speed.base"),
        (("duration = 100", "duration = 101"), "phases[0].duration: found 101; expected a multiple of 5 s"),
        (("duration = 100", "duration = -5"), "phases[0].duration"),
        (("duration = 100", "duration = 100000"), "at most 400"),
        (('kind = "track"', 'kind = "track"\nperiod = 5e-324'), "task.period: found 5e-324"),
        (('kind = "track"', 'kind = "track"\nperiod = 1e-13'), "task.period: found 1e-13"),
        (('kind = "track"', 'kind = "track"\nperiod = 1e9'), "task.period: found 1000000000.0"),
        (('kind = "track"', 'kind = "track"\nperiod = { value = 5, unit = "K" }'), "a unit like s"),
        (("torque = {", "torqe = {"), 'no key "torqe" here'),
        (('torque = { "*" = 2 }', 'current = { "*" = 2 }'), "torque and current"),
        (('"FR_calf" = 12', '"FR_calf" = nan'), "finite"),
        (("[limits]", "[limits"), "line"),
        (
            ('[limits]\n"*" = 60', '[limits]\n"*" = 90\nFR_calf = 20'),
            "limits.FR_calf: found 20 degC, which FR_calf passes by",
        ),
    ],
)
def test_each_mistake_is_one_line(plan: Plan, tmp_path: Path, change: tuple[str, str], said: str) -> None:
    status, out, err = plan(TRACK.replace(*change), "-o", tmp_path / "plan.csv")
    assert status == 2
    assert out == ""
    assert said in err
    assert "task.toml" in err
    assert err.count("\n") == 1
    assert not (tmp_path / "plan.csv").exists()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("-o", "plan.xlsx"), ".csv or .parquet"),
        (("--plot", "plan.txt"), ".png, .svg or .pdf"),
        (("-o", "task.toml"), "would be lost"),
        (("--json", "task.toml"), "would be lost"),
        (("--json", "missing/plan.json"), "no such folder"),
        (("--emit-c", "task.toml"), "found a file; expected a folder"),
    ],
)
def test_outputs_that_can_not_be_are_refused(
    plan: Plan, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, words: tuple[str, str], said: str
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "task.toml").touch()
    status, _, err = plan(TRACK, *words)
    assert status == 2
    assert said in err
    assert (tmp_path / "task.toml").read_text() == TRACK


def test_a_mission_has_no_controller_step(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    model = tmp_path / "quadruped.toml"
    main_of("new", "quadruped", "-o", model)
    task = EXAMPLES / "mission_deliveries.toml"
    assert main_of("plan", model, task, "--emit-c", tmp_path / "robot", "-o", tmp_path / "plan.csv") == 2
    assert "a kind of task without a controller step" in capsys.readouterr().err
    assert sorted(path.name for path in tmp_path.iterdir()) == ["quadruped.toml"]


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_is_there(kind: str) -> None:
    planner = kind_of({"task": {"kind": kind}}, "task.toml")
    assert callable(planner.read)
    assert callable(planner.run)
