"""Eight hours of walking, climbing and standing: what drives' own limiters keep of the current, beside `TorqueMPC`.

Run it with ``python -m tests.benchmarks.firmware_day --robots 3``. A leg of three motors, each a winding in a housing
(`tests.planners.firmware_truth`: plain NumPy), in air of 35 degC; every parameter of the model is 10 % off, up or down,
and the model is told that as its standard error. Walking takes 0.8, climbing 1.4 and standing 0.5 of the current that
each motor bears for ever when it is alone; in each minute of climbing the peak current is wanted for ten seconds.

Current is torque by a constant. Counted are the share of it that was given, of all and of the bursts, and the hottest
winding of the truth. The rule of thumb is that of data sheets: the nominal current that the motor alone bears in air of
25 degC, and the peak current for as long as it takes the winding from there to its limit.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from lptn.basics.arrays import FloatArray
from lptn.model.model import Model
from lptn.planners.limiter import firmware_kind
from lptn.planners.mpc import TorqueMPC
from tests.planners.firmware_truth import Drive, Motors

LIMIT, AIR, ROOM, PEAK = 105.0, 35.0, 25.0, 3.0  # degC, degC, degC, peak over nominal current
SLOT, SLOTS, NOISE = 5, 8 * 720, 0.1  # s, in eight hours, K
OFF = 0.1  # of each parameter
Admit = Callable[[FloatArray, FloatArray], FloatArray]
"""(wanted currents [A], temperatures of windings and housings) -> currents that flow for one second."""


def leg(seed: int) -> Motors:
    """Motors of robots of some 20 kg."""
    random = np.random.default_rng(seed)

    def scatter(value: float, count: int = 3) -> FloatArray:
        return value * np.exp(0.2 * random.standard_normal(count))

    return Motors(
        scatter(25.0), scatter(350.0), scatter(0.9), scatter(2.0), scatter(4.0, 2), scatter(0.1), 0.0039, 0.006
    )


def alone(motors: Motors, air: float) -> FloatArray:
    """Currents that each motor bears for ever without its neighbours [A]."""
    rise = np.empty(motors.count)
    for k in range(motors.count):
        low, high = air, LIMIT  # of the housing: as much goes into it as it loses
        for _ in range(60):
            middle = 0.5 * (low + high)
            into = (LIMIT - middle) / motors.inside[k]
            lost = (middle - air) * np.exp(motors.beta * (middle - air)) / motors.outside[k]
            low, high = (middle, high) if lost < into else (low, middle)
        rise[k] = (LIMIT - low) / motors.inside[k]
    return np.asarray(np.sqrt(rise / motors.ohms / (1 + motors.alpha * (LIMIT - 25.0))))


def day(motors: Motors, seed: int) -> tuple[FloatArray, np.ndarray]:
    """Wanted currents [A], shape (slots, motors), and which slots are bursts."""
    random = np.random.default_rng(seed)
    wanted: list[float] = []
    burst: list[bool] = []
    while len(wanted) < SLOTS:
        share, minutes = [(0.8, 12), (1.4, 4), (0.5, 6)][int(random.integers(3))]
        for k in range(int(minutes * random.uniform(0.5, 1.5) * 60 / SLOT)):
            burst.append(share > 1 and k % 12 < 2)
            wanted.append(PEAK if burst[-1] else share)
    return np.outer(wanted[:SLOTS], alone(motors, AIR)), np.array(burst[:SLOTS])


def off(motors: Motors, seed: int) -> Model:
    """A model whose every parameter is off, and which knows by how much they may be."""
    random = np.random.default_rng(seed + 1000)
    wrong = {name: getattr(motors, name) * (1 + OFF * random.choice([-1.0, 1.0], len(getattr(motors, name))))
             for name in ("winding", "housing", "inside", "outside", "beside", "ohms")}  # fmt: skip
    return replace(motors, **wrong).model(capacity=OFF, resistance=OFF, copper_loss=OFF)


def firmware(model: Model, peak: FloatArray, sensor: str) -> list[Drive]:
    """Drives with what `lptn plan` says, at any air from 0 to 40 degC."""
    joints = [f"w{k}" for k in range(len(peak))]
    table = {
        "task": {"kind": "firmware", "air": [0.0, 40.0], "burst": 5.0, "warning": 5.0, "delay": 1.0},
        "limits": {"w*": LIMIT},
        "current_limits": dict(zip(joints, peak.tolist(), strict=True)),
        "sensors": {joint: joint.replace("w", sensor) for joint in joints},
    }
    numbers = firmware_kind.run(firmware_kind.read(table, "day", model)).numbers
    return [Drive(n.peak, n.time_constant, n.continuous, n.warning, n.trip, n.restart) for n in numbers.itertuples()]


def by_drives(drives: list[Drive], rows: slice) -> Admit:
    return lambda wanted, T: np.array(
        [
            float(drive.admitted(each, reading, 1.0))
            for drive, each, reading in zip(drives, wanted, T[rows], strict=True)
        ]
    )


def by_mpc(model: Model, peak: FloatArray, seed: int, **settings: float) -> Admit:
    """`TorqueMPC` once a slot, which reads the windings with noise and is not told what comes."""
    limits, joints = {"w*": LIMIT}, [f"w{k}" for k in range(len(peak))]
    most = dict(zip(joints, peak.tolist(), strict=True))
    mpc = TorqueMPC(
        model, limits, request="current", current_limits=most, period=SLOT, horizon=300, noise=NOISE, **settings
    )
    random, order, held, count = np.random.default_rng(seed), [joints.index(j) for j in mpc.joints], peak, 0
    nodes = [(model.nodes.index(j), k) for k, j in enumerate(joints)]

    def admit(wanted: FloatArray, T: FloatArray) -> FloatArray:
        nonlocal held, count
        if count % SLOT == 0:
            readings = np.full(len(model.nodes), np.nan)
            for row, k in nodes:
                readings[row] = T[k] + NOISE * random.standard_normal()
            held = np.empty(len(peak))
            held[order] = mpc.step(readings, wanted[order], {"temperature.ambient": AIR}).admitted
        count += 1
        return held

    return admit


def course(motors: Motors, admit: Admit, wanted: FloatArray, burst: np.ndarray) -> tuple[float, float, float]:
    """Shares of the wanted current that were given, of all and of bursts, and the hottest winding [degC]."""
    T, most, given = np.full(2 * motors.count, AIR), AIR, np.zeros_like(wanted)
    for k, asked in enumerate(wanted):
        for _ in range(SLOT):
            current = np.minimum(np.abs(admit(asked, T)), asked)
            given[k] += current / SLOT
            T = motors.step(T, current**2, AIR, 1.0)
            most = max(most, float(T[: motors.count].max()))
    return given.sum() / wanted.sum(), given[burst].sum() / wanted[burst].sum(), most


def controllers(motors: Motors, seed: int) -> dict[str, Admit]:
    model, peak = off(motors, seed), PEAK * alone(motors, AIR)
    sheet = alone(motors, ROOM)
    heat = motors.ohms * (1 + motors.alpha * (LIMIT / 2 + ROOM / 2 - 25.0)) * peak**2  # at the mean temperature
    times = -motors.inside * motors.winding * np.log1p(-(LIMIT - ROOM) / (motors.inside * heat))
    constants = -times / np.log1p(-((sheet / peak) ** 2))
    on_winding = firmware(model, peak, "w")
    summing = [Drive(drive.peak, drive.time_constant, drive.continuous) for drive in on_winding]
    reading = [replace(drive, time_constant=np.inf, continuous=np.inf) for drive in on_winding]
    windings = slice(0, motors.count)
    return {
        "nothing": lambda wanted, _: wanted,
        "i²t by the rule of thumb": by_drives(
            [Drive(*row) for row in zip(peak, constants, sheet, strict=True)], windings
        ),
        "i²t of `lptn plan`": by_drives(summing, windings),
        "its trip on the winding": by_drives(reading, windings),
        "derating from its warning to its trip": by_drives(
            [replace(drive, derates=True) for drive in reading], windings
        ),
        "`TorqueMPC`": by_mpc(model, peak, seed),
        "`TorqueMPC` that knows all": by_mpc(motors.model(), peak, seed, margin=0.0, model_error=0.0),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--robots", type=int, default=3)
    parser.add_argument("--hours", type=float, default=8.0)
    asked = parser.parse_args()
    rows: dict[str, list[tuple[float, float, float]]] = {}
    for seed in range(asked.robots):
        motors = leg(seed)
        wanted, burst = (part[: int(asked.hours * 3600 / SLOT)] for part in day(motors, seed))
        for name, admit in controllers(motors, seed).items():
            rows.setdefault(name, []).append(course(motors, admit, wanted, burst))
    print("| limiter | current | of bursts | hottest winding |", "| --- | --- | --- | --- |", sep="\n")
    for name, found in rows.items():
        all_of_it, of_bursts, hottest = np.array(found).T
        print(f"| {name} | {all_of_it.mean():.1%} | {of_bursts.mean():.1%} | {hottest.max():.1f} °C |")


if __name__ == "__main__":
    main()
