"""What a proposed experiment can ask of a robot: loads and speeds that its logs have shown, as runs and in words."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from itertools import product

import numpy as np

from lptn.basics.arrays import BoolArray, FloatArray
from lptn.basics.places import EVERYWHERE, class_of, is_glob, matching
from lptn.logs.run import Run
from lptn.model.model import Model

LOADS = ("torque", "current", "torque_abs", "current_abs")
SPEEDS = ("velocity", "velocity_rms")
BASE = "speed.base"
_PRODUCTS = ("mechanical_power",)
_ORDINARY = 0.95  # quantile of a column while it is in use: high, yet nothing that happened only once
_IN_USE = 0.05  # share of a column's largest value from which on it is in use
_LOAD_LEVELS, _SPEED_LEVELS = (0.6, 1.0), (0.4, 1.0)  # shares of the high ordinary value


@dataclass(frozen=True)
class Move:
    """One thing to do: some joints work, all other motors are off.

    Args:
        at: a joint, a class (`"*_calf"`), or `"*"`; empty for rest with all motors off.
        joints: the joints that work.
        load: share of each joint's high ordinary load, 0 to 1.
        speed: the same of its speed, and of the base's where that moves.
        travelling: whether the base moves.
    """

    at: str = ""
    joints: tuple[str, ...] = ()
    load: float = 0.0
    speed: float = 0.0
    travelling: bool = False


REST = Move()


class LoggedInputs:
    """What the runs show of each input: its high ordinary value, and what it is while joints work or rest.

    Args:
        runs: the fitted runs.
        inputs: the models' inputs, without temperatures.
    """

    def __init__(self, runs: Sequence[Run], inputs: Iterable[str]) -> None:
        self.inputs = tuple(inputs)
        # Loads and speeds that no model asks for say in words what a move is.
        described = (name for name in runs[0].columns if _quantity(name) in (*LOADS, *SPEEDS))
        also = (name for name in described if all(run.has(name) for run in runs))
        self.columns = tuple(dict.fromkeys([*self.inputs, *also]))
        self._values = {name: np.concatenate([run.columns[name] for run in runs]) for name in self.columns}
        self._heating = self._heating_quantities()
        self.joints = list(dict.fromkeys(_place(name) for name in self.inputs if _quantity(name) in self._heating))
        """Places whose load, or heat where no load is logged, can be chosen."""
        self.high = {name: _high(values) for name, values in self._values.items()}
        self._works = self._working()

    @property
    def moving(self) -> bool:
        """Whether any model asks for the joints' speeds, or for their power."""
        return any(_quantity(name) in (*SPEEDS, *_PRODUCTS) for name in self.inputs)

    def value(self, column: str, move: Move) -> float:
        """An input's value during a move, in its own unit."""
        quantity, place = _quantity(column), _place(column)
        chosen = place in move.joints
        if quantity in (*self._heating, *LOADS):
            return move.load * self.high[column] * chosen
        if quantity in SPEEDS:
            return move.speed * self.high[column] * chosen
        if quantity in _PRODUCTS:
            return move.load * move.speed * self.high[column] * chosen
        if column == BASE:
            return move.speed * self.high[column] * move.travelling
        if place in self.joints:
            return self.high[column] if chosen else float(self._values[column].min())
        return self._usual(column, bool(move.joints))

    def loads(self, move: Move) -> dict[str, list[float]]:
        """Values of a move's load, by the quantity that each joint logs it as: torque here, current there."""
        values: dict[str, list[float]] = {}
        for joint in move.joints:
            quantity = next((quantity for quantity in self._heating if f"{quantity}.{joint}" in self.inputs), "")
            if quantity:
                values.setdefault(quantity, []).append(self.value(f"{quantity}.{joint}", move))
        return values

    def speeds(self, move: Move) -> list[float]:
        """Mean speed of the move's joints [rad/s]; none where it is not among the inputs."""
        quantity = next((speed for speed in SPEEDS if any(_quantity(name) == speed for name in self.columns)), "")
        columns = (f"{quantity}.{joint}" for joint in move.joints)
        return [self.value(name, move) for name in columns if name in self.high]

    def _heating_quantities(self) -> tuple[str, ...]:
        """Load where it is logged; else whatever else varies from place to place (the heat of a heater)."""
        quantities = dict.fromkeys(_quantity(name) for name in self.inputs)
        loads = tuple(load for load in LOADS if load in quantities)
        others = (quantity for quantity in quantities if quantity not in (*SPEEDS, *_PRODUCTS, _quantity(BASE)))
        return loads or tuple(others)

    def _working(self) -> BoolArray:
        """In which samples any joint carries load or moves."""
        sizes = [
            np.abs(values) > _IN_USE * self.high[name]
            for name, values in self._values.items()
            if _quantity(name) in (*self._heating, *SPEEDS) and self.high[name] > 0
        ]
        samples = len(next(iter(self._values.values()), np.zeros(0)))
        return np.any(sizes, axis=0) if sizes else np.zeros(samples, dtype=bool)

    def _usual(self, column: str, working: bool) -> float:
        """Median of what all share (a computer's heat, the sun) while joints work, or while none does."""
        values = self._values[column]
        chosen = values[self._works == working]
        return float(np.median(chosen if chosen.size else values))


