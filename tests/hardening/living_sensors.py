"""Robots driven hard for half an hour while their temperature sensors fail: how hot do they truly get, what is said?

    python -m tests.hardening.living_sensors                     # all robots, faults and faces: some minutes
    python -m tests.hardening.living_sensors --quick --robots knee leg

Limits of all nodes or of some, 25 degC of air, a request far above what can be kept, by some robots in pulses. The
truth is a plain network with exact steps (`tests.hardening.plants`), once as the model says and once with every
capacity, resistance and loss off by 10 %, up or down at random (`--off` for other ways). Robots start cold, or switched
on at 50 degC by work before. A fault is of one sensor that is drawn, of two of one converter, or of all; or the
controller begins anew, or is told an air of another temperature. Faces: `TorqueMPC`, `ControlLoop` with ticks of 0.1 s,
and the emitted C, compiled apart.

Printed for each fault and robot, over starts, plants and seeds: by how much the hottest node passed its limit, the
same less the margin that the plan told then, in how many of the cases the controller said that something is wrong with
a sensor and after what time of fault at the latest, and the torque: mean share of the request, over that of a
controller that has the true model and true temperatures; of all joints, and of those whose own sensors are healthy.
Beside cases that pass their limit stands what was passed before anybody could tell that a sensor is false
(`plants.told_at`): a sound robot with every value off by no more than this one's explains the readings as well, and is
to get its torque.

    python -m tests.hardening.living_sensors --off cores --faults healthy   # the plant has masses that the model lacks

There a quarter of each driven node is a winding, 40 s apart. Joints of one mass keep their sensors (seeds 104, 105: 96
to 102 % of what could be is admitted, before 22 to 99); small nodes lose some, with up to 16 %, and a winding of 30 J/K
passes limit and margin by up to 2 K while the heat within comes out.

    python -m tests.hardening.living_sensors --set WIDER=6 DRIFT=0.03   # other constants of `planners/mpc/c/filter.inc`

How much depends on these constants: cases of 72 that pass limit and margin by more than 0.5 K, by how much in sum [K],
torque of healthy sensors, with each constant times and over 1.5 (`--robots motor prosthesis leg --faces python --off
signs --seeds 73 --faults healthy "1 K steps" "drifts by -0.02 K/s" "averages five minutes" "comes loose by 60 %" "reads
0.8 of the rise" "delayed by 60 s"`):

| constant | as it is | times 1.5 | over 1.5 |
| --- | --- | --- | --- |
| `WIDER` | 28, 184, 99.5 % | 28, 183, 99.5 % | 29, 188, 99.5 % |
| `OUTLIER` | | 28, 181, 99.5 % | 35, 232, 99.5 % |
| `DRIFT` | | 29, 182, 99.5 % | 31, 191, 99.5 % |
| `AGAINST` | | 31, 201, 99.5 % | 27, 180, 99.5 % |
| `ROUGH` | | 35, 217, 99.5 % | 29, 182, 99.6 % |
| `ALIKE` | | 28, 184, 99.5 % | 28, 184, 99.5 % |
| `BIOT` | | 34, 238, 99.5 % | 33, 198, 99.5 % |
| `WALKS` | | 28, 184, 99.5 % | 28, 184, 99.5 % |
| `ODDS` | | 28, 184, 99.5 % | 28, 184, 99.5 % |
"""

from __future__ import annotations

import argparse
import ctypes
import itertools
import json
import re
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path
from typing import Any, Protocol, get_args

import numpy as np

from lptn.basics.arrays import FloatArray
from lptn.basics.c_library import compiler
from lptn.model.file import parse_model
from lptn.model.model import Model
from lptn.planners import ControlLoop, TorqueMPC
from lptn.planners.mpc import controller as mpc_controller
from tests.hardening.plants import AIR, ROBOTS, Off, Plant, Robot, told_at

