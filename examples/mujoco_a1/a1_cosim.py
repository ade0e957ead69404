"""The co-simulation: MuJoCo, the controller and the thermal model, each at its own rate, coupled both ways."""

from __future__ import annotations

from dataclasses import dataclass, field
from time import perf_counter
from typing import Protocol

import mujoco
import numpy as np

from a1_gait import Controller, tilt
from a1_governor import Limiter, leave
from a1_robot import TIME_STEP, OneNode, build
from a1_task import JOINTS, Command, FloatArray
from a1_thermal import Thermal, Windows

CONTROL_STEPS = 2  # simulator steps a controller step: 250 Hz
WINDOW = 250  # simulator steps a thermal step: 0.5 s, one gait cycle
FRAME_STEPS = 20  # simulator steps a film frame: 25 a second
COMPUTER = 20.0  # W
NO_SLIP = 5  # of the solver: without them its soft friction lets standing feet creep downhill, a centimetre a second
SAGGED, LEANING = 0.12, 1.0  # m, rad: a base that hangs lower, or is more tilted, has fallen
START = [0.0, 0.9, -1.8] * 4  # rad


class Governing(Protocol):
    """Whatever turns torque scales into a command."""

    def command(self, scale: FloatArray) -> Command:
        """The command at these torque scales, shape (12,)."""


@dataclass
class Clock:
    """Wall-clock seconds of one run: every call of the simulator, the controller and the thermal model."""

    physics: list[float] = field(default_factory=list)
    control: list[float] = field(default_factory=list)
    thermal: list[float] = field(default_factory=list)

    @property
    def share(self) -> float:
        """The thermal model's share of simulator and thermal model together."""
        return sum(self.thermal) / (sum(self.physics) + sum(self.thermal))

    def __str__(self) -> str:
        named = (("MuJoCo", self.physics), ("controller", self.control), ("thermal model", self.thermal))
        parts = [f"{name} {sum(calls):.2f} s (median call {1e6 * np.median(calls):.0f} us)" for name, calls in named]
        return f"{', '.join(parts)}; the thermal model is {self.share:.2%} of MuJoCo and itself"


@dataclass(frozen=True)
class Setting:
    """What all runs have in common.

    Args:
        duration: [s].
        payload: [kg].
        start: temperature of every joint at the start [degC].
        motor: MuJoCo's one-node motors; their ambient is everybody's.
        task: what the robot shall do.
        window: simulator steps a thermal step.
        slope: of the ground, uphill along x [rad].
        enough: the run ends where a joint is hotter [degC].
    """

    duration: float = 1200.0
    payload: float = 6.0
    start: float = 25.0
    motor: OneNode = field(default_factory=OneNode)
    task: Command = field(default_factory=Command)
    window: int = WINDOW
    slope: float = 0.0
    enough: float = np.inf


@dataclass
class Record:
    """One run, a row for each thermal step; joints in the order of `JOINTS`."""

    label: str
    setting: Setting
    time: list[float] = field(default_factory=list)
    temperature: list[FloatArray] = field(default_factory=list)
    one_node: list[FloatArray] = field(default_factory=list)
    torque: list[FloatArray] = field(default_factory=list)
    scale: list[FloatArray] = field(default_factory=list)
    command: list[Command] = field(default_factory=list)
    position: list[FloatArray] = field(default_factory=list)
    frames: list[FloatArray] = field(default_factory=list)
    clock: Clock = field(default_factory=Clock)
    fell: float | None = None

    @property
    def peak(self) -> float:
        """The hottest temperature of any joint [degC]."""
        return float(np.max(self.temperature))

    @property
    def way(self) -> float:
        """Distance walked [m]."""
        return float(self.position[-1][0])

    def joint(self, name: str, of: str = "temperature") -> FloatArray:
        """One joint's `temperature`, `one_node`, `torque` or `scale` over time."""
        return np.array(getattr(self, of))[:, JOINTS.index(name)]


