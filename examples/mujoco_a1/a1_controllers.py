"""What keeps joints below their limit: derating, cut-off, a predictive controller, and a mission that is planned anew.

Each sees readings and measured inputs twice a second, and decides what the drives may give and what the robot shall do.
"""

from __future__ import annotations

import json
import subprocess
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Protocol

import numpy as np

from a1_cosim import CoSimulation, Record, Setting
from a1_governor import Unmoved, leave
from a1_task import JOINTS, TORQUE_LIMIT, Command, FloatArray
from a1_thermal import CasadiThermal
from lptn.applications import MissionControl
from lptn.model.model import Model
from lptn.planners import TorqueMPC
from lptn.planners.mission import Activity, Gait, Mission, Transition, gait_from_tables

LIMIT, BEGINS, RESUMES, NOISE = 60.0, 50.0, 55.0, 0.1  # degC; degC; degC; K
PERIOD = 5.0  # s, of the predictive controllers
REPLAN = 30.0  # s
SUPPORT = (1.5, 2.0)  # floors: so many times what the gait asks of a joint, and N·m more; below that the trunk sinks
AMBIENT, COMPUTER = 25.0, 20.0  # degC, W


class Controller(Protocol):
    """Decides on torques and on the task."""

    def update(self, readings: FloatArray, inputs: dict[str, float], asked: FloatArray, dt: float) -> None:
        """Take in readings [degC] and measured inputs of the last `dt` seconds, and the RMS torque asked [N·m]."""

    def limited(self, torque: FloatArray) -> FloatArray:
        """What the drives give of a torque [N·m], shape (12,)."""

    def command(self) -> Command:
        """What the robot shall do."""


@dataclass
class Derating:
    """The industry's habit: the greatest torque of each drive falls linearly from 50 to 60 degC of its own reading."""

    task: Command
    share: FloatArray | float = 1.0

    def update(self, readings: FloatArray, inputs: dict[str, float], asked: FloatArray, dt: float) -> None:
        self.share = np.clip((LIMIT - readings) / (LIMIT - BEGINS), 0.0, 1.0)

    def limited(self, torque: FloatArray) -> FloatArray:
        bound = TORQUE_LIMIT * self.share
        return np.asarray(np.clip(torque, -bound, bound))

    def command(self) -> Command:
        return self.task


@dataclass
class CutOff(Derating):
    """A drive is switched off at 60 degC and on again at 55 degC."""

    def update(self, readings: FloatArray, inputs: dict[str, float], asked: FloatArray, dt: float) -> None:
        off = np.where(np.broadcast_to(self.share, 12) == 0, readings > RESUMES, readings >= LIMIT)
        self.share = np.where(off, 0.0, 1.0)


Admit = Callable[[dict[str, float], FloatArray, dict[str, float]], FloatArray]
"""From readings, RMS torques asked and the model's other inputs to RMS torques admitted."""


class Predictive:
    """Torques are scaled by what a predictive controller admits, every five seconds.

    Args:
        task: what the robot shall do.
        admit: the controller.
    """

    def __init__(self, task: Command, admit: Admit) -> None:
        self.task, self._admit = task, admit
        self._squares, self._since, self.share = np.zeros(12), 0.0, np.ones(12)

    def update(self, readings: FloatArray, inputs: dict[str, float], asked: FloatArray, dt: float) -> None:
        self._squares += dt * asked**2
        self._since += dt
        if self._since >= PERIOD - 1e-6:
            rms = np.sqrt(self._squares / self._since)
            others = {name: value for name, value in inputs.items() if not name.startswith("torque.")}
            admitted = self._admit(dict(zip(JOINTS, readings.tolist(), strict=True)), rms, others)
            self.share = np.clip(admitted / np.maximum(rms, 1e-6), 0.0, 1.0)
            self._squares, self._since = np.zeros(12), 0.0

    def limited(self, torque: FloatArray) -> FloatArray:
        return torque * self.share

    def command(self) -> Command:
        return self.task


def support_first(model: Model, torque: FloatArray) -> Admit:
    """`TorqueMPC` with floors: a gait's RMS torques [N·m], and some more for what disturbs it."""
    floors = dict(zip(JOINTS, (SUPPORT[0] * torque + SUPPORT[1]).tolist(), strict=True))
    mpc = TorqueMPC(model, {"*_*": LIMIT}, request="torque", period=PERIOD, noise=NOISE, floors=floors)

    def admit(readings: dict[str, float], asked: FloatArray, others: dict[str, float]) -> FloatArray:
        admitted: FloatArray = mpc.step(readings, asked, {name: others[name] for name in mpc.conditions}).admitted
        return admitted

    return admit


_SERVER = """
import json, sys
from pathlib import Path
from lptn import Model, load_model
from lptn.planners import TorqueMPC
file = load_model(Path(sys.argv[1]))
model = file.model if hasattr(file, "model") else Model(file.network)
mpc = TorqueMPC(model, {"*_*": float(sys.argv[2])}, request="torque", period=float(sys.argv[3]))
for line in sys.stdin:
    readings, asked, others = json.loads(line)
    plan = mpc.step(readings, asked, {name: others[name] for name in mpc.conditions})
    print(json.dumps(plan.admitted.tolist()), flush=True)
"""