def moves(logged: LoggedInputs, places: Iterable[str]) -> list[Move]:
    """Every move to be considered: the joints in question, their classes, all; loaded, moving, or both.

    Args:
        logged: what the logs show.
        places: what the question is about: nodes, or edges of two.
    """
    proposed = []
    for at, joints in _scopes(logged.joints, places):
        proposed += [Move(at, joints, load=load) for load in _LOAD_LEVELS]
        if logged.moving:
            proposed += [Move(at, joints, speed=speed) for speed in _SPEED_LEVELS]
            proposed += [Move(at, joints, load, speed) for load, speed in product(_LOAD_LEVELS, _SPEED_LEVELS)]
        if BASE in logged.inputs and at == EVERYWHERE:
            proposed += [Move(at, joints, 1.0, speed, travelling=True) for speed in _SPEED_LEVELS]
    return proposed


def _scopes(joints: Sequence[str], places: Iterable[str]) -> list[tuple[str, tuple[str, ...]]]:
    """The joints in question each, their classes, and all joints; each set of joints once."""
    ends = dict.fromkeys(end for place in places for end in place.split("~"))
    asked = [end for end in ends if end in joints]
    singles = _one_of_each_class(asked) if len(asked) > 2 else asked
    classes = dict.fromkeys(class_of(joint) for joint in asked or joints)
    patterns = dict.fromkeys([*singles, *classes, EVERYWHERE])
    scopes: dict[tuple[str, ...], str] = {}
    for pattern in patterns:
        members = tuple(matching(pattern, joints))
        if members:
            scopes.setdefault(members, EVERYWHERE if len(members) == len(joints) > 1 else pattern)
    return [(at, members) for members, at in scopes.items()]


def _one_of_each_class(names: Sequence[str]) -> list[str]:
    first: dict[str, str] = {}
    for name in names:
        first.setdefault(class_of(name), name)
    return list(first.values())


def _high(values: FloatArray) -> float:
    sizes = np.abs(values)
    in_use = sizes[sizes > _IN_USE * sizes.max(initial=0.0)]
    return float(np.quantile(in_use, _ORDINARY)) if in_use.size else 0.0


def _quantity(column: str) -> str:
    return column.partition(".")[0]


def _place(column: str) -> str:
    return column.partition(".")[2]


# --- A program: moves one after the other, from the temperature of the air, as a log's columns -----


STEP = 10.0  # s; short against the time constants of a joint
NAME = "experiment"
AMBIENT = "ambient"
_ROOM = 25.0  # degC; where no run has a first reading


@dataclass(frozen=True)
class Phase:
    """A move and how long it takes [s]."""

    move: Move
    seconds: float


@dataclass(frozen=True)
class Program:
    """Moves one after the other.

    Args:
        phases: the moves.
        ambient: temperature of the air, and of the whole robot at the beginning [degC].
        moved_air: whether that is another than the log's.
    """

    phases: tuple[Phase, ...]
    ambient: float
    moved_air: bool = field(default=False, compare=False)

    @property
    def seconds(self) -> float:
        """How long it takes [s]."""
        return sum(phase.seconds for phase in self.phases)

    @property
    def working(self) -> tuple[Phase, ...]:
        """The phases without rest."""
        return tuple(phase for phase in self.phases if phase.move.joints)


def program(shares: Sequence[tuple[Move, float]], seconds: float, ambient: float, moved_air: bool = False) -> Program:
    """Moves that take shares of the time, and rest for what is left.

    Args:
        shares: each move and its share, 0 to 1.
        seconds: the whole duration.
        ambient: temperature of the air [degC].
        moved_air: whether that is another than the log's.
    """
    phases = [Phase(move, round(share * seconds / STEP) * STEP) for move, share in shares]
    left = round(seconds / STEP) * STEP - sum(phase.seconds for phase in phases)
    if left >= STEP:
        phases.append(Phase(REST, left))
    return Program(tuple(phase for phase in phases if phase.seconds > 0), ambient, moved_air)


