"""Gymnasium's pendulums with a motor that warms up, against the heat balance of one node in closed form."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from lptn.basics.errors import InputError
from lptn.model.model import Model
from lptn.model.network import Network
from tests.builders import AMBIENT, effect, link, node

pytest.importorskip("gymnasium")
import gymnasium

from lptn.batch.gym import ThermalVectorWrapper

AIR, LIMIT, SECONDS = 20.0, 60.0, 5.0
ERRORS = {"capacity.a": 30.0, "resistance.a~ambient": 1.0}


def _motor(errors: dict[str, float] | None = None) -> Model:
    """300 J/K behind 10 K/W, 0.2 W/(N·m)²."""
    loss = effect("copper_loss", "a", resistance=0.2, torque_constant=1.0)
    return Model(Network("one", (node("a", 300.0), AMBIENT), (link("a", "ambient", 10.0),), (loss,)), errors)


def _inputs(env: Any) -> Any:
    """Air and the pendulums' torques [N·m], in the model's order."""
    return np.array([[AIR, one.unwrapped.last_u or 0.0] for one in env.unwrapped.envs])


def _pendulums(number: int = 3, steps: int = 200, model: Model | None = None, **options: Any) -> ThermalVectorWrapper:
    env = gymnasium.make_vec("Pendulum-v1", number, vectorization_mode="sync", max_episode_steps=steps)
    chosen: dict[str, Any] = {"inputs": _inputs, "limits": LIMIT, "seconds": SECONDS, "start": (AIR, AIR)} | options
    return ThermalVectorWrapper(env, model=model or _motor(), **chosen)


def _one(temperature: Any, torque: float, steps: int) -> Any:
    settles = AIR + 0.2 * torque**2 * 10.0
    return settles + (temperature - settles) * np.exp(-steps * SECONDS / 3000.0)


def test_motors_warm_up_as_one_node_does_and_margins_are_seen() -> None:
    env = _pendulums()
    assert _motor().inputs == ["temperature.ambient", "torque.a"]
    observation, _ = env.reset(seed=1)
    assert env.observation_space.contains(observation)
    torques = np.array([2.0, 1.0, 0.0], dtype=np.float32)
    for _ in range(50):
        observation, _, _, _, info = env.step(torques[:, None])
    expected = np.array([_one(AIR, torque, 50) for torque in torques])
    np.testing.assert_allclose(info["temperature"][:, 0], expected, rtol=1e-9)
    np.testing.assert_allclose(observation[:, 3], (LIMIT - expected) / 10.0, rtol=1e-6)
    assert env.observation_space.contains(observation)
    np.testing.assert_array_equal(info["cost"], 0.0)


def test_torque_is_taken_back_below_the_limit() -> None:
    env = _pendulums(derated={"a": 0}, start=(55.0, 55.0))
    env.reset(seed=1)
    given = np.full((3, 1), 2.0, dtype=np.float32)
    env.step(given)
    np.testing.assert_allclose(_inputs(env)[:, 1], 0.5 * 2.0, rtol=1e-6)
    np.testing.assert_array_equal(given, 2.0)
    hot = _pendulums(derated={"a": 0}, start=(70.0, 70.0))
    _, info = hot.reset(seed=1)
    np.testing.assert_allclose(info["cost"], 10.0)
    hot.step(given)
    np.testing.assert_array_equal(_inputs(hot)[:, 1], 0.0)


def test_a_new_episode_begins_with_another_robot() -> None:
    env = _pendulums(4, steps=3, model=_motor(ERRORS), start=(20.0, 50.0), spread=1.0)
    _, info = env.reset(seed=5)
    begun = info["temperature"][:, 0]
    assert np.ptp(begun) > 1.0
    idle = np.zeros((4, 1), dtype=np.float32)
    for step in range(3):
        _, _, _, truncated, info = env.step(idle)
        assert truncated.all() == (step == 2)
    cooled = (info["temperature"][:, 0] - AIR) / (begun - AIR)
    assert (cooled < 1.0).all()
    assert np.ptp(np.log(cooled)) > 1e-4  # time constants of their own
    _, _, _, _, info = env.step(idle)  # in which the pendulums begin anew
    assert (np.abs(info["temperature"][:, 0] - begun) > 1e-6).all()
    again = _pendulums(4, steps=3, model=_motor(ERRORS), start=(20.0, 50.0), spread=1.0)
    np.testing.assert_array_equal(again.reset(seed=5)[1]["temperature"][:, 0], begun)


def test_mistakes_are_said() -> None:
    with pytest.raises(InputError, match="derated: knee: found no such joint; expected some of a"):
        _pendulums(derated={"knee": 0})
    with pytest.raises(InputError, match="spread: found no standard errors; expected a fitted model"):
        _pendulums(spread=1.0)
