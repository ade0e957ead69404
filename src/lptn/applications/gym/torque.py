"""Torque under temperature limits as a reinforcement-learning problem: one robot, or many stepped at once."""

from __future__ import annotations

from math import ceil
from typing import Any

import casadi as ca
import gymnasium
import numpy as np
import numpy.typing as npt
from gymnasium import spaces
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from lptn.basics.arrays import FloatArray
from lptn.basics.errors import InputError
from lptn.model.array_function import ArrayFunction
from lptn.model.model import Model
from lptn.planners.heating import Request, heating
from lptn.planners.values import Each, limits_of
from lptn.simulate.dynamics import longest_step

from .task import Task, rated_load

Array = npt.NDArray[Any]
Observation = npt.NDArray[np.float32]
UNIT = 10.0  # K, in which temperatures are observed
AHEAD = (60.0, 300.0, 1200.0)
"""Seconds over which what will be asked is observed as its RMS: a mission is known before it begins."""
LARGEST = 100.0  # of an observation: 1000 K, or a hundred times what could be given for ever
HOT = 100.0  # degC, and inputs at their largest: where rates are near their fastest


class Robots:
    """States of `number` robots under a model.

    Args:
        model: at the values that the robots scatter about.
        number: of robots.
        period: seconds of one `advance`.
        fastest: inputs under which the network is at its fastest, shape (inputs,); largest speeds for one.
        spread: relative standard deviation of each free parameter from robot to robot.

    Attributes:
        states: degC, shape (states, number).
        values: parameters, shape (m, number).
    """

    def __init__(self, model: Model, number: int, period: float, fastest: FloatArray, spread: float = 0.0) -> None:
        self.model, self._spread = model, spread
        self._free = model.free
        self.states = np.full((len(model.states), number), 25.0)
        self.values = np.repeat(model.values[:, None], number, axis=1)
        longest = longest_step(model, np.full(len(model.states), HOT), fastest, model.values)
        self._steps = max(1, ceil(period / longest))
        self._advance = ArrayFunction(_steps(model, self._steps), number, (3,))
        self._period = period / self._steps

    def draw(self, robot: int, temperature: float, rng: np.random.Generator) -> None:
        """Begin anew with one robot.

        Args:
            robot: its number.
            temperature: of all its states [degC].
            rng: draws its parameters.
        """
        self.states[:, robot] = temperature
        self.values[:, robot] = self.model.values
        if self._spread > 0:
            # Capacities, resistances and coefficients are positive: their logarithms scatter.
            self.values[self._free, robot] *= np.exp(self._spread * rng.standard_normal(len(self._free)))

    def advance(self, inputs: FloatArray) -> None:
        """One period with the inputs held, shape (inputs, number)."""
        self.states = np.array(self._advance(self.states, inputs, self.values, [self._period]))


def _steps(model: Model, number: int) -> ca.Function:
    """(x, u, p, h) -> x after so many steps of h seconds."""
    sizes = (len(model.states), len(model.inputs), len(model.parameters), 1)
    x, u, p, h = (ca.MX.sym(name, size) for name, size in zip("xuph", sizes, strict=True))
    end = model.run(number)(x, ca.repmat(u, 1, number), p, h)[:, -1]
    return ca.Function("period", [x, u, p, h], [ca.densify(end)])