class CoSimulation:
    """MuJoCo, the controller and a thermal model, coupled both ways.

    Args:
        label: name of the run.
        setting: robot, payload, duration.
        thermal: the thermal model, at its start.
        governor: what turns its torque scales into commands.
        limiter: what the drives do to a torque at a torque scale.
        film: keep the robot's posture 25 times a second.
    """

    def __init__(
        self,
        label: str,
        setting: Setting,
        thermal: Thermal,
        governor: Governing,
        limiter: Limiter = leave,
        film: bool = False,
    ) -> None:
        motor = setting.motor
        self._setting, self._thermal, self._governor, self._limiter = setting, thermal, governor, limiter
        self._film = film
        self._model = build(motor, setting.payload)
        down = (-np.sin(setting.slope), 0.0, -np.cos(setting.slope))
        self._model.opt.gravity[:] = 9.81 * np.array(down)  # the floor stays level, what pulls is tilted
        self._model.opt.noslip_iterations = NO_SLIP if setting.slope else 0
        self._data = data = mujoco.MjData(self._model)
        data.qpos[2], data.qpos[7:19] = setting.task.height, START
        data.act[:] = setting.start - motor.ambient
        mujoco.mj_forward(self._model, data)
        self._controller = Controller(self._model, data)
        self._windows = Windows(thermal.columns, setting.window, motor.ambient, COMPUTER)
        self._torque, self._scale = np.zeros(12), thermal.scale
        self._command = governor.command(self._scale)
        self.record = Record(label, setting)

    def run(self) -> Record:
        """Go to the end, or until the robot has fallen."""
        for step in range(round(self._setting.duration / TIME_STEP)):
            if step % CONTROL_STEPS == 0:
                self._control()
            if self._film and step % FRAME_STEPS == 0:
                self.record.frames.append(self._data.qpos.copy())
            self._step()
            if self._windows.full():
                self._heat()
                if self._fallen():
                    self.record.fell = float(self._data.time)
                if self.record.fell is not None or self._thermal.temperature.max() > self._setting.enough:
                    break
        return self.record

    def _control(self) -> None:
        began = perf_counter()
        torque = self._controller.torque(self._data, self._command, CONTROL_STEPS * TIME_STEP)
        self._torque = self._limiter(torque, self._scale)
        self.record.clock.control.append(perf_counter() - began)

    def _step(self) -> None:
        data, motor = self._data, self._setting.motor
        # The drive controls the current: it gives a hot winding the more voltage that its resistance asks for.
        data.ctrl[:] = self._torque * (1 + motor.alpha * (motor.ambient + data.act - motor.reference))
        began = perf_counter()
        mujoco.mj_step(self._model, data)
        self.record.clock.physics.append(perf_counter() - began)
        speed = float(np.hypot(data.qvel[0], data.qvel[1]))
        self._windows.add(data.actuator_force, data.qvel[6:], speed, self._controller.powered)

    def _heat(self) -> None:
        inputs = self._windows.take()
        began = perf_counter()
        self._thermal.advance(inputs, self._setting.window * TIME_STEP)
        temperature, self._scale = self._thermal.temperature, self._thermal.scale
        self.record.clock.thermal.append(perf_counter() - began)
        self._command = self._governor.command(self._scale)
        self._note(temperature, inputs)

    def _note(self, temperature: FloatArray, inputs: FloatArray) -> None:
        data, record, columns = self._data, self.record, self._thermal.columns
        record.time.append(float(data.time))
        record.temperature.append(temperature)
        record.one_node.append(data.act + self._setting.motor.ambient)
        record.torque.append(np.array([inputs[columns.index(f"torque.{joint}")] for joint in JOINTS]))
        record.scale.append(self._scale)
        record.command.append(self._command)
        record.position.append(data.qpos[:3].copy())

    def _fallen(self) -> bool:
        """On its side, or far below where the controller holds it."""
        roll, pitch, _ = tilt(self._data.xmat[self._model.body("base").id])
        down = self._controller.height - self._data.qpos[2] > SAGGED
        return max(abs(roll), abs(pitch)) > LEANING or bool(down)