def of_another_version(python: str, model_file: Path) -> Admit:
    """`TorqueMPC` as it comes in another installation of `lptn`, by its own Python, with that version's defaults."""
    words = [python, "-c", _SERVER, str(model_file), str(LIMIT), str(PERIOD)]
    server = subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)

    def admit(readings: dict[str, float], asked: FloatArray, others: dict[str, float]) -> FloatArray:
        if server.stdin is None or server.stdout is None:
            raise RuntimeError("the other version has no pipes")
        server.stdin.write(json.dumps([readings, asked.tolist(), others]) + "\n")
        server.stdin.flush()
        return np.array(json.loads(server.stdout.readline()))

    return admit


# --- the task instead of the torque ----------------------------------------------------------------


class Replanned:
    """`MissionControl`: speed, height and rests; the drives give what the gait asks for.

    Args:
        mission: what is asked.
        task: what the robot does until the first order.
    """

    def __init__(self, mission: Mission, task: Command) -> None:
        self.control, self._command = MissionControl(mission, period=REPLAN, noise=NOISE), task
        self._at: float | None = None
        self._started = False

    def update(self, readings: FloatArray, inputs: dict[str, float], asked: FloatArray, dt: float) -> None:
        moved = inputs["speed.base"] * dt
        named = dict(zip(JOINTS, readings.tolist(), strict=True))
        order = self.control.update(named, inputs, dt if self._started else 0.0, moved=moved)
        self._started = True
        if order.do != "rest":
            height = order.posture.get("height", self._command.height)
            self._command = Command("trot" if order.do == "trot" else "stand", order.speed, height)
        else:
            self._command = replace(self._command, activity="rest")

    def limited(self, torque: FloatArray) -> FloatArray:
        return torque

    def command(self) -> Command:
        return self._command


def gait_in(simulator: Setting, do: str, speeds: list[float], heights: list[float], model: Model) -> Gait:
    """A gait's tables from short runs of the simulator, a run for each speed and height.

    Args:
        simulator: robot, payload, ground.
        do: trot or stand.
        speeds: of the cells [m/s].
        heights: of the cells [m].
        model: whose inputs are needed.
    """
    cells: dict[str, FloatArray] = {}
    for i, height in enumerate(heights):
        for j, speed in enumerate(speeds):
            command = Command("trot" if do == "trot" else "stand", speed, height)
            # It begins at the task's height, as the robot will: where its feet stand is where they were set down there.
            setting = replace(simulator, duration=_SETTLE + _MEASURE, start=AMBIENT)
            thermal = _Noted(CasadiThermal(model, AMBIENT, LIMIT, BEGINS))
            CoSimulation("gait", setting, thermal, Unmoved(command), leave).run()
            rows = np.array(thermal.inputs)[-round(_MEASURE / _WINDOW) :]
            for column, value in _means(thermal.columns, rows).items():
                cells.setdefault(column, np.zeros((len(heights), 1, len(speeds))))[i, 0, j] = value
    tables = {column: table.tolist() for column, table in cells.items()}
    return gait_from_tables(do, speeds, [0.0], _given(tables), model, "a1", {"height": heights})


_WINDOW, _SETTLE, _MEASURE = 0.5, 4.0, 4.0  # s
_QUANTITIES = ("torque", "velocity", "velocity_rms")  # that a gait has to tell


def _means(columns: Sequence[str], rows: FloatArray) -> dict[str, float]:
    """RMS of torques and of speeds' RMS, means of all else, of those inputs that a gait has to tell."""
    means = {}
    for column, values in zip(columns, rows.T, strict=True):
        quantity = column.partition(".")[0]
        if quantity in _QUANTITIES:
            squares = quantity in ("torque", "velocity_rms")
            means[column] = float(np.sqrt(np.mean(values**2)) if squares else values.mean())
    return means


def _given(values: Mapping[str, object]) -> dict[str, dict[str, object]]:
    """By quantity and place, as `gait_from_tables` takes it."""
    given: dict[str, dict[str, object]] = {"power": {"pc": COMPUTER}}
    for column, value in values.items():
        quantity, _, place = column.partition(".")
        given.setdefault(quantity, {})[place] = value
    return given


