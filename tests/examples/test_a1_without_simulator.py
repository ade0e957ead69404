"""The parts of the A1 example that need no simulator: governor, limiter, and the reduction of samples."""

from __future__ import annotations

import numpy as np
import pytest

from a1_governor import TALL, Governor, Steps, cut
from a1_task import JOINTS, TORQUE_LIMIT, Command
from a1_thermal import CasadiThermal, Windows, quadruped

LIMIT, SOFT = 60.0, 50.0


def scales(least: float) -> np.ndarray:
    scale = np.ones(12)
    scale[8] = least
    return scale


def test_governor_leaves_a_cool_robot_alone() -> None:
    task = Command("trot", 0.5, 0.27)
    assert Governor(task).command(np.ones(12)) == task


def test_governor_stands_taller_the_hotter_the_hottest_joint_and_slows_down_only_if_told() -> None:
    task = Command("trot", 0.5, 0.27)
    assert {Governor(task).command(scales(least)).speed for least in np.linspace(1.0, 0.11, 40)} == {0.5}
    governor = Governor(task, Steps(slow=(0.2, 0.5)))
    commands = [governor.command(scales(least)) for least in np.linspace(1.0, 0.11, 40)]
    heights, speeds = [c.height for c in commands], [c.speed for c in commands]
    assert heights == sorted(heights)
    assert speeds == sorted(speeds, reverse=True)
    assert heights[-1] == TALL
    assert {c.activity for c in commands} == {"trot"}
    # Height first, and fully, before any speed is lost.
    assert next(c.height for c in commands if c.speed < 0.5) == TALL


def test_governor_rests_until_the_robot_is_well_below_the_limit() -> None:
    governor = Governor(Command())
    course = [0.5, 0.07, 0.3, 0.55, 0.65, 0.3]
    done = [governor.command(scales(least)).activity for least in course]
    assert done == ["trot", "rest", "rest", "rest", "trot", "trot"]


@pytest.mark.parametrize("activity", ["stand", "trot"])
def test_governor_comes_back_to_its_task(activity: str) -> None:
    governor = Governor(Command(activity, 0.0, 0.3))  # type: ignore[arg-type]
    assert governor.command(scales(0.0)).activity == "rest"
    assert governor.command(np.ones(12)) == governor.task


def test_cut_bounds_the_torque_and_keeps_its_sign() -> None:
    torque = np.linspace(-30.0, 30.0, 12)
    limited = cut(torque, np.full(12, 0.25))
    assert np.abs(limited).max() == TORQUE_LIMIT / 4
    assert np.array_equal(np.sign(limited), np.sign(torque))
    assert np.array_equal(cut(torque, np.ones(12)), torque)


def test_windows_keep_the_heat_of_each_sample() -> None:
    columns = ["torque.FR_calf", "velocity.FR_calf", "velocity_rms.RL_hip", "speed.base", "temperature.ambient"]
    columns += ["powered.FL_thigh", "power.pc"]
    windows = Windows(columns, samples=4, ambient=21.0, computer=18.0)
    calf, hip = JOINTS.index("FR_calf"), JOINTS.index("RL_hip")
    torques, velocities = [1.0, -5.0, 2.0, 0.0], [3.0, -1.0, 0.0, 2.0]
    for k in range(4):
        assert not windows.full()
        torque, velocity = np.zeros(12), np.zeros(12)
        torque[calf], velocity[calf], velocity[hip] = torques[k], velocities[k], velocities[k]
        windows.add(torque, velocity, speed=0.25 * k, powered=k < 3)
    assert windows.full()
    expected = [np.sqrt(30 / 4), 6 / 4, np.sqrt(14 / 4), 0.375, 21.0, 0.75, 18.0]
    assert windows.take() == pytest.approx(expected)
    assert not windows.full()


def test_the_scale_falls_from_soft_limit_to_limit() -> None:
    model = quadruped()
    factors = [CasadiThermal(model, start, LIMIT, SOFT).scale for start in (20.0, 50.0, 57.5, 60.0, 70.0)]
    assert [scale.max() for scale in factors] == pytest.approx([1.0, 1.0, 0.25, 0.0, 0.0])
