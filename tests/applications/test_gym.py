"""Gymnasium environments on a thermal network: gymnasium's checker, physics against SciPy, many against one."""

from __future__ import annotations

import warnings
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from lptn.basics.errors import InputError
from lptn.model.file import parse_model
from lptn.model.model import Model
from lptn.model.network import Network
from lptn.robots.presets import preset_text
from tests.builders import AMBIENT, effect, link, node

pytest.importorskip("gymnasium")
import gymnasium

from lptn.applications.gym import Task, ThermalWrapper, TorqueEnv, TorqueVectorEnv

LIMIT = 60.0
SHORT = Task(seconds=600.0)


@cache
def quadruped() -> Model:
    return Model(parse_model(preset_text("quadruped"), Path("quadruped.toml")).network)


def one_motor() -> Model:
    """300 J/K behind 10 K/W, 0.2 W/(N·m)²: its heat balance can be written again in a line."""
    loss = effect("copper_loss", "a", resistance=0.2, torque_constant=1.0)
    return Model(Network("one", (node("a", 300.0), AMBIENT), (link("a", "ambient", 10.0),), (loss,)))


def many(number: int, **options: Any) -> TorqueVectorEnv:
    return TorqueVectorEnv(number, model=quadruped(), limits={"*_*": LIMIT}, task=SHORT, **options)


def test_gymnasiums_checker_has_nothing_to_say() -> None:
    from gymnasium.utils.env_checker import check_env

    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(gymnasium.make("lptn/Torque-v0", model=one_motor(), limits=LIMIT).unwrapped)


def test_temperatures_reward_and_cost_are_those_of_a_motor_worked_out_apart() -> None:
    env = TorqueEnv(model=one_motor(), limits=LIMIT, task=Task(load=(1.7, 2.4), rest=0.2), trip=100.0)
    env.reset(seed=4)
    rated = env.many.rated[0]
    middle = 0.5 * (15.0 + 30.0)
    assert rated == pytest.approx(np.sqrt((LIMIT - middle) / 10.0 / 0.2), rel=1e-6)  # for ever, in the middle's air
    air, temperature = env.many.conditions[0, :, 0], float(env.many.robots.states[0, 0])
    hottest = 0.0
    for k in range(env.many.steps):
        torque, share = env.many.asked[0, k, 0], 0.5 + 0.5 * (k % 2)
        heat = 0.2 * (share * torque) ** 2
        rate = lambda _, t, k=k, heat=heat: (heat - (t - air[k]) / 10.0) / 300.0  # noqa: E731
        temperature = float(solve_ivp(rate, (0.0, 5.0), [temperature], rtol=1e-9).y[0, -1])
        _, reward, _, _, info = env.step(np.array([share], dtype=np.float32))
        assert info["temperature"][0] == pytest.approx(temperature, abs=1e-4)
        assert reward == pytest.approx((torque**2 - (torque - share * torque) ** 2) / rated**2, rel=1e-5)
        assert info["cost"] == pytest.approx(max(0.0, temperature - LIMIT), abs=1e-4)
        hottest = max(hottest, temperature)
    assert hottest > LIMIT + 1  # or the cost was never looked at


def test_many_robots_are_each_the_robot_of_its_seed() -> None:
    batch, action = many(3, spread=0.05), np.full((3, 12), 0.7, dtype=np.float32)
    seen, _ = batch.reset(seed=10)
    for k in range(3):
        one = TorqueEnv(model=quadruped(), limits={"*_*": LIMIT}, task=SHORT, spread=0.05)
        first, _ = one.reset(seed=10 + k)
        np.testing.assert_array_equal(first, seen[k])
    for _ in range(20):
        last, reward, *_ = batch.step(action)
        there, single, *_ = one.step(action[0])
    np.testing.assert_allclose(there, last[2], rtol=1e-6, atol=1e-6)
    assert single == pytest.approx(reward[2])


def test_an_episode_ends_in_time_and_the_next_one_begins_at_the_next_step() -> None:
    env = gymnasium.make_vec(
        "lptn/Torque-v0", num_envs=2, vectorization_mode="vector_entry_point",
        model=one_motor(), limits=LIMIT, task=Task(seconds=50.0),
    )  # fmt: skip
    env.reset(seed=0)
    nothing = np.zeros((2, 1), dtype=np.float32)
    ends = [env.step(nothing)[3].all() for _ in range(10)]
    assert ends == [False] * 9 + [True]
    seen, reward, terminated, truncated, _ = env.step(nothing + 1)
    assert not terminated.any()
    assert not truncated.any()
    assert reward.tolist() == [0, 0]
    assert seen[:, -1].tolist() == [1, 1]  # all of the episode is left


