"""Studies, tasks, drawings and calibrations for the fuzzer."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from pathlib import Path
from random import Random

from lptn.model.model import Model
from lptn.robots.presets import presets
from tests.hardening.target import EXAMPLES


@cache
def studies() -> Mapping[str, bytes]:
    """The examples of trade studies."""
    return {path.name: path.read_bytes() for path in sorted((EXAMPLES / "u8_trade").glob("*.toml"))}


def read_study(path: Path, _: Random) -> None:
    """A study file."""
    from lptn.planners.trade import load_study

    load_study(path)


@cache
def tasks() -> Mapping[str, bytes]:
    """The examples of tasks."""
    return {path.name: path.read_bytes() for path in sorted((EXAMPLES / "plan").glob("*.toml"))}


@cache
def _quadruped() -> Model:
    from lptn.model.file import parse_model

    return Model(parse_model(presets()["quadruped"], Path("quadruped.toml")).network)


def read_task(path: Path, random: Random) -> None:
    """A task file; now and then one that takes a second is carried out."""
    from lptn.planners.tasks import kind_of, load_task

    table = load_task(path)
    kind = kind_of(table, str(path))
    asked = kind.read(table, str(path), _quadruped())
    if table["task"]["kind"] != "mission" and random.random() < 0.05:  # a mission takes a minute
        answer = kind.run(asked)
        answer.text(), answer.table(), answer.as_json()


@cache
def drawings() -> Mapping[str, bytes]:
    """The sample drawings of motors."""
    from lptn.robots.motor_drawing import sample

    return {f"{name}.toml": sample(name).encode() for name in ("inrunner", "outrunner")}


def read_drawing(path: Path, random: Random) -> None:
    """A motor's drawing; now and then the model that is made of it."""
    from lptn.model.file import parse_model
    from lptn.robots.motor_drawing import load_geometry
    from lptn.robots.motor_model import model_text

    text = model_text(load_geometry(path))
    if random.random() < 0.2:
        parse_model(text, path)


@cache
def calibrations() -> Mapping[str, bytes]:
    """A calibration of the leg as `lptn monitor` keeps it."""
    return {"kept.json": CALIBRATION.encode()}


CALIBRATION = """\
{"nodes": ["FR_hip", "FR_thigh", "FR_calf"], "healthy_hours": 1.5,
"limits": {"offset": 9.0, "drift": 9.5, "lag": 8.0},
"noise": [0.1, 0.3, 0.1],
"model_error": {"heat": {"FR_hip": 0.1, "FR_thigh": 0.2, "FR_calf": 0.1}, "heat_time": 600.0, "change": 0.01,
"bias": 0.2, "air": 0.1, "inputs": {"torque.FR_hip": 0.05}}}
"""


def read_calibration(path: Path, _: Random) -> None:
    """A calibration kept in a file."""
    from lptn.model.file import parse_model
    from lptn.online.calibration import read_calibration

    read_calibration(path, Model(parse_model(presets()["leg"], Path("leg.toml")).network))
