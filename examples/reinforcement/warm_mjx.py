# %% [markdown]
# # An environment of MJX whose motors warm up
#
# `WarmEnv` goes around an environment with the interface of MuJoCo Playground: `reset(rng)` and `step(state, action)`,
# a state with `data`, `obs`, `reward`, `done` and `info`. It is of one robot; `jax.vmap` makes it of thousands, each
# with parameters of its own. `heat` is a module that `lptn export fitted.toml --to jax --limit 80` wrote.
#
# `python examples/reinforcement/warm_mjx.py` counts the steps of a leg that stands. It wants `pip install mujoco-mjx
# 'lptn[jax]'`.

# %%
from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import ModuleType
from typing import Any

import jax
import jax.numpy as jnp
import mujoco
from mujoco import mjx


class WarmEnv:
    """An environment with a thermal network beside its robot.

    The observation, or each array of it, grows by the margins to the limits, `(limit - T)/10 K`; the torques asked by
    the action are derated; the reward loses what the hottest place is above its limit, and `beyond` it the episode is
    over. `info` has the state of the network and the robot's parameters.

    Args:
        env: the environment.
        heat: a module that `lptn export --to jax` wrote, or `lptn.batch.functions` made.
        inputs: reads the network's inputs from the environment's state after a step, shape (inputs,). Its data are of
            the last physics step: exact for torques that are held; where a PD loop changes them, let the environment
            put the root of their mean square into `info`.
        seconds: by which a step warms the robot; more than it simulates lets thermal time pass faster.
        derated: which number of an action is the torque of which joint, or a share of it. Empty where actions are joint
            targets, as of Playground's Go1 and Spot, which no scale makes less work: there derate what the PD gives.
        start: coldest and hottest beginning [degC].
        errors: by which robots' parameters scatter: `heat.STANDARD_ERRORS` of a fit, or a tenth of `heat.VALUES`.
        price: of a kelvin above a limit, in units of the reward.
        beyond: K above a limit at which an episode is over.
    """

    def __init__(
        self, env: Any, heat: ModuleType, inputs: Callable[[Any], jax.Array], seconds: float, *,
        derated: Mapping[str, int], start: tuple[float, float], errors: Sequence[float], price: float = 1.0,
        beyond: float = 5.0,
    ) -> None:  # fmt: skip
        self.env, self.heat, self.inputs, self.seconds = env, heat, inputs, seconds
        self.start, self.errors, self.price, self.beyond = start, errors, price, beyond
        self.actions = jnp.array(list(derated.values()), dtype=int)
        self.joints = jnp.array([heat.JOINTS.index(joint) for joint in derated], dtype=int)

    def __getattr__(self, name: str) -> Any:
        return getattr(self.env, name)

    @property
    def observation_size(self) -> Any:
        """Of one robot, as Playground has it: a number, or the shape of each array."""
        seen = jax.eval_shape(self.reset, jax.random.PRNGKey(0)).obs
        return {name: own.shape for name, own in seen.items()} if isinstance(seen, Mapping) else seen.shape[-1]

    def reset(self, rng: jax.Array) -> Any:
        """A robot of its own, warm by chance."""
        rng, of_env = jax.random.split(rng)
        state = self.env.reset(of_env)
        return self._seen(state.replace(info=state.info | self._begun(rng)))

    def step(self, state: Any, action: jax.Array) -> Any:
        """One step of the environment with the torques that are given, and of the network.

        Where the episode is over, `info` has another robot's network already: Playground's wrapper that begins anew
        leaves `info` as it is. One that is over by time alone goes on as warm as it is.
        """
        info = {name: state.info[name] for name in ("heat", "heat_params", "heat_rng")}
        scale = self._outputs(info)["torque_scale"][self.joints]
        state = self.env.step(state, action.at[self.actions].multiply(scale))
        info["heat"] = self.heat.step(info["heat"], self.inputs(state), info["heat_params"], self.seconds)
        state = self._seen(state.replace(info=state.info | info))
        over = -self._outputs(info)["margins"].min()
        done = jnp.maximum(state.done, (over > self.beyond).astype(state.done.dtype))
        begun = self._begun(jax.random.fold_in(info["heat_rng"], 0))
        info = jax.tree.map(lambda new, old: jnp.where(done > 0, new, old), begun, info)
        reward = state.reward - self.price * jnp.maximum(over, 0.0)
        return state.replace(reward=reward, done=done, info=state.info | info)

    def _begun(self, rng: jax.Array) -> dict[str, Any]:
        rng, of_params, of_start = jax.random.split(rng, 3)
        params = self.heat.randomized(of_params, jnp.asarray(self.heat.VALUES), errors=self.errors)
        low, high = self.start
        heat = self.heat.initial(params, jax.random.uniform(of_start, minval=low, maxval=high))
        return {"heat": heat, "heat_params": params, "heat_rng": rng}

    def _outputs(self, info: dict[str, Any]) -> dict[str, jax.Array]:
        nothing = jnp.zeros(len(self.heat.INPUTS))  # on which no margin depends
        return self.heat.outputs(info["heat"], nothing, info["heat_params"])

    def _seen(self, state: Any) -> Any:
        margins = (self._outputs(state.info)["margins"] / 10.0).clip(-10.0, 10.0)
        return state.replace(obs=jax.tree.map(lambda own: jnp.concatenate([own, margins]), state.obs))