PERIOD, STEPS = 5.0, 360  # s, periods
SHARE, PASSED = 0.1, 0.5  # by which plants are off; K beyond limit and margin that is too much
NOISE, TICK, FAULT = 0.1, 0.1, 900.0  # K; s; s: when faults begin that don't begin at once
STARTS = {"cold": AIR, "hot": 50.0}
_NOT_ALIVE = 128  # of the status


@dataclass(frozen=True)
class Seen:
    """What a fault has to work with: time [s]; the true temperatures now, a minute ago, in the last five minutes, when
    the fault began and when the load was last low, those that the next sensors read now; noise; shape (nodes,); the
    limit [degC]."""

    time: float
    true: FloatArray
    minute_ago: FloatArray
    lately: list[FloatArray]
    at_fault: FloatArray
    at_rest: FloatArray
    neighbours: FloatArray
    noise: FloatArray
    most: float


@dataclass(frozen=True)
class Fault:
    """A fault of sensors.

    Args:
        read: what they read, shape (nodes,).
        begin: s.
        resolution: steps that the controller is told of [K].
        restarts: the controller begins anew, and remembers nothing.
        air: K by which the air is colder than the controller is told.
    """

    read: Callable[[Seen], FloatArray]
    begin: float = 0.0
    resolution: float = 0.0
    restarts: bool = False
    air: float = 0.0


def _healthy(seen: Seen) -> FloatArray:
    return seen.true + seen.noise


def _constant(value: float) -> Callable[[Seen], FloatArray]:
    return lambda seen: np.full(seen.true.size, value)


def _towards(end: float, seconds: float) -> Callable[[Seen], FloatArray]:
    """A first-order way from what was read to something else."""
    return lambda seen: end + (seen.at_fault - end) * np.exp(-(seen.time - FAULT) / seconds) + seen.noise


def _half_loose(seen: Seen) -> FloatArray:
    share = 0.6 * (1 - np.exp(-(seen.time - FAULT) / 100.0))
    return np.asarray((1 - share) * seen.true + share * AIR + seen.noise)