def transitions_in(simulator: Setting, do: str, height: float, model: Model) -> dict[tuple[str, str], Transition]:
    """What lying down and getting up take, from one run of the simulator.

    Args:
        simulator: robot, payload, ground.
        do: trot or stand.
        height: from which it lies down, and to which it gets up [m].
        model: whose inputs are needed.
    """
    up = Command("trot" if do == "trot" else "stand", simulator.task.speed, height)
    script = [up] * round(_SETTLE / _WINDOW) + [replace(up, activity="rest")] * round(_LONG / _WINDOW)
    setting = replace(simulator, duration=_SETTLE + 2 * _LONG, start=AMBIENT)
    thermal = _Noted(CasadiThermal(model, AMBIENT, LIMIT, BEGINS))
    record = CoSimulation("transitions", setting, thermal, _Scripted(script, up), leave).run()
    inputs, above = np.array(thermal.inputs), np.array(record.position)[:, 2]
    lying = np.flatnonzero(inputs[:, thermal.columns.index(f"powered.{JOINTS[0]}")] == 0)
    stands = np.flatnonzero(above[lying[-1] :] > height - _NEARLY)[0] + lying[-1]
    transitions = {}
    for before, after, rows in (
        (do, "rest", slice(len(script) - round(_LONG / _WINDOW), lying[0])),
        ("rest", do, slice(lying[-1] + 1, stands + 1)),
    ):
        given = _given(_means(thermal.columns, inputs[rows]))
        gait = gait_from_tables(f"{before} to {after}", [0.0], [0.0], given, model, "a1")
        transitions[before, after] = Transition(gait, _WINDOW * len(inputs[rows]))
    return transitions


_LONG, _NEARLY = 10.0, 0.02  # s, longer than either takes; m below its height, where it stands


class _Scripted:
    """Commands one by one, a thermal step each, then the last one for ever."""

    def __init__(self, commands: Sequence[Command], last: Command) -> None:
        self._commands, self._last = iter(commands), last

    def command(self, scale: FloatArray) -> Command:
        return next(self._commands, self._last)


class _Noted(CasadiThermal):
    """Keeps the inputs of each step."""

    def __init__(self, thermal: CasadiThermal) -> None:
        self.__dict__.update(thermal.__dict__)
        self.inputs: list[FloatArray] = []

    def advance(self, inputs: FloatArray, dt: float) -> None:
        self.inputs.append(inputs.copy())
        super().advance(inputs, dt)


def mission_of(
    model: Model,
    do: str,
    gait: Gait,
    amount: float,
    start: float,
    transitions: Mapping[tuple[str, str], Transition] | None = None,
) -> Mission:
    """Trot so many metres, or stand so many seconds, in six parts; the robot stands at the start.

    Args:
        model: what the planner knows of the robot.
        do: trot or stand.
        gait: its tables.
        amount: [m] or [s].
        start: of all joints [degC].
        transitions: what lying down and getting up take; nothing where nothing is said.
    """
    rest = gait_from_tables("rest", [0.0], [0.0], {"power": {"pc": COMPUTER}}, model, "a1")
    heights = gait.postures["height"]
    posture = {"height": (float(heights[0]), float(heights[-1]))}
    if do == "trot":
        speeds = (float(gait.speeds[0]), float(gait.speeds[-1]))
        activity = Activity(do, gait, amount, (0.0, 0.0), speeds, (0.0, 0.0), posture, 6)
    else:
        activity = Activity(do, gait, None, (amount, amount), (0.0, 0.0), (0.0, 0.0), posture, 6)
    first = np.full(len(model.states), start)
    return Mission(
        model,
        (activity,),
        rest,
        900.0,
        dict.fromkeys(JOINTS, LIMIT),
        first,
        AMBIENT,
        name=do,
        transitions=transitions or {},
        begins=do,
    )


# --- one run ----------------------------------------------------------------------------------------


class _Watched(CasadiThermal):
    """The true network; a controller looks at its readings after each step."""

    def __init__(self, thermal: CasadiThermal, controller: Controller, seed: int) -> None:
        self.__dict__.update(thermal.__dict__)
        self.controller, self._random = controller, np.random.default_rng(seed)
        self._squares, self._count = np.zeros(12), 0

    def advance(self, inputs: FloatArray, dt: float) -> None:
        super().advance(inputs, dt)
        readings = self.temperature + NOISE * self._random.standard_normal(12)
        asked = np.sqrt(self._squares / max(self._count, 1))
        self._squares, self._count = np.zeros(12), 0
        self.controller.update(readings, dict(zip(self.columns, inputs.tolist(), strict=True)), asked, dt)

    def limiter(self, torque: FloatArray, scale: FloatArray) -> FloatArray:
        """What the drives give; what was asked is counted."""
        self._squares += torque**2
        self._count += 1
        return self.controller.limited(torque)


class _Commanded:
    """The controller's task as the co-simulation asks for it."""

    def __init__(self, controller: Controller) -> None:
        self._controller = controller

    def command(self, scale: FloatArray) -> Command:
        return self._controller.command()


def run(label: str, setting: Setting, truth: Model, controller: Controller, film: bool = False) -> Record:
    """One controller on the true robot.

    Args:
        label: of the record.
        setting: robot, ground, start, duration.
        truth: the robot's network.
        controller: see above.
        film: keep the robot's posture for pictures.
    """
    thermal = _Watched(CasadiThermal(truth, setting.start, LIMIT, BEGINS), controller, 1)
    return CoSimulation(label, setting, thermal, _Commanded(controller), thermal.limiter, film).run()
