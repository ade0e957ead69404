"""When it can be told that a sensor is false, by whoever knows all of a robot but its values."""

from __future__ import annotations

import numpy as np
import pytest

from lptn.basics.arrays import FloatArray
from tests.hardening.plants import AIR, ROBOTS, Plant, told_at

STEP, COUNT = 5.0, 60


def driven(name: str) -> tuple[FloatArray, FloatArray]:
    """True temperatures of a robot of which every value is 10 % off, and its currents."""
    robot = ROBOTS[name]().off_by(0.1, "signs", np.random.default_rng(1))
    plant, temperatures = Plant(robot, AIR, STEP), []
    currents = np.random.default_rng(2).uniform(0.2, 0.6, (COUNT, len(robot.driven))) * robot.asked
    for row in currents:
        temperatures.append(plant.temperature)
        plant.step(row)
    return np.array(temperatures), currents


@pytest.mark.parametrize("name", ["knee", "motor", "leg"])
def test_what_a_sound_robot_may_read_is_never_told(name: str) -> None:
    readings, currents = driven(name)
    assert told_at(ROBOTS[name](), 0.1, AIR, STEP, 0.1, readings, currents) == COUNT


@pytest.mark.parametrize("name", ["knee", "motor", "leg"])
@pytest.mark.parametrize("rate", [0.02, -0.02])
def test_the_faster_a_drift_the_sooner_it_is_told(name: str, rate: float) -> None:
    true, currents = driven(name)
    drift = rate * STEP * np.arange(COUNT)[:, None]
    told = [told_at(ROBOTS[name](), 0.1, AIR, STEP, 0.1, true + by * drift, currents) for by in (2.0, 5.0)]
    assert 1 <= told[1] < told[0] < COUNT
    assert told[0] <= told_at(ROBOTS[name](), 0.2, AIR, STEP, 0.1, true + 2 * drift, currents)