class ProgramRuns:
    """Turns programs into runs for the models in question.

    Args:
        models: the rivals' models.
        runs: the fitted runs.
    """

    def __init__(self, models: Sequence[Model], runs: Sequence[Run]) -> None:
        columns = dict.fromkeys(name for model in models for name in model.inputs if name not in model.started)
        self.logged = LoggedInputs(runs, (name for name in columns if not name.startswith("temperature.")))
        self.given = [name for name in columns if name.startswith("temperature.")]
        self.nodes = list(models[0].nodes)
        self._runs = list(runs)
        self._usual = {
            name: float(np.median(np.concatenate([run.columns[name] for run in runs]))) for name in self.given
        }
        self._air = self._air_column(models[0])

    @property
    def ambient(self) -> float:
        """The usual temperature of the air in the logs [degC]; without its column, of the nodes at the start."""
        if self._air is not None:
            return self._usual[self._air]
        return float(np.median([_first(run, self.nodes) for run in self._runs]))

    @property
    def air_can_change(self) -> bool:
        """Whether the air's temperature is an input of the models, or nothing is prescribed."""
        return self._air is not None or not self.given

    def run(self, wanted: Program) -> Run:
        """The program as a log: inputs, and every node at the air's temperature."""
        counts = [round(phase.seconds / STEP) for phase in wanted.phases]
        n = sum(counts)

        def held(column: str) -> FloatArray:
            return np.repeat([self.logged.value(column, phase.move) for phase in wanted.phases], counts).astype(float)

        columns = {name: held(name) for name in self.logged.columns}
        for name in self.given:
            columns[name] = np.full(n, wanted.ambient if name == self._air else self._usual[name])
        columns |= {f"temperature.{node}": np.full(n, wanted.ambient) for node in self.nodes}
        return Run(NAME, STEP, np.arange(n, dtype=np.float64) * STEP, columns, True, "proposed experiment", "")

    def _air_column(self, model: Model) -> str | None:
        """The prescribed temperature that is the air's: the one so named, or the only one."""
        sources = {name: source for name, source in model.network.prescribed.items() if source in self.given}
        chosen = sources.get(AMBIENT, next(iter(sources.values())) if len(sources) == 1 else None)
        return chosen if isinstance(chosen, str) else None


def _first(run: Run, nodes: Sequence[str]) -> float:
    readings = np.array([run.columns[f"temperature.{node}"][0] for node in nodes if run.has(f"temperature.{node}")])
    finite = readings[np.isfinite(readings)]
    return float(np.median(finite)) if finite.size else _ROOM


# --- A proposed run in words that a technician can follow -----------------------------------------


_UNITS = {"torque": "N*m", "torque_abs": "N*m", "current": "A", "current_abs": "A", "power": "W", "heat": "W"}
_ONE_VALUE = 1.1  # values whose largest is no more than so many times the least are given as one


def unit_of(quantity: str) -> str:
    """SI unit of a load, empty where the column's name gives none."""
    return _UNITS.get(quantity, "")


def instructions(wanted: Program, logged: LoggedInputs) -> str:
    """What to do, a sentence or two."""
    air = f"With the robot at rest and as warm as the air, {wanted.ambient:.0f} degC"
    air += ", which is not the temperature of the logs" if wanted.moved_air else ""
    phases = [_phase(phase, logged) for phase in wanted.phases]
    return f"{air}: {', then '.join(phases)}."


def _phase(phase: Phase, logged: LoggedInputs) -> str:
    return f"{_doing(phase.move, logged)} for {phase.seconds / 60:.3g} min"


def _doing(move: Move, logged: LoggedInputs) -> str:
    if not move.joints:
        return "leave it unpowered"
    loads = logged.loads(move).items()
    load = (
        " and ".join(_range(values, unit_of(quantity) or f"of {quantity}") for quantity, values in loads) or "no load"
    )
    where = _where(move)
    if move.travelling:
        base = logged.high.get(BASE, 0.0) * move.speed
        return f"walk at {base:.2g} m/s with {load} at {where}"
    if move.speed == 0.0:
        return f"hold {load} at {where} standing" if logged.moving else f"hold {load} at {where}"
    pace = _range(logged.speeds(move), "rad/s")
    if move.load == 0.0:
        return f"swing {where} without load at {pace} on average"
    return f"move {where} at {pace} on average with {load}"


def _where(move: Move) -> str:
    if move.at == EVERYWHERE:
        return "all joints"
    return f"every {move.at}" if is_glob(move.at) else move.at


def _range(values: Sequence[float], unit: str) -> str:
    """One value, or the least and the largest."""
    if not values:
        return f"the usual {unit}"
    least, most = min(values), max(values)
    if most <= _ONE_VALUE * least:
        return f"{sum(values) / len(values):.2g} {unit}"
    return f"{least:.2g} to {most:.2g} {unit}"