class TorqueVectorEnv(VectorEnv[Observation, Array, Array]):
    r"""Robots that are asked for more than they can give for ever; an action says how much of it each joint gives.

    *Action*: share of the asked torque for each joint, 0 to 1. *Observation*: `names` tells each number: what limited
    nodes have left and how far other states are above the air, in tens of kelvins; what is asked now and, as RMS, over
    the next 1, 5 and 20 min, over what could be given for ever; the share of the episode that is left. *Reward*: the
    mean over the joints of :math:`(q^2 - (q - g)^2) / r^2`, asked q, given g, r what could be given for ever: all that
    is asked is worth its square, and the last bit of it least. *Cost* (`info["cost"]`, no part of the reward unless
    `penalty` says so): how far the hottest node is above its limit [K]. At `trip` above a limit the drives cut out and
    the episode is over.

    Args:
        num_envs: robots.
        model: of the robots; its inputs must hold torques or currents.
        limits: degC by node or pattern.
        task: what is asked.
        period: seconds of a step.
        spread: relative standard deviation of each free parameter from episode to episode, for policies that are to
            work on a robot that the model doesn't match.
        trip: kelvins above a limit at which the episode is over.
        penalty: by how much a kelvin above a limit lowers the reward of a step.
        request: `"torque"` or `"current"`; by default what the model's log columns hold.

    Attributes:
        asked: torques [N·m] or currents [A] of the robots' episodes, shape (num_envs, steps + 1, joints).
        conditions: the model's other inputs in them, shape (num_envs, steps + 1, conditions).
        rated: what each joint could give for ever, shape (joints,).

    Raises:
        InputError: no torque or current among the model's inputs, an unknown place, a condition without a range.
    """

    def __init__(
        self,
        num_envs: int = 1,
        *,
        model: Model,
        limits: Each,
        task: Task | None = None,
        period: float = 5.0,
        spread: float = 0.0,
        trip: float = 10.0,
        penalty: float = 0.0,
        request: Request | None = None,
    ) -> None:
        if not period > 0 or spread < 0 or trip <= 0 or penalty < 0:
            values = f"{period:g}, {spread:g}, {trip:g}, {penalty:g}"
            raise InputError("environment", "period, spread, trip, penalty", values, "positive numbers")
        self.num_envs, self.period, self.trip, self.penalty = num_envs, period, trip, penalty
        self.task = task or Task()
        self.heating = heating(model, request)
        if self.heating.request != (held := heating(model).request):
            expected = f'"{held}", which the model\'s columns hold'
            raise InputError("environment", "request", f'"{request}"', expected)
        bounds = limits_of(limits, model)
        self._ranges = self.task.ranges(self.heating)
        self.rated = rated_load(self.heating, bounds, self._ranges)
        self._limited = np.array([model.places.index(node) for node in bounds])
        self._limits = np.array(list(bounds.values()))
        self._free = np.setdiff1d(np.arange(len(model.states)), self._limited)
        air = [k for k, column in enumerate(self.heating.conditions) if column.startswith("temperature.")]
        self._air = air[0] if air else None
        heat = self.heating
        driven = ca.Function("driven", [heat.x, heat.amount, heat.d, heat.p], [ca.densify(heat.inputs)])
        self._inputs = ArrayFunction(driven, num_envs)
        hot, most = np.full(len(model.states), HOT), self.task.load[1] * self.rated
        largest = driven(hot, most, self._ranges[:, 1], model.values).full().ravel()
        self.robots = Robots(model, num_envs, period, largest, spread)
        self.steps = max(1, round(self.task.seconds / period))
        self._random = [np.random.default_rng() for _ in range(num_envs)]
        self.asked = np.zeros((num_envs, self.steps + 1, len(self.rated)))
        self.conditions = np.zeros((num_envs, self.steps + 1, len(self._ranges)))
        self._sums = np.zeros((num_envs, self.steps + 2, len(self.rated)))
        self._step = np.zeros(num_envs, dtype=int)
        self._over = np.ones(num_envs, dtype=bool)
        self.single_observation_space = spaces.Box(-LARGEST, LARGEST, (len(self.names),), np.float32)
        self.single_action_space = spaces.Box(0.0, 1.0, (len(self.rated),), np.float32)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.metadata = {"autoreset_mode": AutoresetMode.NEXT_STEP, "render_modes": []}

    @property
    def names(self) -> list[str]:
        """What each number of an observation is."""
        model = self.robots.model
        joints = self.heating.joints
        return [
            *(f"margin.{model.places[k]}" for k in self._limited),
            *(f"rise.{model.states[k]}" for k in self._free),
            *(f"asked.{joint}" for joint in joints),
            *(f"asked_{seconds:g}s.{joint}" for seconds in AHEAD for joint in joints),
            "left",
        ]

    def reset(
        self, *, seed: int | list[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Begin new episodes on all robots.

        Args:
            seed: draws tasks, temperatures and parameters, of one robot each; a number stands for itself and those
                behind it. The same seed gives the same episode in any number of robots.
            options: `{"reset_mask": …}` begins anew with those robots only.
        """
        super().reset(seed=seed if isinstance(seed, int) else None, options=options)
        seeds = seed if isinstance(seed, list) else [None if seed is None else seed + k for k in range(self.num_envs)]
        mask = np.asarray((options or {}).get("reset_mask", np.ones(self.num_envs, dtype=bool)), dtype=bool)
        for k in np.flatnonzero(mask):
            if seeds[k] is not None:
                self._random[k] = np.random.default_rng(seeds[k])
        self._begin(mask)
        return self._observe(), self._info(np.zeros(self.num_envs))

    def _begin(self, chosen: Array) -> None:
        for k in np.flatnonzero(chosen):
            rng = self._random[k]
            asked, conditions = self.task.draw(rng, self.heating, self.rated, self._ranges, self.period)
            air = 25.0 if self._air is None else float(conditions[0, self._air])
            self.robots.draw(int(k), air + rng.uniform(*self.task.start), rng)
            # One row more than there are steps: what is seen at the end, where nothing is asked.
            self.asked[k, :-1] = asked
            self.conditions[k, :-1], self.conditions[k, -1] = conditions, conditions[-1]
            self._sums[k, 1:-1] = np.cumsum(asked**2, axis=0)
            self._sums[k, -1] = self._sums[k, -2]
        self._step[chosen], self._over[chosen] = 0, False

    def step(self, actions: Array) -> tuple[Observation, Array, Array, Array, dict[str, Any]]:
        """One period on all robots; one whose episode was over begins the next one instead."""
        began = self._over.copy()
        rows = np.arange(self.num_envs)
        asked = self.asked[rows, self._step]
        share = np.clip(np.nan_to_num(np.asarray(actions, dtype=float)), 0.0, 1.0)
        amounts, conditions = (share * asked).T, self.conditions[rows, self._step].T
        self.robots.advance(np.asarray(self._inputs(self.robots.states, amounts, conditions, self.robots.values)))
        cost = np.maximum((self.robots.states[self._limited] - self._limits[:, None]).max(axis=0), 0.0)
        reward = (asked**2 * share * (2 - share) / self.rated**2).mean(axis=1) - self.penalty * cost
        self._step += 1
        terminated, truncated = cost >= self.trip, self._step >= self.steps
        if began.any():
            self._begin(began)
            for array in (cost, reward, terminated, truncated):
                array[began] = 0
        self._over = terminated | truncated
        return self._observe(), reward, terminated, truncated, self._info(cost)

    def _info(self, cost: Array) -> dict[str, Any]:
        every = np.ones(self.num_envs, dtype=bool)
        return {"cost": cost, "_cost": every, "temperature": self.robots.states.T.copy(), "_temperature": every}

    def _observe(self) -> Observation:
        states, rows = self.robots.states, np.arange(self.num_envs)
        air = 25.0 if self._air is None else self.conditions[rows, self._step.clip(max=self.steps), self._air]
        parts = [
            (self._limits[:, None] - states[self._limited]).T / UNIT,
            (states[self._free] - air).T / UNIT,
            self.asked[rows, self._step] / self.rated,
        ]
        for seconds in AHEAD:
            steps = max(1, round(seconds / self.period))
            until = np.minimum(self._step + steps, self.steps)
            mean = (self._sums[rows, until] - self._sums[rows, self._step]) / steps
            parts.append(np.sqrt(mean.clip(min=0.0)) / self.rated)
        parts.append(1 - self._step[:, None] / self.steps)
        return np.concatenate(parts, axis=1).clip(-LARGEST, LARGEST).astype(np.float32)


class TorqueEnv(gymnasium.Env[Observation, Array]):
    """One robot: `TorqueVectorEnv` with a single one; arguments, observation, action, reward and cost are its."""

    metadata = {"render_modes": []}  # noqa: RUF012  # gymnasium's own type

    def __init__(self, **options: Any) -> None:
        self.many = TorqueVectorEnv(1, **options)
        self.names = self.many.names
        """What each number of an observation is."""
        self.observation_space, self.action_space = self.many.single_observation_space, self.many.single_action_space

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Begin a new episode."""
        super().reset(seed=seed)
        observation, info = self.many.reset(seed=seed)
        return observation[0], _of_one(info)

    def step(self, action: Array) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """One period."""
        observation, reward, terminated, truncated, info = self.many.step(np.asarray(action)[None])
        return observation[0], float(reward[0]), bool(terminated[0]), bool(truncated[0]), _of_one(info)


def _of_one(info: dict[str, Any]) -> dict[str, Any]:
    return {"cost": float(info["cost"][0]), "temperature": info["temperature"][0]}
