"""A robot unlike those of `lptn.virtual`: an arm with gears of a hundred for one, slow, strong and with much friction.

Its own code: NumPy alone, Runge-Kutta steps of half a second, temperatures in steps of 0.1 K, inputs that hold for a
second; loads, air and starts of its own in each run.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import lptn
from lptn.basics.arrays import FloatArray

JOINTS = ("base", "shoulder", "elbow", "wrist")
CAPACITY, TO_AIR = np.array([300.0, 260, 180, 90]), np.array([2.2, 2.5, 3.2, 5.0])  # J/K, K/W
BETWEEN = np.array([1.8, 2.2, 2.8])  # K/W
WINDING, CONSTANT = np.array([0.35, 0.35, 0.5, 0.9]), np.array([12.0, 12, 10, 8])  # ohm, N·m/A at the joint
ELBOW, WRIST = 2, 3
STEP, MINUTES = 0.5, 40  # s

Hidden = Callable[[FloatArray, FloatArray], FloatArray]
"""Temperatures and speeds of the joints to the heat that no model has [W], shape (4,) each."""


def _at(joint: int, heat: float) -> FloatArray:
    return np.where(np.arange(len(JOINTS)) == joint, heat, 0.0)


HIDDEN: dict[tuple[str, str], Hidden] = {
    ("viscous_friction", "elbow"): lambda _, speed: _at(ELBOW, 2.1 * speed[ELBOW] ** 2),
    ("iron_loss", "elbow"): lambda _, speed: _at(ELBOW, 2.2 * abs(speed[ELBOW]) ** 1.5),
    ("constant_heat", "wrist"): lambda *_: _at(WRIST, 4.0),
    ("conduction", "base~elbow"): lambda at, _: _at(0, (at[ELBOW] - at[0]) / 2.0) - _at(ELBOW, (at[ELBOW] - at[0]) / 2),
    ("", ""): lambda *_: np.zeros(len(JOINTS)),
}


def _log(seed: int, hidden: Hidden) -> pd.DataFrame:
    rng, count = np.random.default_rng(seed), round(60 * MINUTES / STEP)
    (torque, speed), first = np.zeros((2, 4, count)), 0
    while first < count:  # rest, hold, or move to and fro
        last = min(count, first + round(rng.uniform(60, 400) / STEP))
        kind, time = rng.integers(3), np.arange(last - first) // 2 * 2 * STEP
        swing = rng.uniform(0.02, 0.12, 4)[:, None] * time * 2 * np.pi + rng.uniform(0, 2 * np.pi, 4)[:, None]
        if kind:
            torque[:, first:last] = (CONSTANT * rng.uniform(0.5, 6, 4))[:, None] * (1 + 0.3 * np.cos(swing))
        if kind == 2:
            speed[:, first:last] = rng.uniform(0.5, 2.5, 4)[:, None] * np.sin(swing)
        first = last
    time = STEP * np.arange(count)
    air = 21 + rng.uniform(-2, 4) + 0.6 * np.sin(time / rng.uniform(600, 1800))
    at, path = air[0] + rng.uniform(0, 7, 4), np.empty((4, count))

    def rates(at: FloatArray, k: int) -> FloatArray:
        flow = np.diff(at) / BETWEEN
        heat = WINDING * (torque[:, k] / CONSTANT) ** 2 - (at - air[k]) / TO_AIR + hidden(at, speed[:, k])
        return np.asarray((heat + np.append(flow, 0.0) - np.append(0.0, flow)) / CAPACITY)

    for k in range(count):
        path[:, k] = at
        at = at + STEP * rates(at + STEP / 2 * rates(at, k), k)
    logged = slice(None, None, 2)
    columns = {"time": time[logged], "temperature.ambient": np.round(air[logged], 1)}
    for row, joint in enumerate(JOINTS):
        columns[f"temperature.{joint}"] = np.round(path[row, logged] + rng.normal(0, 0.05, count // 2), 1)
        columns[f"torque.{joint}"], columns[f"velocity.{joint}"] = torque[row, logged], speed[row, logged]
    return pd.DataFrame(columns)


def _model(folder: Path) -> Path:
    """As a user would write it: a node a joint, the data sheets' constants, resistances and capacities guessed."""
    text = f'[model]\nname = "arm"\njoints = {list(JOINTS)}\nambient = "temperature.ambient"\n'.replace("'", '"')
    for row, joint in enumerate(JOINTS):
        text += f'[nodes.{joint}]\ncapacity = {{ value = {1.3 * CAPACITY[row]:.0f}, unit = "J/K" }}\n'
        text += f'[[links]]\nbetween = ["{joint}", "ambient"]\nresistance = {{ value = 3, unit = "K/W" }}\n'
        text += f'[[effects]]\nkind = "copper_loss"\nat = "{joint}"\n'
        text += f"resistance = {WINDING[row]}\ntorque_constant = {CONSTANT[row]}\n"
    for one, other in pairwise(JOINTS):
        text += f'[[links]]\nbetween = ["{one}", "{other}"]\nresistance = {{ value = 3, unit = "K/W" }}\n'
    path = folder / "arm.toml"
    path.write_text(text)
    return path


@pytest.mark.slow
@pytest.mark.parametrize("missing", list(HIDDEN), ids=lambda key: key[0] or "nothing")
def test_what_an_arm_lacks_is_named(missing: tuple[str, str], tmp_path: Path) -> None:
    """Friction fifty times a leg's; a joint so warm by heat that no model has that a fit takes its way out away."""
    logs = [_log(seed, HIDDEN[missing]) for seed in (1, 2, 3)]
    study = lptn.Study(_model(tmp_path), fit=logs[:2], holdout=logs[2:])
    steps = study.improve().steps
    assert [step.key for step in steps[1:2]] == ([missing] if missing[0] else [])
    best = steps[-1].holdout
    assert best is not None
    assert best.rmse < 0.09  # K: noise of 0.05 and steps of 0.1