# %% [markdown]
# ## A leg that stands
#
# In the place of an environment of Playground: a leg of three joints below a trunk on a vertical slide.

# %%
JOINTS = ("FR_hip", "FR_thigh", "FR_calf")
SUBSTEPS, TORQUE = 5, 20.0  # of the simulator a step, 20 ms; N*m, of an action of 1
LEG = """
<mujoco>
  <compiler angle="radian"/>
  <option timestep="0.004" iterations="2" ls_iterations="4"/>
  <worldbody>
    <geom name="floor" type="plane" size="5 5 .1" contype="1" conaffinity="0"/>
    <body name="trunk" pos="0 0 0.3">
      <joint name="height" type="slide" axis="0 0 1"/>
      <geom type="box" size=".1 .05 .03" mass="4" contype="0" conaffinity="0"/>
      <body pos="0 -.08 0">
        <joint name="FR_hip" axis="1 0 0" armature=".01" damping=".1" range="-.8 .8"/>
        <geom type="sphere" size=".04" mass=".7" contype="0" conaffinity="0"/>
        <body>
          <joint name="FR_thigh" axis="0 1 0" armature=".01" damping=".1" range="-1 3"/>
          <geom type="capsule" fromto="0 0 0 0 0 -.2" size=".02" mass="1" contype="0" conaffinity="0"/>
          <body pos="0 0 -.2">
            <joint name="FR_calf" axis="0 1 0" armature=".01" damping=".1" range="-2.7 -.9"/>
            <geom type="capsule" fromto="0 0 0 0 0 -.2" size=".015" mass=".2" contype="0" conaffinity="0"/>
            <geom type="sphere" pos="0 0 -.2" size=".02" mass=".06" contype="0" conaffinity="1"/>
          </body>
        </body>
      </body>
    </body>
  </worldbody>
  <actuator>
    <motor joint="FR_hip" gear="20"/><motor joint="FR_thigh" gear="20"/><motor joint="FR_calf" gear="20"/>
  </actuator>
</mujoco>
"""


@jax.tree_util.register_dataclass
@dataclasses.dataclass(frozen=True)
class State:
    """Playground's state without its metrics."""

    data: mjx.Data
    obs: jax.Array
    reward: jax.Array
    done: jax.Array
    info: dict[str, Any]

    def replace(self, **changed: Any) -> State:
        """With some of it changed."""
        return dataclasses.replace(self, **changed)


