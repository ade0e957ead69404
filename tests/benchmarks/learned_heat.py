"""Heat that the catalogue lacks, learned as a curve: against truth, on held-out runs, and where nothing is hidden.

    python -m tests.benchmarks.learned_heat --seeds 1 2

Truth is a chain of three joints, integrated here with NumPy alone: random torques, speeds and air, noisy sensors. Each
hidden heat is fitted to two runs of an hour and held out one. A row says what the diagnosis of the model without it
answers, the held-out error of the best that the catalogue offers, which input the curve is over, how far it is from the
truth, how much of the truth its 95 % band holds, and the held-out error with it. Over its own temperature the truth
counts from where the curve begins. The sensors' noise is 0.1 K, 0.045 K in means over 5 s.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from lptn.basics.arrays import FloatArray
from lptn.diagnose.advice import advise
from lptn.diagnose.diagnosis import diagnose, for_search
from lptn.diagnose.learned_heat import LearnedCurve
from lptn.identify.data import DataSplit, split_data
from lptn.logs.run import Run
from lptn.model.model import Model
from tests.builders import LEG, effect, leg, make_run

WINDING = 0.4  # ohm at 1 N·m/A
CAPACITIES, AIR = np.array([150.0, 220.0, 300.0]), np.array([9.0, 12.0, 6.0])  # J/K, K/W
HIP_THIGH, CALF_THIGH = 3.0, 2.0  # K/W
HOLD, LENGTH = 60, 3600  # s
AIR_OF_CURVE = 21.0  # degC, in the middle of what the runs have: for the truth over a temperature

HiddenHeat = Callable[[FloatArray, FloatArray, FloatArray, FloatArray], FloatArray]
"""Heat [W] from speed [rad/s], torque [N·m], temperature and air [degC]."""


@dataclass(frozen=True)
class Hidden:
    """A heat that the catalogue lacks, at one joint, and the input that it goes with."""

    node: str
    column: str
    heat: HiddenHeat


def _cogging(v: FloatArray, _: FloatArray, __: FloatArray, ___: FloatArray) -> FloatArray:
    return 4.0 * v**0.3


def _fan(_: FloatArray, __: FloatArray, t: FloatArray, air: FloatArray) -> FloatArray:
    return -0.25 / (1.0 + np.exp(-(t - 50.0) / 1.5)) * (t - air)


def _leak(_: FloatArray, __: FloatArray, t: FloatArray, ___: FloatArray) -> FloatArray:
    return -9.0 * np.clip((t - 50.0) / 2.0, 0.0, 1.0)


def _clutch(_: FloatArray, torque: FloatArray, __: FloatArray, ___: FloatArray) -> FloatArray:
    return 5.0 * np.maximum(torque - 4.0, 0.0)


def _seal(v: FloatArray, _: FloatArray, __: FloatArray, ___: FloatArray) -> FloatArray:
    return 8.0 * (1.0 - np.exp(-np.maximum(v - 3.0, 0.0) / 0.4))


HIDDEN = {
    "cogging, |speed|^0.3": Hidden("FR_thigh", "velocity.FR_thigh", _cogging),
    "fan from 50 degC on": Hidden("FR_thigh", "temperature.FR_thigh", _fan),
    "leak at 50 degC": Hidden("FR_hip", "temperature.FR_hip", _leak),
    "clutch above 4 N*m": Hidden("FR_calf", "torque.FR_calf", _clutch),
    "seal above 3 rad/s": Hidden("FR_hip", "velocity.FR_hip", _seal),
}


def truth_run(seed: int, hidden: Hidden | None, *, noise: float = 0.1, length: int = LENGTH) -> Run:
    """A run of random torques, speeds and rests, in steps of 1 s."""
    rng = np.random.default_rng(seed)
    pieces = length // HOLD
    torque, speed = rng.uniform(0.0, 8.0, (3, pieces)), rng.uniform(0.0, 6.0, (3, pieces))
    torque[rng.uniform(size=torque.shape) < 0.3] = 0.0
    speed[rng.uniform(size=speed.shape) < 0.3] = 0.0
    torque, speed = torque.repeat(HOLD, axis=1), speed.repeat(HOLD, axis=1)
    air = rng.uniform(18.0, 24.0) + 1.5 * np.sin(np.arange(length) / 900.0 + rng.uniform(0.0, 6.0))
    row = LEG.index(hidden.node) if hidden else 0

    def rates(t: FloatArray, k: int) -> FloatArray:
        heat = WINDING * torque[:, k] ** 2 - (t - air[k]) / AIR
        if hidden:
            heat[row] += hidden.heat(speed[row, k], torque[row, k], t[row], air[k])
        one, two = (t[0] - t[1]) / HIP_THIGH, (t[1] - t[2]) / CALF_THIGH
        return np.asarray((heat + np.array([-one, one - two, two])) / CAPACITIES)

    path = np.empty((3, length))
    path[:, 0] = air[0]
    for k in range(length - 1):  # by Heun: time constants are above 100 s
        slope = rates(path[:, k], k)
        path[:, k + 1] = path[:, k] + 0.5 * (slope + rates(path[:, k] + slope, k))
    readings = path + noise * rng.standard_normal(path.shape)
    columns = {"temperature.ambient": air}
    for number, name in enumerate(LEG):
        columns |= {f"temperature.{name}": readings[number], f"torque.{name}": torque[number]}
        columns |= {f"velocity.{name}": speed[number], f"velocity_rms.{name}": speed[number]}
    return make_run(columns, name=f"run{seed}")


def split(seed: int, hidden: Hidden | None) -> DataSplit:
    """Two runs to fit, one held out."""
    runs = [truth_run(10 * seed + number, hidden) for number in range(3)]
    return split_data(runs[:2], runs[2:])


def model() -> Model:
    """Three joints with copper loss, which know of no other heat."""
    return Model(leg([effect("copper_loss", "*", resistance=WINDING, torque_constant=1.0)]))


def curve_against_truth(curve: LearnedCurve, hidden: Hidden) -> tuple[float, float]:
    """RMS error of a learned curve [W], and the share of it whose 95 % band holds the truth."""
    x = curve.values
    truth = hidden.heat(x, x, x, np.full_like(x, AIR_OF_CURVE))
    off = np.abs(curve.heat - (truth - truth[0]))
    return float(np.sqrt(np.mean(off**2))), float(np.mean(off <= curve.band))


def _row(name: str, seed: int, hidden: Hidden | None) -> str:
    data = split(seed, hidden)
    first = diagnose(model(), data)
    curve = advise(first, first, for_search(data)).learned
    best = min(errors.rmse for errors in (first.holdout, *(step.holdout for step in first.steps)) if errors)
    verdict = first.verdict if first.remaining == "adequate" or first.verdict == "unexplained" else "explained in part"
    cells = [name, str(seed), verdict, f"{best:.3f}"]
    if curve is None:
        return " | ".join([*cells, "none", "", "", "", "no"])
    cells += [f"{curve.inputs[0].column} ({100 * curve.inputs[0].share:.0f} %)"]
    right = hidden is not None and curve.step is not None and curve.inputs[0].column == hidden.column
    error, held = curve_against_truth(curve, hidden) if right and hidden else (np.nan, np.nan)
    largest = np.abs(curve.heat).max() if curve.step else np.nan
    cells += [f"{error:.2f} of {largest:.1f}", f"{100 * held:.0f} %"]
    return " | ".join([*cells, f"{curve.held_out or np.nan:.3f}", "yes" if curve.offered else "no"])


def main() -> None:
    """Print a row for each hidden heat and seed, and for nothing hidden."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--seeds", type=int, nargs="+", default=[1, 2])
    parser.add_argument("--only", default="", help="part of a hidden heat's name")
    given = parser.parse_args()
    print(
        "hidden | seed | without it | held out [K] | goes with | error [W] | in band | with it [K] | offered",
        flush=True,
    )
    cases: dict[str, Hidden | None] = {**HIDDEN, "nothing": None}
    for name, hidden in cases.items():
        for seed in given.seeds:
            if given.only in name:
                print(_row(name, seed, hidden), flush=True)


if __name__ == "__main__":
    main()
