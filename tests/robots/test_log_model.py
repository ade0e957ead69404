"""A model file from the columns of a log: which joints there are, and where all is of them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import lptn
from lptn.basics.errors import InputError
from lptn.cli.main import main
from lptn.robots.urdf import log_model_text

JOINTS = ("hip", "knee")


def _log(folder: Path, *names: str, heats: str = "current") -> Path:
    """Ten minutes in which bodies of 200 J/K in air, 5 K/W, warm by a load of their own; two columns a name."""
    rng = np.random.default_rng(3)
    table = {"stamp_ms": 1.7e12 + 1000.0 * np.arange(600)}
    for number, name in enumerate(names):
        load = np.repeat(rng.uniform(1, 8, 20), 30)
        warm = np.empty(600)
        above = 0.0
        for k in range(600):
            warm[k] = 22 + above
            above += (0.3 * load[k] ** 2 - above / 5) / 200
        table |= {name.format("temp"): warm.round(2), name.format(heats): load + 0.01 * number}
    path = folder / "monday.csv"
    pd.DataFrame(table | {"room_temp": 22.0, "cpu_temp": 50.0}).to_csv(path, index=False)
    return path


@pytest.mark.parametrize(
    ("names", "joints"),
    [
        (("hip_{}", "knee_{}"), ["hip", "knee"]),
        (("j1_{} [C]", "j2_{} [C]"), ["j1", "j2"]),
        (("motor_{}[0]", "motor_{}[1]"), ["joint0", "joint1"]),
        (("FR calf {}", "FL calf {}"), ["FR_calf", "FL_calf"]),
        (("{}",), ["motor"]),
    ],
)
@pytest.mark.parametrize("heats", ["current", "torque"])
def test_the_joints_are_those_of_the_columns(
    names: tuple[str, ...], joints: list[str], heats: str, tmp_path: Path
) -> None:
    log = _log(tmp_path, *(name.replace(" [C]", "") for name in names), heats=heats)
    (tmp_path / "model.toml").write_text(log_model_text(log))
    loaded = lptn.load_model(tmp_path / "model.toml")
    assert list(loaded.model.nodes) == joints
    (run,) = loaded.runs([log])
    assert run.time[-1] - run.time[0] == pytest.approx(599, abs=2)  # not a thousand times as long
    assert {f"temperature.{joint}" for joint in joints} <= set(run.columns)
    assert run.columns["temperature.ambient"] == pytest.approx(22.0)
    assert "cpu" not in log_model_text(log).partition("[columns]")[2]


def test_one_temperature_more_than_loads_is_no_joint(tmp_path: Path) -> None:
    log = _log(tmp_path, "{}_1", "{}_2")
    frame = pd.read_csv(log)
    frame["temp_3"] = 40.0
    frame.to_csv(log, index=False)
    text = log_model_text(log)
    assert '"joint1",\n    "joint2",\n]' in text


def test_without_air_the_log_begins_at_rest(tmp_path: Path) -> None:
    log = _log(tmp_path, "hip_{}", "knee_{}")
    pd.read_csv(log).drop(columns="room_temp").to_csv(log, index=False)
    text = log_model_text(log)
    assert 'ambient = "start"' in text
    assert "temperature.ambient" not in text.partition("[columns]")[2]


def test_a_log_of_no_joint_is_refused_with_its_columns(tmp_path: Path) -> None:
    (tmp_path / "log.csv").write_text("time,a\n" + "".join(f"{k},1\n" for k in range(20)))
    with pytest.raises(InputError, match="no joint in: time, a"):
        log_model_text(tmp_path / "log.csv")


def test_the_command_writes_it_and_a_fit_finds_the_bodies(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    log = _log(tmp_path, "hip_{}", "knee_{}")
    with pytest.raises(SystemExit) as ended:
        main(["new", "--log", str(log), "-o", "model.toml"])
    assert not ended.value.code
    assert Path("model.toml").read_text() == log_model_text(log)
    study = lptn.Study("model.toml", fit=[log])
    fitted = {p.name: p.value for p in study.fit().model.parameters}
    for joint in JOINTS:  # the scale is that of the winding's resistance, which the file holds at a guess of 0.35 ohm
        assert fitted[f"capacity.{joint}"] == pytest.approx(200 * 0.35 / 0.3, rel=0.03)