FAULTS: dict[str, Fault] = {
    "healthy": Fault(_healthy),
    "1 K steps": Fault(lambda seen: np.round(seen.true + seen.noise), resolution=1.0),
    **{f"dead at {value:g} from the start": Fault(_constant(value)) for value in (-40.0, -1.0, 0.0, 25.0, 40.0)},
    "missing from the start": Fault(_constant(np.nan)),
    "dead at 25, later": Fault(_constant(25.0), FAULT),
    "stands, later": Fault(lambda seen: seen.at_fault + 0.03, FAULT),
    "stuck at 25 with dither": Fault(lambda seen: 25.0 + seen.noise),
    "stuck with dither, later": Fault(lambda seen: seen.at_fault + seen.noise, FAULT),
    "drifts by +0.02 K/s": Fault(lambda seen: seen.true + 0.02 * seen.time + seen.noise),
    "drifts by -0.02 K/s": Fault(lambda seen: seen.true - 0.02 * seen.time + seen.noise),
    "opens through 20 s": Fault(_towards(-50.0, 20.0), FAULT),
    "opens through 100 s": Fault(_towards(-50.0, 100.0), FAULT),
    "comes loose": Fault(_towards(AIR, 100.0), FAULT),
    "comes loose by 60 %": Fault(_half_loose, FAULT),
    "delayed by 60 s": Fault(lambda seen: seen.minute_ago + seen.noise),
    "swapped": Fault(lambda seen: seen.true + seen.noise),  # `Sensors` exchanges them
    "reads the next one's": Fault(lambda seen: seen.neighbours + seen.noise),
    "freezes under load": Fault(lambda seen: seen.at_rest + seen.noise),
    "saturates 5 K below": Fault(lambda seen: np.minimum(seen.true + seen.noise, seen.most - 5.0)),
    "reads 0.8 of the rise": Fault(lambda seen: AIR + 0.8 * (seen.true - AIR) + seen.noise),
    "reads 0.8 degC": Fault(lambda seen: 0.8 * seen.true + seen.noise),
    "averages five minutes": Fault(lambda seen: np.mean(seen.lately, axis=0) + seen.noise),
    "drops for a minute": Fault(lambda seen: seen.true - 20.0 * (seen.time // 60 % 5 == 0) + seen.noise, FAULT),
    "drops by 12 K, later": Fault(lambda seen: seen.true - 12.0 + seen.noise, FAULT),
    "every second one missing": Fault(lambda seen: np.where(seen.noise > 0, seen.true + seen.noise, np.nan)),
    "restarts": Fault(_healthy, FAULT, restarts=True),
    "air told 10 K too hot": Fault(_healthy, air=10.0),
    "air told 10 K too cold": Fault(_healthy, air=-10.0),
    "air told 10 K too hot, later": Fault(_healthy, FAULT, air=10.0),
    "air told 10 K too cold, later": Fault(_healthy, FAULT, air=-10.0),
    "restarts, dead at 25": Fault(_constant(25.0), FAULT, restarts=True),
    "restarts, stuck at 40 with dither": Fault(lambda seen: 40.0 + seen.noise, FAULT, restarts=True),
}
HEALTHY = ("healthy", "1 K steps", "every second one missing", "restarts",
           *(name for name, fault in FAULTS.items() if fault.air))  # fmt: skip
QUICK = ("healthy", "dead at 25 from the start", "stuck at 25 with dither", "drifts by -0.02 K/s", "comes loose")


class Sensors:
    """The readings of a robot, some of them spoilt, asked in order of time.

    Args:
        robot: whose.
        fault: its name.
        faulty: nodes; of a swap the first of each pair.
        seed: of the noise.
        noise: its standard deviation [K].
    """

    def __init__(self, robot: Robot, fault: str, faulty: tuple[int, ...], seed: int, noise: float = NOISE) -> None:
        self._noise = noise
        self._measured, self._kind, self._fault, self._faulty = list(robot.measured), fault, FAULTS[fault], list(faulty)
        self._random = np.random.default_rng([seed, 7])
        self._past: list[FloatArray] = []
        self._at_fault: FloatArray | None = None
        self._at_rest, self._limit = np.full(len(robot.nodes), AIR), robot.limit
        self._next = np.arange(len(robot.nodes))
        self._next[self._measured] = np.roll(self._measured, -1)

    def read(self, time: float, true: FloatArray, loaded: bool) -> FloatArray:
        """Readings a control period apart [degC], NaN where there is no sensor, shape (nodes,).

        Args:
            time: s.
            true: temperatures [degC].
            loaded: whether some joint had more than a third of its request over the last period.
        """
        self._past.append(true)
        if not loaded:
            self._at_rest = true
        noise = self._noise * self._random.standard_normal(true.size)
        readings = np.full(true.size, np.nan)
        readings[self._measured] = (true + noise)[self._measured]
        if time < self._fault.begin:
            return readings
        if self._at_fault is None:
            self._at_fault = true
        ago = self._past[max(0, len(self._past) - 1 - round(60 / PERIOD))]
        lately = self._past[-round(300 / PERIOD) :]
        spoilt = self._fault.read(
            Seen(time, true, ago, lately, self._at_fault, self._at_rest, true[self._next], noise, self._limit)
        )
        if self._kind == "swapped":
            spoilt = readings.copy()
            for one in self._faulty:
                other = self._measured[(self._measured.index(one) + 1) % len(self._measured)]
                spoilt[[one, other]] = readings[[other, one]]
        for node in self._faulty:
            readings[node] = spoilt[node]
        if self._kind == "swapped":
            return spoilt
        return readings


def sensors_at_fault(robot: Robot, fault: str, which: str, seed: int) -> tuple[int, ...]:
    """Nodes whose sensors are spoilt: one of those with a winding, two, or all; of a swap every second one."""
    driven = [node for node in robot.measured if node in robot.driven] or list(robot.measured)
    if which == "one":
        return (driven[int(np.random.default_rng([seed, 3]).integers(len(driven)))],)
    if which == "two":
        return tuple(robot.measured[:2])
    return tuple(robot.measured[: len(robot.measured) // 2 * 2 : 2]) if fault == "swapped" else robot.measured


# --- Faces: each asked with readings, each answers with currents, margins and what it says ---------


@dataclass
class Answer:
    """Currents [A] of the driven nodes, margin of the limited ones [K], whether a sensor is said not to be believed."""

    currents: FloatArray
    margin: FloatArray
    said: bool


class Face(Protocol):
    """A controller in one of its faces."""

    def step(self, readings: FloatArray, plant: Plant, share: float = 1.0, air: float = AIR) -> Answer:
        """One control period, in which the plant is moved on, a share of the robot's request is asked and an air
        [degC] is told."""


def model_of(robot: Robot) -> Model:
    """The model that a controller is told."""
    return Model(parse_model(robot.toml(), Path(f"{robot.name}.toml")).network)


@cache
def controller(name: str, resolution: float) -> TorqueMPC:
    """The controller of a robot, made once."""
    robot = ROBOTS[name]()
    return TorqueMPC(model_of(robot), robot.limits, request="current", current_limits=1.5 * robot.asked, period=PERIOD,
                     noise=NOISE, resolution=resolution)  # fmt: skip


def _order(robot: Robot, names: tuple[str, ...]) -> list[int]:
    return [names.index(robot.nodes[node]) for node in robot.driven]


class InPython:
    """`TorqueMPC.step`."""

    def __init__(self, robot: Robot, mpc: TorqueMPC) -> None:
        self._mpc, self._asked, self._order = mpc, np.full(len(mpc.joints), robot.asked), _order(robot, mpc.joints)
        self._nodes = [robot.nodes.index(node) for node in mpc.model.nodes]
        mpc.reset()

    def step(self, readings: FloatArray, plant: Plant, share: float = 1.0, air: float = AIR) -> Answer:
        """One control period."""
        plan = self._mpc.step(readings[self._nodes], share * self._asked, [air])
        currents = np.asarray(plan.admitted)[self._order]
        plant.step(currents)
        return Answer(currents, np.asarray(plan.margin), bool(plan.untrusted))


class InALoop:
    """`ControlLoop.update` at each tick."""

    def __init__(self, robot: Robot, mpc: TorqueMPC) -> None:
        mpc.reset()
        self._loop, self._order = ControlLoop(mpc, TICK), _order(robot, mpc.joints)
        self._asked = np.full(len(mpc.joints), robot.asked)
        self._nodes = [robot.nodes.index(node) for node in mpc.model.nodes]

    def step(self, readings: FloatArray, plant: Plant, share: float = 1.0, air: float = AIR) -> Answer:
        """As many ticks as a control period has."""
        readings, asked = readings[self._nodes], share * self._asked
        total = np.zeros(len(self._order))
        for _ in range(round(PERIOD / TICK)):
            scale = self._loop.update(asked, readings, [air])
            currents = (scale * asked)[self._order]
            plant.step(currents)
            total += currents
        plan = self._loop.plan
        if plan is None:
            raise RuntimeError("the loop has no plan after a control period")
        return Answer(total / round(PERIOD / TICK), np.asarray(plan.margin), bool(plan.untrusted))


_GLUE = """\
#include <string.h>
#include "lptn_mpc.h"
#include "settings.h"
static lptn_mpc_state state;
static lptn_mpc_work work;
static lptn_mpc_result result;
void forget(void) { memset(&state, 0, sizeof state); }
int step(const double *measured, const double *asked, const double *air, double *admitted, double *margin) {
    static double request[LPTN_N * LPTN_NU], conditions[LPTN_N * LPTN_ND + 1];
    for (int k = 0; k < LPTN_N; k++) {
        memcpy(request + k * LPTN_NU, asked, LPTN_NU * sizeof *asked);
        memcpy(conditions + k * LPTN_ND, air, LPTN_ND * sizeof *air);
    }
    lptn_mpc_step(&lptn_mpc_default, &state, &work, measured, request, conditions, 0, &result);
    memcpy(admitted, result.admitted, sizeof result.admitted);
    memcpy(margin, result.margin, sizeof result.margin);
    return result.status;
}
"""


@cache
def emitted(name: str, resolution: float) -> Any:
    """The emitted C of a robot's controller as a library of its own."""
    mpc = controller(name, resolution)
    with tempfile.TemporaryDirectory() as folder:
        nodes, joints = len(mpc.model.states), len(mpc.joints)
        mpc.emit(folder, np.full(nodes, AIR), np.zeros((1, joints)), np.array([[AIR]]))
        (Path(folder) / "glue.c").write_text(_GLUE)
        words = [*(compiler() or ()), "-std=c99", "-O2", "-ftree-vectorize", "-ffp-contract=off", "-shared", "-fPIC"]
        subprocess.run([*words, "glue.c", "lptn_mpc.c", "-lm", "-o", "glue.so"], cwd=folder, check=True)
        return ctypes.CDLL(str(Path(folder) / "glue.so"))


class InC:
    """What `TorqueMPC.emit` writes."""

    def __init__(self, robot: Robot, mpc: TorqueMPC) -> None:
        self._library, self._order = emitted(robot.name, mpc.settings.resolution), _order(robot, mpc.joints)
        self._library.forget()
        self._nodes = [robot.nodes.index(node) for node in mpc.model.nodes]
        self._asked = np.full(len(mpc.joints), robot.asked)
        self._admitted, self._margin = np.empty(len(mpc.joints)), np.empty(len(mpc.settings.limits))

    def step(self, readings: FloatArray, plant: Plant, share: float = 1.0, air: float = AIR) -> Answer:
        """One control period."""
        readings = np.ascontiguousarray(readings[self._nodes])
        arrays = (readings, share * self._asked, np.array([air]), self._admitted, self._margin)
        status = self._library.step(*(ctypes.c_void_p(array.ctypes.data) for array in arrays))
        currents = self._admitted[self._order]
        plant.step(currents)
        return Answer(currents, self._margin.copy(), bool(status & _NOT_ALIVE))


FACES: dict[str, Callable[[Robot, TorqueMPC], Face]] = {"python": InPython, "loop": InALoop, "c": InC}


# --- Cases ----------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Case:
    """One half hour."""

    robot: str
    face: str
    fault: str
    which: str
    start: str
    off: Off
    seed: int


@dataclass(frozen=True)
class Result:
    """What came of it.

    Args:
        above: K by which the hottest node passed its limit.
        beyond: the same less the margin that was told then.
        said: s from the fault's begin until a sensor was said not to be believed; None for never.
        share: of the steps of fault in which it was said.
        torque: mean current over that of the request.
        ideal: the same of a controller that knows all.
        healthy: mean current of the joints whose own sensors are healthy over that of a controller that knows all; None
            where there are none.
        untold: K by which the limit was passed before anybody could tell; None where it was not passed by too much.
    """

    above: float
    beyond: float
    said: float | None
    share: float
    torque: float
    ideal: float
    healthy: float | None
    untold: float | None


def plant_of(robot: Robot, off: Off, seed: int) -> Robot:
    """The robot as it is."""
    return robot.off_by(SHARE, off, np.random.default_rng([seed, 5]))


def run(case: Case) -> Result:
    """Half an hour."""
    robot, fault = ROBOTS[case.robot](), FAULTS[case.fault]
    mpc = controller(case.robot, fault.resolution)
    face = FACES[case.face](robot, mpc)
    plant = Plant(plant_of(robot, case.off, case.seed), STARTS[case.start], TICK if case.face == "loop" else PERIOD)
    faulty = sensors_at_fault(robot, case.fault, case.which, case.seed)
    sensors, clean = (Sensors(robot, case.fault, faulty, case.seed, noise) for noise in (NOISE, 0.0))
    currents, passed = (np.zeros((STEPS, size)) for size in (len(robot.driven), 1))
    asked_of = list[tuple[float, FloatArray, bool]]()  # the sensors
    above, beyond, said, spoken, given = -np.inf, -np.inf, None, 0, np.zeros(len(robot.driven))
    limited, loaded, asked = [robot.nodes.index(node) for node in mpc.settings.limits], False, 0.0
    for k in range(STEPS):
        if fault.restarts and k * PERIOD == fault.begin:
            face = FACES[case.face](robot, mpc)
        share = robot.share(k * PERIOD)
        asked += share / STEPS
        true = plant.temperature[: len(robot.nodes)]
        asked_of.append((k * PERIOD, true, loaded))
        read = sensors.read(*asked_of[-1])
        answer = face.step(read, plant, share, AIR + (fault.air if k * PERIOD >= fault.begin else 0.0))
        loaded = bool(answer.currents.max() > robot.asked / 3)
        currents[k], passed[k] = answer.currents, plant.temperature[limited].max() - robot.limit
        over = plant.temperature[limited] - robot.limit
        above, beyond = max(above, float(over.max())), max(beyond, float((over - answer.margin).max()))
        given += answer.currents / STEPS
        missing = bool(np.isnan(read[list(robot.measured)]).any())  # which every face says of each node
        if (answer.said or missing) and k * PERIOD >= fault.begin:
            spoken += 1
            said = k * PERIOD - fault.begin if said is None else said
    steps, given = STEPS - round(fault.begin / PERIOD), given / robot.asked / asked
    best = ideal(case.robot, case.start, case.off, case.seed)
    fine = [case.fault in HEALTHY or node not in faulty for node in robot.driven]
    healthy = float(given[fine].mean() / best[fine].mean()) if any(fine) else None
    untold = None
    if beyond > PASSED and case.face != "loop":  # whose currents change within a period
        readings = np.array([clean.read(*each) for each in asked_of])
        told = told_at(robot, SHARE, STARTS[case.start], PERIOD, NOISE, readings, currents)
        untold = float(passed[: told + 1].max())
    return Result(above, beyond, said, spoken / steps, float(given.mean()), float(best.mean()), healthy, untold)


@cache
def ideal(name: str, start: str, off: Off, seed: int) -> FloatArray:
    """Mean share of the request that a controller of the true model and temperatures gives each driven node."""
    true = plant_of(ROBOTS[name](), off, seed)
    mpc = TorqueMPC(model_of(true), true.limits, request="current", current_limits=1.5 * true.asked, period=PERIOD,
                    level=0.5, noise=0.0, model_error=0.0)  # fmt: skip
    face, plant = InPython(true, mpc), Plant(true, STARTS[start], PERIOD)
    shares = [true.share(k * PERIOD) for k in range(STEPS)]
    given = [face.step(plant.temperature, plant, share).currents for share in shares]
    return np.asarray(np.sum(given, axis=0) / true.asked / np.sum(shares))


def cases(chosen: argparse.Namespace) -> Iterator[Case]:
    """Of all that was asked for, those that are different."""
    for robot, face, fault in itertools.product(chosen.robots, chosen.faces, chosen.faults):
        alone = len(ROBOTS[robot]().measured) == 1
        if alone and fault in ("swapped", "reads the next one's"):
            continue
        if FAULTS[fault].air and not ROBOTS[robot]().to_air.any():
            continue
        many = "two" if fault.startswith("drops") else "all"  # two sensors of one converter
        for which, start, off, seed in itertools.product(("one", many), STARTS, chosen.off, chosen.seeds):
            if which == "one" and (fault in HEALTHY or alone):
                continue
            if (face != "python" or chosen.quick) and (start == "hot" or off == "exact"):
                continue
            if off == "exact" and seed != chosen.seeds[0]:
                continue
            yield Case(robot, face, fault, which, start, off, seed)


def set_constants(given: list[str]) -> None:
    """Let the controllers that are made from here on have other constants of `filter.inc`, each as NAME=VALUE."""
    whole = mpc_controller.sources

    def changed(*args: Any) -> dict[str, str]:
        made: dict[str, str] = whole(*args)
        text = made["filter.inc"]
        for word in given:
            name, _, value = word.partition("=")
            text, count = re.subn(rf"(?<=#define {name} )\s*\S+", value, text)
            if not count:
                raise SystemExit(f"filter.inc has no constant {name!r}")
        return made | {"filter.inc": text}

    mpc_controller.sources = changed


def table(results: dict[Case, Result]) -> str:
    """A line for each robot and fault, the worst of all faces; then one for each face."""
    heads = ("robot", "fault", "sensors", "cases", "above the limit, K", "less the margin, K", "said", "after, s",
             "of the time", "torque", "where sensors are healthy", "above before it could be told, K")  # fmt: skip
    lines = [f"| {' | '.join(heads)} |", "|" + " --- |" * len(heads)]
    for key in dict.fromkeys((case.robot, case.fault, case.which) for case in results):
        some = [result for case, result in results.items() if (case.robot, case.fault, case.which) == key]
        robot, fault, which = key
        said = [result.said for result in some if result.said is not None]
        latest = f"{max(said):.0f}" if said else "–"
        share = np.mean([result.share for result in some])
        torque = np.mean([result.torque / result.ideal for result in some])
        fine = [result.healthy for result in some if result.healthy is not None]
        healthy = f"{np.mean(fine):.1%}" if fine else "–"
        untold = max((result.untold for result in some if result.untold is not None), default=None)
        before = "–" if untold is None else f"{untold:+.1f}"
        lines.append(f"| {robot} | {fault} | {'–' if fault in HEALTHY else which} | {len(some)} | "
                     f"{max(r.above for r in some):+.2f} | {max(r.beyond for r in some):+.2f} | {len(said)} | "
                     f"{latest} | {share:.0%} | {torque:.1%} | {healthy} | {before} |")  # fmt: skip
    lines.append("")
    for face in dict.fromkeys(case.face for case in results):
        of_face = {case: result for case, result in results.items() if case.face == face}
        worst = max(of_face, key=lambda case: of_face[case].beyond)
        over = [result for result in of_face.values() if result.beyond > PASSED]
        untold = sum(result.untold is not None and result.above <= result.untold + PASSED for result in over)
        lines.append(f"{face}: {len(over)} of {len(of_face)} cases pass limit and margin by more than {PASSED:g} K, "
                     f"at worst {of_face[worst].beyond:.1f} K: {worst}; {untold} before it could be told")  # fmt: skip
    return "\n".join(lines)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--robots", nargs="+", choices=list(ROBOTS), default=list(ROBOTS))
    parser.add_argument("--faces", nargs="+", choices=list(FACES), default=list(FACES))
    parser.add_argument("--faults", nargs="+", choices=list(FAULTS))
    parser.add_argument("--off", nargs="+", choices=get_args(Off), default=["exact", "signs"])
    parser.add_argument("--seeds", type=int, nargs="+", default=[1, 2])
    parser.add_argument("--quick", action="store_true", help="the worst faults, cold plants that are off, a minute")
    parser.add_argument("--set", nargs="+", default=[], metavar="NAME=VALUE", help="constants of filter.inc")
    parser.add_argument("--json", type=Path, metavar="F", help="each case")
    chosen = parser.parse_args()
    chosen.faults = chosen.faults or list(QUICK if chosen.quick else FAULTS)
    set_constants(chosen.set)
    before, results = time.time(), {}
    for case in cases(chosen):
        results[case] = run(case)
    print(table(results))
    print(f"\n{len(results)} cases in {time.time() - before:.0f} s.")
    if chosen.json is not None:
        listed = [{**asdict(case), **asdict(result)} for case, result in results.items()]
        chosen.json.write_text(json.dumps(listed, indent=1), encoding="utf-8")


if __name__ == "__main__":
    main()
