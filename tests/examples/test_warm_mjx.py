"""The wrapper for environments of MJX: around one in the place of MuJoCo's, and around its leg where MJX is there."""

from __future__ import annotations

import dataclasses
import sys
from importlib import import_module
from importlib.util import find_spec
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import pytest

from lptn.batch import functions
from lptn.model.model import Model
from lptn.model.network import Network
from tests.builders import AMBIENT, effect, link, node

jax = pytest.importorskip("jax", reason="JAX is not installed: pip install 'lptn[jax]'")
jnp = jax.numpy
HAS_MJX = find_spec("mujoco") is not None and find_spec("mujoco.mjx") is not None
AIR, LIMIT, SECONDS = 20.0, 60.0, 5.0


@pytest.fixture
def example(monkeypatch: pytest.MonkeyPatch) -> Any:
    if not HAS_MJX:
        stand_in = ModuleType("mujoco")
        stand_in.mjx = SimpleNamespace(Data=None, put_model=None)  # type: ignore[attr-defined]
        monkeypatch.setitem(sys.modules, "mujoco", stand_in)
    return import_module("warm_mjx")


@jax.tree_util.register_dataclass
@dataclasses.dataclass
class _State:
    data: Any
    obs: Any
    reward: Any
    done: Any
    info: dict[str, Any]

    def replace(self, **changed: Any) -> _State:
        return dataclasses.replace(self, **changed)


class _Given:
    """Data are the torque that is asked; the episode is over where it is above 9 N*m."""

    def reset(self, rng: Any) -> _State:
        return _State(jnp.zeros(()), jnp.ones(2), jnp.zeros(()), jnp.zeros(()), {"own": jnp.zeros(())})

    def step(self, state: _State, action: Any) -> _State:
        return state.replace(data=action[1], obs=jnp.ones(2), reward=jnp.ones(()), done=(action[1] > 9.0) * 1.0)


def _motor() -> Model:
    """300 J/K behind 10 K/W, 0.2 W/(N·m)²."""
    loss = effect("copper_loss", "a", resistance=0.2, torque_constant=1.0)
    return Model(Network("one", (node("a", 300.0), AMBIENT), (link("a", "ambient", 10.0),), (loss,)))


def _warm(example: Any, start: float, spread: float = 0.0) -> Any:
    heat = functions(_motor(), "jax", limits=LIMIT)
    assert heat.INPUTS == ("temperature.ambient", "torque.a")
    return example.WarmEnv(
        _Given(), heat, lambda state: jnp.array([AIR, state.data]), SECONDS, derated={"a": 1}, start=(start, start),
        errors=[spread * value for value in heat.VALUES], beyond=3.0,
    )  # fmt: skip


def _one(temperature: float, torque: float) -> float:
    settles = AIR + 0.2 * torque**2 * 10.0
    return float(settles + (temperature - settles) * np.exp(-SECONDS / 3000.0))


def test_torque_is_derated_and_what_is_left_warms_the_joint(example: Any) -> None:
    env = _warm(example, 55.0)
    state = env.reset(jax.random.key(0))
    np.testing.assert_allclose(state.obs, [1.0, 1.0, 0.5], rtol=1e-5)
    state = jax.jit(env.step)(state, jnp.array([7.0, 8.0]))
    assert float(state.data) == pytest.approx(4.0, rel=1e-5)  # half of the band is left
    assert float(state.info["heat"].temperature[0]) == pytest.approx(_one(55.0, 4.0), abs=1e-3)
    assert float(state.obs[2]) == pytest.approx((LIMIT - _one(55.0, 4.0)) / 10.0, rel=1e-3)
    assert (float(state.reward), float(state.done)) == (1.0, 0.0)
    assert set(state.info) > {"own", "heat"}


def test_each_array_of_an_observation_has_the_margins_and_targets_are_not_derated(example: Any) -> None:
    class Several(_Given):
        def reset(self, rng: Any) -> _State:
            return super().reset(rng).replace(obs={"state": jnp.ones(2), "privileged_state": jnp.ones(3)})

        def step(self, state: _State, action: Any) -> _State:
            return super().step(state, action).replace(obs={"state": action, "privileged_state": jnp.ones(3)})

    heat = functions(_motor(), "jax", limits=LIMIT)
    env = example.WarmEnv(
        Several(), heat, lambda state: jnp.array([AIR, state.data]), SECONDS, derated={}, start=(59.0, 59.0),
        errors=[0.0 for _ in heat.VALUES],
    )  # fmt: skip
    assert env.observation_size == {"state": (3,), "privileged_state": (4,)}
    state = jax.jit(env.step)(env.reset(jax.random.key(0)), jnp.array([7.0, 8.0]))
    np.testing.assert_allclose(state.obs["state"][:2], [7.0, 8.0])
    np.testing.assert_allclose(state.obs["state"][2], state.obs["privileged_state"][3])


def test_heat_costs_reward_and_ends_the_episode(example: Any) -> None:
    for start, over, done in ((62.0, 2.0, 0.0), (70.0, 10.0, 1.0)):
        env = _warm(example, start)
        state = env.step(env.reset(jax.random.key(0)), jnp.array([0.0, 8.0]))
        assert float(state.data) == 0.0
        assert float(state.reward) == pytest.approx(1.0 - over, abs=0.1)
        assert float(state.done) == done


def test_robots_differ_and_begin_anew_where_an_episode_is_over(example: Any) -> None:
    env = _warm(example, 30.0, spread=0.1)
    state = jax.vmap(env.reset)(jax.random.split(jax.random.key(0), 3))
    before = np.asarray(state.info["heat_params"])
    assert len(np.unique(before[:, 0])) == 3
    torques = jnp.array([[0.0, 5.0], [0.0, 9.5], [0.0, 5.0]])
    after = jax.jit(jax.vmap(env.step))(state, torques)
    np.testing.assert_array_equal(after.done, [0.0, 1.0, 0.0])
    np.testing.assert_array_equal((after.info["heat_params"] != before).any(axis=1), [False, True, False])
    assert float(after.info["heat"].temperature[1, 0]) == 30.0
    assert float(after.obs[1, 2]) < (LIMIT - 30.0) / 10.0  # what was seen at the end is of the robot that ended


@pytest.mark.slow
@pytest.mark.skipif(not HAS_MJX, reason="needs mujoco-mjx")
def test_a_leg_stands_and_warms_up(example: Any) -> None:
    state = example.main(robots=4, steps=20)
    np.testing.assert_allclose(0.3 + state.data.qpos[:, 0], 0.3, atol=0.03)
    assert (state.info["heat"].temperature[:, 2] > 26.0).all()
    assert (state.done == 0.0).all()
