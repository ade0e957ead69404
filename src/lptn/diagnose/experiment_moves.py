"""What a robot can be asked to do for an experiment: loads and speeds that its own logs have shown."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from lptn.arrays import BoolArray, FloatArray
from lptn.logs import Run
from lptn.places import EVERYWHERE, class_of, matching

LOADS = ("torque", "current", "torque_abs", "current_abs")
SPEEDS = ("velocity", "velocity_rms")
BASE = "speed.base"
_PRODUCTS = ("mechanical_power",)
_ORDINARY = 0.95  # quantile of a column while it is in use: high, yet nothing that happened only once
_IN_USE = 0.05  # share of a column's largest value from which on it is in use
_LOAD_LEVELS, _SPEED_LEVELS = (0.6, 1.0), (0.4, 1.0)  # shares of the high ordinary value


@dataclass(frozen=True)
class Move:
    """One thing to do: some joints work, all other drives are off.

    Args:
        at: a joint, a class (`"*_calf"`), or `"*"`; empty for rest with all drives off.
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


class Logged:
    """What the runs show of each input: its high ordinary value, and what it is while joints work or rest.

    Args:
        runs: the fitted runs.
        inputs: the models' inputs, without temperatures.
    """

    def __init__(self, runs: Sequence[Run], inputs: Iterable[str]) -> None:
        self.inputs = tuple(inputs)
        # Loads and speeds that no model asks for say in words what a move is.
        known = (name for name in runs[0].columns if _quantity(name) in (*LOADS, *SPEEDS))
        also = (name for name in known if all(run.has(name) for run in runs))
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

    def loads(self, move: Move) -> tuple[str, list[float]]:
        """The quantity that a move's load is of, and its values at the move's joints."""
        quantity = next((each for each in self._heating if any(_quantity(name) == each for name in self.inputs)), "")
        return quantity, [self.value(f"{quantity}.{joint}", move) for joint in move.joints]

    def speeds(self, move: Move) -> list[float]:
        """Mean speed of the move's joints [rad/s]; none where it is not among the inputs."""
        quantity = next((each for each in SPEEDS if any(_quantity(name) == each for name in self.columns)), "")
        columns = (f"{quantity}.{joint}" for joint in move.joints)
        return [self.value(name, move) for name in columns if name in self.high]

    def _heating_quantities(self) -> tuple[str, ...]:
        """Load where it is logged; else whatever else varies from place to place (the heat of a heater)."""
        quantities = dict.fromkeys(_quantity(name) for name in self.inputs)
        loads = tuple(each for each in LOADS if each in quantities)
        others = (each for each in quantities if each not in (*SPEEDS, *_PRODUCTS, _quantity(BASE)))
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
        found = values[self._works == working]
        return float(np.median(found if found.size else values))


def moves(logged: Logged, places: Iterable[str]) -> list[Move]:
    """Every move worth a thought: the joints in question, their classes, all; loaded, moving, or both.

    Args:
        logged: what the logs show.
        places: what the question is about: nodes, or edges of two.
    """
    found = []
    for at, joints in _scopes(logged.joints, places):
        found += [Move(at, joints, load=load) for load in _LOAD_LEVELS]
        if logged.moving:
            found += [Move(at, joints, speed=speed) for speed in _SPEED_LEVELS]
            found += [Move(at, joints, load, speed) for load, speed in product(_LOAD_LEVELS, _SPEED_LEVELS)]
        if BASE in logged.inputs and at == EVERYWHERE:
            found += [Move(at, joints, 1.0, speed, travelling=True) for speed in _SPEED_LEVELS]
    return found


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
