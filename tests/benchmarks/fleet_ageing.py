"""A fleet over half a year, some robots of which age: which are told, when, and how far off are the pooled values?

    python -m tests.benchmarks.fleet_ageing --robots 200 --jobs 2

Each robot is a motor of one mass with constants of its own (log-normal, 8 %), worked hard for 24 min on a day of each
month; days differ by 2 %. Ten age in three ways from the third month on: paste that dries (a resistance to the air that
grows by a half), a bearing (friction that doubles), a sensor that drifts by 3 K. The truth is solved by hand, here.
Printed: what `lptn fleet` tells of whom, the first day on which it would have, false alarms, errors against truth.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import date, timedelta
from pathlib import Path

import numpy as np

from lptn.fleet import Fleet, FleetParameter, RobotValue, fit_each
from tests.fleet.truth import CAPACITY, RESISTANCE
from tests.fleet.truth import MODEL as ONE_MASS

MODEL = f"""{ONE_MASS}
[[effects]]
kind = "coulomb_friction"
at = "motor"

[[effects]]
kind = "sensor_offset"
at = "motor"
"""
FRICTION = 0.5  # N·m: the fleet's median, as CAPACITY and RESISTANCE are
WINDING, GAIN = 0.15, 0.84  # ohm, N·m/A
STEP, HOLD, STEPS = 4.0, 30, 360  # s; steps that a load is held; steps of a day
WAYS = {
    "dry": "resistance.ambient~motor",
    "bearing": "coulomb_friction.torque.motor",
    "sensor": "sensor_offset.offset.motor",
}
START, MONTHS = date(2026, 1, 1), 7


@dataclass
class Motor:
    """A robot's constants on a day."""

    capacity: float
    resistance: float
    friction: float
    offset: float = 0.0

    def write(self, path: Path, rng: np.random.Generator) -> None:
        """A day's log: random torques and speeds, each held for two minutes, a quarter of them at rest."""
        holds = STEPS // HOLD
        torque = (rng.uniform(2.0, 12.0, holds) * (rng.random(holds) > 0.25)).repeat(HOLD)
        speed = (rng.uniform(-10.0, 10.0, holds) * (rng.random(holds) > 0.25)).repeat(HOLD)
        air, decay = 20.0 + rng.uniform(-3, 3), np.exp(-STEP / (self.capacity * self.resistance))
        heat = WINDING * (torque / GAIN) ** 2 + self.friction * np.abs(speed)
        warm = np.empty(STEPS)
        now = air
        for k in range(STEPS):
            warm[k] = now
            balance = air + self.resistance * heat[k]
            now = balance + (now - balance) * decay
        read = warm + self.offset + rng.normal(0.0, 0.1, STEPS)
        table = np.column_stack([STEP * np.arange(STEPS), read, torque, speed, np.full(STEPS, air)])
        path.parent.mkdir(parents=True, exist_ok=True)
        names = "time,temperature.motor,torque.motor,velocity.motor,temperature.ambient"
        np.savetxt(path, table, delimiter=",", header=names, comments="", fmt="%.5f")


def write_fleet(folder: Path, robots: int, seed: int) -> tuple[dict[str, str], dict[str, Motor]]:
    """Logs of all robots; which age, and how; and what each is on the last day, but for what days differ by."""
    rng = np.random.default_rng(seed)
    ageing: dict[str, str] = {}
    last: dict[str, Motor] = {}
    for number in range(robots):
        name = f"R{number:03}"
        own = np.array([CAPACITY, RESISTANCE, FRICTION]) * np.exp(rng.normal(0.0, 0.08, 3))
        if number < 10:
            ageing[name] = list(WAYS)[number % 3]
        for month in range(MONTHS):
            capacity, resistance, friction = own
            aged, offset = max(0.0, month - 2) / (MONTHS - 3), 0.0
            match ageing.get(name):
                case "dry":
                    resistance *= 1 + 0.5 * aged
                case "bearing":
                    friction *= 1 + aged
                case "sensor":
                    offset = 3.0 * aged
            last[name] = Motor(capacity, resistance, friction, offset)
            days = np.exp(rng.normal(0.0, 0.02, 3))
            day = START + timedelta(days=30 * month)
            today = Motor(capacity * days[0], resistance * days[1], friction * days[2], offset)
            today.write(folder / name / f"walk_{day}.csv", rng)
    return ageing, last


def judged(fleet: Fleet, ageing: dict[str, str], last: dict[str, Motor]) -> None:
    """Print what was told of whom."""
    said = {(one.robot, one.of.name): one for one in fleet.deviations if one.drifts and one.probability > 0.95}
    right = {robot: said.pop((robot, WAYS[way])) for robot, way in ageing.items() if (robot, WAYS[way]) in said}
    for robot, way in ageing.items():
        print(f"{robot} {way}: {right.get(robot, 'not told')}")
    beside = [one for (robot, _), one in said.items() if robot in ageing]
    print(f"{len(right)} of {len(ageing)} told; of these robots another parameter, too: {len(beside)}")
    print(*(f"  {one}" for one in beside), sep="\n")
    others = [str(one) for (robot, _), one in said.items() if robot not in ageing]
    print(f"false alarms: {len(others)} of {len(last) - len(ageing)} robots", *others, sep="\n  ")
    of_motor = {
        "capacity.motor": "capacity",
        WAYS["dry"]: "resistance",
        WAYS["bearing"]: "friction",
        WAYS["sensor"]: "offset",
    }
    for parameter in (one for one in fleet.parameters if one.name in of_motor):
        size = of_motor[parameter.name]
        told = {name: value_and_error(parameter, robot) for name, robot in parameter.robots.items()}
        truth = {name: getattr(motor, size) for name, motor in last.items()}
        off = np.array([value - truth[name] for name, (value, _) in told.items()])
        errors = np.array([error for _, error in told.values()])
        of_day = {
            fleet.robots[outcome.robot].of: outcome.parameters[parameter.name]["value"]
            for outcome in fleet.fitted
            if fleet.robots[outcome.robot].day == START + timedelta(days=30 * (MONTHS - 1))
        }
        alone = [value - truth[name] for name, value in of_day.items()]
        print(
            f"{parameter.name}: off by {rms(off):.2g} {parameter.unit} (the last day's fit alone {rms(alone):.2g}), "
            f"RMS z {rms(off / errors):.2g}"
        )


def rms(values: Sequence[float] | np.ndarray) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(np.square(values))))


def value_and_error(parameter: FleetParameter, robot: RobotValue) -> tuple[float, float]:
    """A robot's value and its standard error in the parameter's unit."""
    value = parameter.value(robot.value)
    return value, robot.error * (parameter.size or value)


def main() -> None:
    """Make the fleet, fit it, judge it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--robots", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=2)
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        model, robots = Path(folder) / "motor.toml", Path(folder) / "robots"
        model.write_text(MODEL, encoding="utf-8")
        ageing, last = write_fleet(robots, given.robots, given.seed)
        started = time.perf_counter()
        fleet = fit_each(model, [robots], jobs=given.jobs)
        print(f"{len(fleet.fitted)} fits, {len(fleet.failed)} failed, {time.perf_counter() - started:.0f} s")
        judged(fleet, ageing, last)


if __name__ == "__main__":
    main()
