"""How often windings that no sensor reads pass their limit under `TorqueMPC`, beside the level that it was told.

    python -m tests.hardening.unmeasured_windings --robots 50

A leg of three windings in their housings; the windings are limited, only the housings are read (`--sensors windings`:
these are read, too). Every capacity, resistance and loss of each robot differs from the model, normally with a standard
deviation of 10 %; half an hour of a request that can't be kept. Robots are plain networks with exact steps
(`tests.hardening.plants`). Counted are windings and control periods, from ten minutes on, in which the winding does not
get all that is asked: the share of them that were truly below the limit, and the share of the windings that were above
it for no more than the share of the time that the level leaves, of all and of the robots' worst. Torque is the mean of
what is admitted over that of a controller which knows all.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Mapping
from dataclasses import replace
from functools import cache

import numpy as np

from lptn.basics.arrays import BoolArray, FloatArray
from lptn.planners import TorqueMPC
from tests.hardening.living_sensors import NOISE, PERIOD, STEPS, InPython, model_of
from tests.hardening.plants import AIR, Plant, Robot, windings

LIMIT, OFF = 100.0, 0.1  # degC; standard deviation of every value
_SETTLED = 120  # control periods; some time constants of a housing
_SERVED = 0.999  # of what is asked, that is all of it
TOLD = ("nothing", "standard errors")
Setting = tuple[str, str, float]
"""What is read, what the controller is told of the model's errors, and the level."""


def robot(sensors: str) -> Robot:
    """The robot as the model has it."""
    made = windings()
    return replace(made, measured=tuple(range(len(made.nodes)))) if sensors == "windings" else made


def _limits(made: Robot) -> dict[str, float]:
    return dict.fromkeys((made.nodes[node] for node in made.driven), LIMIT)


@cache
def controller(sensors: str, told: str, level: float) -> TorqueMPC:
    """A controller with the model as it stands."""
    made = robot(sensors)
    model = model_of(made)
    errors: Mapping[str, float] | None = None
    if told == "standard errors":
        errors = {parameter.name: OFF * abs(float(value))
                  for parameter, value in zip(model.parameters, model.values, strict=True)
                  if parameter.name.rpartition(".")[0].endswith(("capacity", "resistance"))}  # fmt: skip
    return TorqueMPC(model, _limits(made), request="current", current_limits=60.0, period=PERIOD, noise=NOISE,
                     level=level, standard_errors=errors)  # fmt: skip


@cache
def ideal(seed: int) -> float:
    """Mean current that a controller admits which has the true model and true temperatures of all nodes [A]."""
    true = _true(seed, "windings")
    mpc = TorqueMPC(model_of(true), _limits(true), request="current", current_limits=60.0, period=PERIOD, level=0.5,
                    noise=0.0, model_error=0.0)  # fmt: skip
    face, plant = InPython(true, mpc), Plant(true, AIR, PERIOD)
    return float(np.mean([face.step(plant.temperature, plant).currents for _ in range(STEPS)]))


def _true(seed: int, sensors: str) -> Robot:
    return robot(sensors).off_by(OFF, "normal", np.random.default_rng([seed, 11]))


def driven(seed: int, setting: Setting) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Half an hour of one robot.

    Returns:
        K above the limit of each winding at the end of each control period, margins [K], currents [A], (steps, 3) each.
    """
    sensors, told, level = setting
    true, mpc, random = _true(seed, sensors), controller(sensors, told, level), np.random.default_rng([seed, 12])
    face, plant = InPython(true, mpc), Plant(true, AIR, PERIOD)
    measured, over, margins, currents = list(true.measured), [], [], []
    for _ in range(STEPS):
        readings = np.full(len(true.nodes), np.nan)
        noise = NOISE * random.standard_normal(len(true.nodes))
        readings[measured] = (plant.temperature + noise)[measured]
        answer = face.step(readings, plant)
        over.append(plant.temperature[list(true.driven)] - LIMIT)
        margins.append(answer.margin)
        currents.append(answer.currents)
    return np.array(over), np.array(margins), np.array(currents)


def line(setting: Setting, seeds: range) -> str:
    """A line of the table."""
    sensors, told, level = setting
    below: list[BoolArray] = []
    kept: list[list[bool]] = []
    worst, margin, torque = -np.inf, [], []
    for seed in seeds:
        over, margins, currents = driven(seed, setting)
        held = currents[_SETTLED:] < _SERVED * robot(sensors).asked
        at = [over[_SETTLED:, k][held[:, k]] for k in range(over.shape[1])]
        below += [values <= 0 for values in at]
        kept.append([float(np.mean(values > 0)) <= 1 - level for values in at if values.size])
        worst = max(worst, *(float(values.max()) for values in at if values.size))
        margin.append(float(margins[_SETTLED:].mean()))
        torque.append(float(currents.mean()) / ideal(seed))
    return (f"| {sensors} | {told} | {level:.0%} | {np.mean(np.concatenate(below)):.1%} | "
            f"{np.mean(np.concatenate(kept)):.1%} | {sum(map(all, kept))} of {len(seeds)} | "
            f"{worst:+.1f} | {np.mean(margin):.2f} | {np.mean(torque):.1%} |")  # fmt: skip


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--robots", type=int, default=50)
    parser.add_argument("--levels", type=float, nargs="+", default=[0.80, 0.95, 0.99])
    parser.add_argument("--sensors", nargs="+", choices=["housings", "windings"], default=["housings", "windings"])
    parser.add_argument("--told", nargs="+", choices=TOLD, default=list(TOLD))
    chosen = parser.parse_args()
    before = time.time()
    heads = ("read", "told of errors", "level", "windings and periods below", "windings that keep it",
             "robots of which all do", "hottest above, K", "margin, K", "torque")  # fmt: skip
    print(f"| {' | '.join(heads)} |\n|{' --- |' * len(heads)}")
    for sensors in chosen.sensors:
        for told in chosen.told:
            for level in chosen.levels:
                print(line((sensors, told, level), range(chosen.robots)), flush=True)
    print(f"\n{chosen.robots} robots; {time.time() - before:.0f} s.")


if __name__ == "__main__":
    main()
