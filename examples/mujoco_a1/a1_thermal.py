"""The thermal network beside the simulator: the same model run by CasADi or as an FMU, behind one small face."""

from __future__ import annotations

from pathlib import Path
from typing import Protocol

import numpy as np

from a1_task import JOINTS, FloatArray
from lptn.logs.resampling import FEATURES
from lptn.model.file import parse_model
from lptn.model.model import Model
from lptn.robots.presets import preset_text
from lptn.virtual import draw_quadruped
from lptn.virtual.heat import Balance, Exponential


class Thermal(Protocol):
    """A thermal model that is stepped from outside."""

    columns: list[str]
    """Its inputs, as log columns: `torque.FR_calf`, `speed.base`."""

    def advance(self, inputs: FloatArray, dt: float) -> None:
        """Go on by `dt` seconds with the inputs held, in the order of `columns`."""

    @property
    def temperature(self) -> FloatArray:
        """Temperature of each joint [degC], shape (12,)."""

    @property
    def scale(self) -> FloatArray:
        """Share of the peak torque that a thermal limiter would allow each joint, shape (12,), 1 to 0."""


class CasadiThermal:
    """The model's own step function.

    Args:
        model: a model that has the twelve joints as nodes.
        start: temperature of every node at the start [degC].
        limit: temperature that no joint may pass [degC].
        soft: where the limiter begins to act [degC].
    """

    def __init__(self, model: Model, start: float, limit: float, soft: float) -> None:
        self.columns = list(model.inputs)
        self._step, self._values = model.step("rk4"), model.values
        self._state = np.full(len(model.states), start)
        self._joints = [model.states.index(joint) for joint in JOINTS]
        self._limit, self._soft = limit, soft

    def advance(self, inputs: FloatArray, dt: float) -> None:
        """Go on by `dt` seconds with the inputs held."""
        self._state = np.asarray(self._step(self._state, inputs, self._values, dt)).ravel()

    @property
    def temperature(self) -> FloatArray:
        """Temperature of each joint [degC]."""
        return self._state[self._joints]

    @property
    def scale(self) -> FloatArray:
        """1 below the soft limit, 0 at the limit, straight between."""
        return np.clip((self._limit - self.temperature) / (self._limit - self._soft), 0.0, 1.0)


class VirtualThermal:
    """A robot of `lptn.virtual`, whose equations share no code with any model: windings apart from housings, a trunk.

    Args:
        seed: of the robot, whose parameters scatter.
        columns: inputs, those of a model.
        start: temperature of everything at the start [degC].
        limit: temperature that no joint's winding may pass [degC].
        soft: where the limiter begins to act [degC].
        noise: standard deviation of what a sensor says [K]; `scale` is made of that, `temperature` is the truth.
        pace: seconds of heat that a second of the simulator stands for.
    """

    def __init__(
        self, seed: int, columns: list[str], start: float, limit: float, soft: float, noise: float = 0.1, pace: int = 1
    ) -> None:
        self.columns = columns
        self._balance = Balance(draw_quadruped(seed), start)
        self._solver = Exponential(self._balance)
        self._state = np.full(len(self._balance.capacity), start)
        self._joints = [self._balance.robot.nodes.index(joint) for joint in JOINTS]
        self._limit, self._soft = limit, soft
        self._noise, self._random, self._pace = noise, np.random.default_rng(seed), pace

    def advance(self, inputs: FloatArray, dt: float) -> None:
        """Go on by `dt` seconds, whole ones, with the inputs held."""
        named = dict(zip(self.columns, inputs.tolist(), strict=True))
        self._state = self._solver.solve(self._balance.held(named, self._pace * round(dt)), self._state)[-1]

    @property
    def temperature(self) -> FloatArray:
        """Temperature of each joint's winding [degC]."""
        return self._state[self._balance.sensed[self._joints]]

    @property
    def scale(self) -> FloatArray:
        """1 below the soft limit, 0 at the limit, straight between, of what the sensors say."""
        said = self.temperature + self._noise * self._random.standard_normal(12)
        return np.clip((self._limit - said) / (self._limit - self._soft), 0.0, 1.0)


class Windows:
    """Samples of the simulator reduced to the inputs of one thermal step, so that no heat is lost.

    Torque keeps its RMS, velocity its mean magnitude and its RMS, as for a log (`lptn.logs.resampling`).

    Args:
        columns: the thermal model's inputs.
        samples: simulator steps a thermal step.
        ambient: temperature of the air [degC].
        computer: power of the onboard computer [W].
    """

    def __init__(self, columns: list[str], samples: int, ambient: float, computer: float) -> None:
        self._raw = {"torque": np.zeros((samples, 12)), "velocity": np.zeros((samples, 12))}
        self._raw |= {"speed": np.zeros((samples, 1)), "powered": np.zeros((samples, 1))}
        self._constant = {"temperature": ambient, "power": computer}
        self._columns = columns
        self._count = 0

    def add(self, torque: FloatArray, velocity: FloatArray, speed: float, powered: bool) -> None:
        """One sample: joint torques [N·m] and velocities [rad/s], shape (12,), base speed [m/s], drives on or off."""
        for name, value in (("torque", torque), ("velocity", velocity), ("speed", speed), ("powered", powered)):
            self._raw[name][self._count] = value
        self._count += 1

    def full(self) -> bool:
        """Whether a thermal step is due."""
        return self._count == len(self._raw["speed"])

    def take(self) -> FloatArray:
        """The inputs in the order of the columns; the window begins anew."""
        self._count = 0
        reduced = {name: self._reduce(name) for name in ("torque", "velocity", "velocity_rms", "speed", "powered")}
        return np.array([self._value(column, reduced) for column in self._columns])

    def _reduce(self, name: str) -> FloatArray:
        raw = self._raw[name.removesuffix("_rms")]
        if name not in FEATURES:
            return np.asarray(raw.mean(axis=0))
        rule = FEATURES[name]
        return rule.after(rule.before(raw).mean(axis=0))

    def _value(self, column: str, reduced: dict[str, FloatArray]) -> float:
        quantity, _, place = column.partition(".")
        if quantity in self._constant:
            return self._constant[quantity]
        values = reduced[quantity]
        return float(values[JOINTS.index(place)] if values.size > 1 else values[0])


def quadruped(model: str | None = None) -> Model:
    """The ready model file `quadruped`, or another of its models, values as they stand: plausible, not a robot's."""
    return Model(parse_model(preset_text("quadruped", model), Path("quadruped.toml")).network)