def test_drives_that_cut_out_end_the_episode_and_work_is_never_worth_less_than_none() -> None:
    env = TorqueEnv(model=one_motor(), limits=30.0, task=Task(load=(3.0, 5.0), rest=0.0), trip=2.0)
    env.reset(seed=1)
    rewards, over = [], False
    while not over:
        _, reward, terminated, truncated, info = env.step(np.ones(1, dtype=np.float32))
        rewards.append(reward)
        over = terminated or truncated
    assert terminated
    assert info["cost"] >= 2.0
    assert min(rewards) >= 0.0


def test_what_is_observed_is_named() -> None:
    env = many(1)
    seen, info = env.reset(seed=0)
    assert (len(env.names),) == seen.shape[1:] == env.single_observation_space.shape
    observed = dict(zip(env.names, seen[0].tolist(), strict=True))
    calf = quadruped().nodes.index("FR_calf")
    assert observed["margin.FR_calf"] == pytest.approx((LIMIT - info["temperature"][0, calf]) / 10.0, abs=1e-5)
    assert observed["asked.FR_calf"] == pytest.approx(env.asked[0, 0, 2] / env.rated[2], rel=1e-6)
    ahead = np.sqrt((env.asked[0, :60, 2] ** 2).mean()) / env.rated[2]
    assert observed["asked_300s.FR_calf"] == pytest.approx(ahead, rel=1e-6)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"limits": {"*_tail": 60.0}}, "no such place"),
        ({"limits": 60.0, "period": 0.0}, "positive numbers"),
        ({"limits": 60.0, "request": "current"}, 'expected "torque"'),
        ({"limits": 60.0, "task": Task(conditions={"wind.*": (0.0, 1.0)})}, "no such column"),
    ],
)
def test_a_mistake_is_one_line(options: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        TorqueEnv(model=one_motor(), **options)
    with pytest.raises(InputError, match="two rising numbers"):
        Task(load=(2.0, 1.0))


# --- the wrapper -----------------------------------------------------------------------------------


class Pushed(gymnasium.Env[Any, Any]):
    """A joint that gives the torque it is asked for."""

    observation_space = gymnasium.spaces.Box(-1.0, 1.0, (1,), np.float32)
    action_space = gymnasium.spaces.Box(-20.0, 20.0, (1,), np.float32)
    torque = 0.0

    def reset(self, *, seed: int | None = None, options: Any = None) -> Any:
        super().reset(seed=seed)
        return np.zeros(1, dtype=np.float32), {}

    def step(self, action: Any) -> Any:
        self.torque = float(action[0])
        return np.zeros(1, dtype=np.float32), 0.5, False, False, {"other": 1}


def wrapped(**options: Any) -> ThermalWrapper:
    columns = lambda env: {"torque.a": env.unwrapped.torque}  # noqa: E731
    return ThermalWrapper(Pushed(), model=one_motor(), limits=LIMIT, columns=columns, seconds=0.1, **options)


def test_a_wrapped_robot_is_as_warm_as_its_torques_make_it() -> None:
    env = wrapped(start=(40.0, 50.0), faster=10.0)
    seen, info = env.reset(seed=3)
    began = info["temperature"][0]
    assert 40.0 < began < 50.0
    assert seen[1] == pytest.approx((LIMIT - began) / 10.0, abs=1e-5)
    for k in range(600):
        seen, reward, *_, info = env.step(np.array([12.0 * (-1) ** k]))  # its sign doesn't matter, its square does
    settled, tau = 25.0 + 10.0 * 0.2 * 144.0, 3000.0
    expected = settled + (began - settled) * np.exp(-600 * 0.1 * 10.0 / tau)
    assert info["temperature"][0] == pytest.approx(expected, abs=1e-3)
    assert info["cost"] == pytest.approx(max(0.0, expected - LIMIT), abs=1e-3)
    assert info["cost"] > 0
    assert (reward, info["other"]) == (0.5, 1)


def test_a_wrapped_robot_begins_as_warm_as_it_is_told() -> None:
    assert wrapped().reset(options={"temperature": 55.0})[1]["temperature"][0] == 55.0


def test_an_input_that_nobody_tells_is_named() -> None:
    env = ThermalWrapper(Pushed(), model=one_motor(), limits=LIMIT, columns=lambda _: {"velocity.a": 1.0}, seconds=0.5)
    env.reset(seed=0)
    with pytest.raises(InputError, match=r"torque\.a.*no torque\.a"):
        env.step(np.zeros(1))
