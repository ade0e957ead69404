"""Thousands of robots in a vector environment of Gymnasium, whose motors warm up; it wants the extra `rl`."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from lptn.applications.gym.torque import LARGEST, UNIT  # first: it says what to install where gymnasium is missing
from lptn.basics.errors import InputError
from lptn.model.model import Model
from lptn.planners.values import Each

from .module import functions

from gymnasium import spaces  # isort: skip
from gymnasium.vector import AutoresetMode, VectorEnv, VectorWrapper  # isort: skip
from gymnasium.vector.utils import batch_space  # isort: skip

Array = npt.NDArray[Any]


class ThermalVectorWrapper(VectorWrapper[Array, Array, Array]):
    """A vector environment with a thermal network beside each robot.

    The observation grows by the margins of limited places, `(limit - T)/10 K`; `info` by `temperature` [degC], shape
    (robots, states), and `cost`, how far the hottest of a robot's places is above its limit [K]. The reward stays as
    it is. A robot whose episode begins is warm by chance, and has parameters of its own.

    Args:
        env: with a `Box` of one dimension as the observation of a robot.
        model: the network.
        limits: degC by node or pattern, or one for all.
        inputs: reads the simulator after a step: the network's inputs in its order, shape (robots, inputs).
        seconds: by which a step warms the robots; more than it simulates lets thermal time pass faster.
        start: coldest and hottest beginning [degC]; every place of a robot is as warm.
        spread: of the robots' parameters, in standard errors of the fit; 0 makes all robots the model.
        derated: which number of an action is the torque of which joint, `{"FR_calf": 2}`: it is multiplied by the
            joint's torque scale, 1 until `band` kelvins below a limit and 0 at it.
        band: K.

    Raises:
        InputError: other observations, an unknown place or joint, or a spread of a model that was never fitted.
    """

    def __init__(
        self,
        env: VectorEnv[Array, Array, Array],
        *,
        model: Model,
        limits: Each,
        inputs: Callable[[VectorEnv[Array, Array, Array]], Array],
        seconds: float,
        start: tuple[float, float] = (25.0, 25.0),
        spread: float = 0.0,
        derated: Mapping[str, int] | None = None,
        band: float = 10.0,
    ) -> None:
        super().__init__(env)
        inner = env.single_observation_space
        if not isinstance(inner, spaces.Box) or len(inner.shape) != 1:
            raise InputError("environment", "single_observation_space", str(inner), "a Box of one dimension")
        self.heat = functions(model, limits=limits)
        if unknown := set(derated or {}) - set(self.heat.JOINTS):
            raise InputError("derated", sorted(unknown)[0], "no such joint", f"some of {', '.join(self.heat.JOINTS)}")
        if spread and not any(self.heat.STANDARD_ERRORS):
            raise InputError(model.network.origin, "spread", "no standard errors", "a fitted model, or a spread of 0")
        self._inputs, self._seconds, self._start, self._spread = inputs, seconds, start, spread
        self._derated = [(self.heat.JOINTS.index(joint), action) for joint, action in (derated or {}).items()]
        self._band = band
        self._nominal = np.tile(self.heat.VALUES, (self.num_envs, 1))
        self._params = self._nominal
        self._state = self.heat.initial(self._nominal, start[0])
        self._rng = np.random.default_rng()
        self._over = np.zeros(self.num_envs, dtype=bool)
        self._mode = env.metadata.get("autoreset_mode", AutoresetMode.NEXT_STEP)
        more = np.full(len(self.heat.LIMITED), LARGEST, dtype=inner.dtype)
        self.single_observation_space = spaces.Box(
            np.concatenate([inner.low, -more]), np.concatenate([inner.high, more]), dtype=inner.dtype.type
        )
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)

    def reset(
        self, *, seed: int | list[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Array, dict[str, Any]]:
        """Begin anew with all robots, or with those of `options={"reset_mask": …}`."""
        observation, info = self.env.reset(seed=seed, options=options)  # type: ignore[arg-type]  # most take a list, too
        if seed is not None:
            self._rng = np.random.default_rng(seed if isinstance(seed, int) else [one or 0 for one in seed])
        mask = (options or {}).get("reset_mask", np.ones(self.num_envs, dtype=bool))
        self._begin(np.asarray(mask, dtype=bool))
        return self._seen(observation), info | self._thermal_info()

    def step(self, actions: Array) -> tuple[Array, Array, Array, Array, dict[str, Any]]:
        """One step of the environment, and of all networks."""
        if self._derated:
            scale = self._outputs()["torque_scale"]
            actions = np.array(actions)
            for joint, number in self._derated:
                actions[:, number] *= scale[:, joint]
        observation, reward, terminated, truncated, info = self.env.step(actions)
        self._state = self.heat.step(self._state, self._inputs(self.env), self._params, self._seconds)
        ended, over = self._over, np.asarray(terminated | truncated)
        if self._mode == AutoresetMode.NEXT_STEP:  # the environment has just begun anew with those that had ended
            self._begin(ended)
        elif self._mode == AutoresetMode.SAME_STEP:
            self._begin(over)
        self._over = over
        return self._seen(observation), reward, terminated, truncated, info | self._thermal_info()

    def _begin(self, mask: Array) -> None:
        chosen, drawn = mask[:, None], self._nominal
        if self._spread:
            drawn = self.heat.randomized(self._rng, self._nominal, self._spread)
        self._params = np.where(chosen, drawn, self._params)
        warm = self.heat.initial(self._params, self._rng.uniform(*self._start, self.num_envs))
        self._state = self.heat.State(*(np.where(chosen, new, old) for new, old in zip(warm, self._state, strict=True)))

    def _outputs(self) -> dict[str, Array]:
        none = np.zeros(len(self.heat.INPUTS))  # on which no margin depends
        return self.heat.outputs(self._state, none, self._params, band=self._band)  # type: ignore[no-any-return]

    def _seen(self, observation: Array) -> Array:
        margins = (self._outputs()["margins"] / UNIT).clip(-LARGEST, LARGEST)
        return np.concatenate([observation, margins.astype(observation.dtype)], axis=1)

    def _thermal_info(self) -> dict[str, Any]:
        every = np.ones(self.num_envs, dtype=bool)
        cost = np.maximum(-self._outputs()["margins"].min(axis=1), 0.0)
        return {"cost": cost, "_cost": every, "temperature": self._state.temperature.copy(), "_temperature": every}