class Leg:
    """Stands, and is paid for holding its trunk at 0.3 m."""

    def __init__(self) -> None:
        self.model = mjx.put_model(mujoco.MjModel.from_xml_string(LEG))

    def reset(self, rng: jax.Array) -> State:
        """Knees bent, a little off."""
        posture = jnp.array([0.0, 0.0, 0.75, -1.5]) + jax.random.uniform(rng, (4,), minval=-0.05, maxval=0.05)
        data = mjx.make_data(self.model).replace(qpos=posture)
        return State(data, jnp.concatenate([data.qpos, data.qvel]), jnp.zeros(()), jnp.zeros(()), {})

    def step(self, state: State, action: jax.Array) -> State:
        """A fiftieth of a second under constant torques."""
        data = state.data.replace(ctrl=action.clip(-1.0, 1.0))
        data = jax.lax.fori_loop(0, SUBSTEPS, lambda _, data: mjx.step(self.model, data), data)
        height = 0.3 + data.qpos[0]
        done = (height < 0.1).astype(state.done.dtype)
        obs = jnp.concatenate([data.qpos, data.qvel])
        return state.replace(data=data, obs=obs, reward=1.0 - 10.0 * jnp.abs(height - 0.3), done=done)


class Still(Leg):
    """Stays as it is: what is left of a step is heat."""

    def step(self, state: State, action: jax.Array) -> State:
        """Nothing."""
        return state.replace(obs=jnp.concatenate([state.data.qpos, state.data.qvel]))


def warm_leg(env: Leg, model: Any) -> WarmEnv:
    """The leg with a network; a second of heat in each step of 20 ms."""
    import lptn.batch

    heat = lptn.batch.functions(model, "jax", limits=60.0)
    torques = jnp.array([heat.INPUTS.index(f"torque.{joint}") for joint in JOINTS])
    air = jnp.zeros(len(heat.INPUTS)).at[heat.INPUTS.index("temperature.ambient")].set(25.0)
    return WarmEnv(
        env, heat, lambda state: air.at[torques].set(state.data.qfrc_actuator[1:4]), seconds=1.0,
        derated={joint: number for number, joint in enumerate(JOINTS)}, start=(25.0, 55.0),
        errors=[0.1 * value for value in heat.VALUES],
    )  # fmt: skip


def stands(obs: jax.Array) -> jax.Array:
    """An action that holds the posture."""
    asked = 80.0 * (jnp.array([0.0, 0.75, -1.5]) - obs[1:4]) - 2.0 * obs[5:8]
    return (asked / TORQUE).clip(-1.0, 1.0)


def rollout(env: Any, robots: int, steps: int) -> Callable[[jax.Array], State]:
    """A compiled function of a key: so many robots that stand for so many steps."""

    def run(key: jax.Array) -> State:
        state = jax.vmap(env.reset)(jax.random.split(key, robots))
        one = lambda state, _: (jax.vmap(lambda state: env.step(state, stands(state.obs)))(state), None)  # noqa: E731
        return jax.lax.scan(one, state, None, length=steps)[0]

    return jax.jit(run)


# %% [markdown]
# What heat takes of a step: the leg without a network beside the network with a leg that stays as it is, in CPU time.


# %%
def main(robots: int = 1024, steps: int = 50) -> State:
    """Stand, count; the state at the end."""
    from lptn.model.file import parse_model
    from lptn.model.model import Model
    from lptn.robots.presets import preset_text

    model = Model(parse_model(preset_text("leg"), Path("leg.toml")).network)
    runs = [rollout(env, robots, steps) for env in (Leg(), warm_leg(Still(), model), warm_leg(Leg(), model))]
    seconds = []
    for run in runs:
        jax.block_until_ready(run(jax.random.key(0)))  # compiles
        began = time.process_time()
        state = jax.block_until_ready(run(jax.random.key(0)))
        seconds.append(time.process_time() - began)
    plain, heat, both = (f"{robots * steps / each:.2g}" for each in seconds)
    share = seconds[1] / (seconds[0] + seconds[1])
    print(f"{robots} legs: {plain} steps of 20 ms a second of CPU, {both} with heat")
    print(f"heat alone: {heat}, {share:.1%} of a step")
    hottest = state.info["heat"].temperature.max(axis=1)
    print(
        f"after {steps} s of heat the hottest joints are at {hottest.min():.0f} to {hottest.max():.0f} degC, "
        f"trunks at {0.3 + state.data.qpos[:, 0].mean():.2f} m"
    )
    return state


if __name__ == "__main__":
    main()
