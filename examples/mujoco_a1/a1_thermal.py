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


def quadruped() -> Model:
    """The ready model file `quadruped`, its values as they stand: plausible ones, not a robot's."""
    return Model(parse_model(preset_text("quadruped"), Path("quadruped.toml")).network)
