"""Robots as plain thermal networks with exact steps: truth for trials of controllers, of other code than any model.

A robot is nodes with a heat capacity, links, links to the air, and copper losses of some nodes. What a controller is
told of it is a model file at these values; the truth is the same network with every value off.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from scipy.linalg import expm
from scipy.optimize import least_squares

from lptn.basics.arrays import FloatArray

AIR = 25.0  # degC
Off = Literal["exact", "signs", "uniform", "normal", "cores"]
"""How every capacity, resistance and loss of a plant differs from the model: not at all, each by the whole share up or
down at random, evenly within it, or normally with it as standard deviation (at most 2.5 of them). With cores, up or
down at random, the model has too few masses besides: what a current heats is a winding within its node, `CORE` of its
capacity, that follows the node in `CORE_SECONDS`."""
CORE, CORE_SECONDS = 0.25, 40.0


@dataclass(frozen=True)
class Robot:
    """A network.

    Args:
        name: of the robot.
        nodes: names.
        capacity: J/K, shape (nodes,).
        to_air: conductance [W/K], shape (nodes,), 0 for none.
        links: rows of two nodes, and the resistance between them [K/W].
        loss: electrical resistance of a node's winding [ohm], shape (nodes,), 0 for none.
        measured: nodes with a sensor.
        asked: current that each node with a winding is asked for [A].
        limit: degC, of `limited`.
        limited: nodes; all where none is said.
        pulse: for so long a tenth of the current is asked, and for as long all of it, by turns [s]; 0: always all.
    """

    name: str
    nodes: tuple[str, ...]
    capacity: FloatArray
    to_air: FloatArray
    links: tuple[tuple[int, int, float], ...]
    loss: FloatArray
    measured: tuple[int, ...]
    asked: float
    limit: float = 60.0
    limited: tuple[int, ...] = ()
    pulse: float = 0.0

    def share(self, time: float) -> float:
        """Of `asked` that is asked for at a time [s]."""
        return 0.1 if self.pulse and time // self.pulse % 2 == 0 else 1.0

    @property
    def limits(self) -> dict[str, float]:
        """degC by node."""
        return {self.nodes[node]: self.limit for node in self.limited or range(len(self.nodes))}

    @property
    def driven(self) -> tuple[int, ...]:
        """Nodes with a winding."""
        return tuple(np.flatnonzero(self.loss).tolist())

    def off_by(self, share: float, how: Off, random: np.random.Generator) -> Robot:
        """The same robot with every value off."""

        def factors(count: int) -> FloatArray:
            if how == "exact":
                return np.ones(count)
            if how in ("signs", "cores"):
                return np.asarray(1 + share * random.choice([-1.0, 1.0], count))
            if how == "uniform":
                return np.asarray(1 + share * random.uniform(-1, 1, count))
            return np.asarray(1 + share * np.clip(random.standard_normal(count), -2.5, 2.5))

        counts = (len(self.links), *3 * (len(self.nodes),))
        scaled = self.scaled(np.concatenate([factors(count) for count in counts]))
        return scaled.with_cores() if how == "cores" else scaled

    def with_cores(self) -> Robot:
        """The same with each winding as a node of its own behind the others; sensors and limits stay where they are."""
        inner, count = list(self.driven), len(self.nodes)
        core, loss = CORE * self.capacity[inner], np.append(self.loss, self.loss[inner])
        shell, loss[inner] = self.capacity.copy(), 0.0
        shell[inner] -= core
        ends = zip(inner, range(count, count + len(inner)), (CORE_SECONDS / core).tolist(), strict=True)
        return replace(self, nodes=(*self.nodes, *(f"{self.nodes[node]}_core" for node in inner)),
                       capacity=np.append(shell, core), to_air=np.append(self.to_air, np.zeros(len(inner))),
                       links=(*self.links, *ends), loss=loss, limited=self.limited or tuple(range(count)))  # fmt: skip

    def scaled(self, factors: FloatArray) -> Robot:
        """The same robot with every value times a factor: links, capacities, air, losses, in this order."""
        links, capacity, to_air, loss = np.split(factors, np.cumsum([len(self.links), *2 * (len(self.nodes),)]))
        pairs = tuple((i, j, r * float(by)) for (i, j, r), by in zip(self.links, links, strict=True))
        return replace(self, capacity=self.capacity * capacity, to_air=self.to_air / to_air, links=pairs,
                       loss=self.loss * loss)  # fmt: skip

    def toml(self) -> str:
        """The model file at these values."""
        tables = [f'[model]\nname = "{self.name}"\njoints = [{_quoted(self.nodes[i] for i in self.driven)}]\n'
                  'ambient = "temperature.ambient"']  # fmt: skip
        tables += [
            f"[nodes.{node}]\ncapacity = {c!r}" for node, c in zip(self.nodes, self.capacity.tolist(), strict=True)
        ]
        ends = [(self.nodes[i], self.nodes[j], r) for i, j, r in self.links]
        ends += [(self.nodes[i], "ambient", 1 / float(self.to_air[i])) for i in np.flatnonzero(self.to_air)]
        tables += [f"[[links]]\nbetween = [{_quoted(pair)}]\nresistance = {r!r}" for *pair, r in ends]
        tables += [f'[[effects]]\nkind = "copper_loss"\nat = "{self.nodes[i]}"\ninput = "current"\n'
                   f"resistance = {float(self.loss[i])!r}" for i in self.driven]  # fmt: skip
        return "\n".join([*tables, ""])


def _quoted(names: object) -> str:
    return ", ".join(f'"{name}"' for name in names)  # type: ignore[attr-defined]


class Plant:
    """A robot that warms, in exact steps with the currents held.

    Args:
        robot: at its true values.
        start: degC of all nodes.
        step: s.
    """

    def __init__(self, robot: Robot, start: float, step: float) -> None:
        count = len(robot.nodes)
        conduction = np.diag(robot.to_air)
        for i, j, r in robot.links:
            conduction[np.ix_([i, j], [i, j])] += np.array([[1.0, -1.0], [-1.0, 1.0]]) / r
        whole = np.zeros((2 * count, 2 * count))
        whole[:count, :count] = -conduction / robot.capacity[:, None]
        whole[:count, count:] = np.diag(1 / robot.capacity)
        hold = expm(whole * step)
        self._keep, self._gain = hold[:count, :count].copy(), hold[:count, count:].copy()
        self._driven, self._loss = list(robot.driven), robot.loss[list(robot.driven)]
        self._above, self._heat = np.full(count, start - AIR), np.zeros(count)

    @property
    def temperature(self) -> FloatArray:
        """Of each node [degC]."""
        return np.asarray(self._above + AIR)

    def step(self, currents: FloatArray) -> None:
        """Hold the currents of the driven nodes [A] for a step."""
        self._heat[self._driven] = self._loss * currents**2
        self._above = self._keep @ self._above + self._gain @ self._heat


SURE = float(np.log(1e4))  # odds at which a fault is certain that one robot in some hundreds has


def told_at(robot: Robot, share: float, start: float, step: float, noise: float, readings: FloatArray,
            currents: FloatArray) -> int:  # fmt: skip
    """The first reading at which it can be told that a sensor is false, by whoever knows all but the robot's values.

    That is where the sound robot that explains the readings best, every value off by no more than the share, is less
    probable by `SURE` than a fault that explains them whole. Before, they are as well those of a sound robot, and who
    gives that its torque gives it to this one.

    Args:
        robot: as the model has it.
        share: by which every value may be off.
        start: degC of all nodes.
        step: s between readings, over which currents are held.
        noise: standard deviation of a reading [K].
        readings: without their noise [degC], shape (n, nodes); of nodes without a sensor NaN.
        currents: after each reading [A], shape (n, driven nodes).

    Returns:
        Its number; n for none.
    """
    values = np.concatenate([np.ones(len(robot.links) + len(robot.nodes)), robot.to_air > 0, robot.loss > 0]) > 0

    def off(factors: FloatArray, count: int) -> FloatArray:
        every = np.ones(values.size)
        every[values] = factors
        plant, residuals = Plant(robot.scaled(every), start, step), []
        for row in range(count):
            residuals.append(np.nan_to_num(plant.temperature - readings[row])[list(robot.measured)])
            plant.step(currents[row])
        return np.concatenate(residuals) / noise

    sound, told = 0, len(readings) + 1
    while told - sound > 1:
        count = (sound + told) // 2
        best = least_squares(
            off, np.ones(values.sum()), bounds=(1 - share, 1 + share), args=(count,), xtol=1e-4, ftol=1e-4
        )
        sound, told = (count, told) if best.cost < SURE else (sound, count)
    return told - 1


# --- Robots ---------------------------------------------------------------------------------------


def knee() -> Robot:
    """One mass."""
    return Robot("knee", ("knee",), np.array([300.0]), np.array([0.2]), (), np.array([0.2]), (0,), 20.0)


def motor() -> Robot:
    """A winding in its housing, both read."""
    return Robot("motor", ("motor", "motor_case"), np.array([30.0, 200.0]), np.array([0.0, 1 / 1.2]),
                 ((0, 1, 1.2),), np.array([0.15, 0.0]), (0, 1), 25.0)  # fmt: skip


def leg() -> Robot:
    """Three joints on end."""
    names = ("FR_hip", "FR_thigh", "FR_calf")
    return Robot("leg", names, np.array([300.0, 350.0, 250.0]), np.full(3, 0.1), ((0, 1, 3.0), (1, 2, 2.0)),
                 np.full(3, 0.15), (0, 1, 2), 20.0)  # fmt: skip


def quadruped() -> Robot:
    """Four legs whose hips are bolted to a trunk that nothing heats, and that is read."""
    one, names, links = leg(), [], []
    for number, name in enumerate(("FR", "FL", "RR", "RL")):
        names += [f"{name}_{joint}" for joint in ("hip", "thigh", "calf")]
        links += [(3 * number + i, 3 * number + j, r) for i, j, r in one.links] + [(3 * number, 12, 4.0)]
    return Robot("quadruped", (*names, "trunk"), np.append(np.tile(one.capacity, 4), 3000.0),
                 np.append(np.tile(one.to_air, 4), 0.5), tuple(links), np.append(np.tile(one.loss, 4), 0.0),
                 tuple(range(13)), 20.0)  # fmt: skip


def windings() -> Robot:
    """A leg of which each joint is a winding in its housing; only the housings are read."""
    names = ("hip", "thigh", "calf")
    links = [(k, 3 + k, 1.2) for k in range(3)] + [(3, 4, 3.0), (4, 5, 2.0)]
    return Robot("windings", (*names, *(f"{name}_case" for name in names)), np.repeat([30.0, 200.0], 3),
                 np.repeat([0.0, 1 / 2.0], 3), tuple(links), np.repeat([0.15, 0.0], 3), (3, 4, 5), 25.0)  # fmt: skip


def geared() -> Robot:
    """A motor and its gear without air, as for short missions."""
    return Robot("geared", ("motor", "gear"), np.array([150.0, 400.0]), np.zeros(2), ((0, 1, 0.8),),
                 np.array([0.2, 0.0]), (0, 1), 15.0)  # fmt: skip


def airless() -> Robot:
    """A leg without air."""
    return replace(leg(), name="airless", to_air=np.zeros(3))


def housed() -> Robot:
    """Windings that are limited in housings that alone are read."""
    return replace(windings(), name="housed", limit=100.0, limited=(0, 1, 2))


def gripper() -> Robot:
    """One small mass that closes and opens."""
    return Robot("gripper", ("finger",), np.array([40.0]), np.array([1 / 12]), (), np.array([0.8]), (0,), 4.0,
                 limit=50.0, pulse=60.0)  # fmt: skip


def prosthesis() -> Robot:
    """A motor in its case on a heat sink that a fan cools; nobody reads the case."""
    return Robot("prosthesis", ("knee", "case", "sink"), np.array([35.0, 120.0, 250.0]), np.array([0.0, 0.12, 1.4]),
                 ((0, 1, 0.9), (1, 2, 0.4)), np.array([0.12, 0.0, 0.0]), (0, 2), 30.0, limit=80.0)  # fmt: skip


def arm() -> Robot:
    """Six joints on a base, each smaller than the one before."""
    names = ("base", "shoulder", "elbow", "wrist1", "wrist2", "wrist3")
    return Robot("arm", names, np.array([1500.0, 1300.0, 900.0, 500.0, 450.0, 400.0]),
                 np.array([0.5, 0.35, 0.3, 0.2, 0.18, 0.2]), tuple((i, i + 1, 1.5 + 0.3 * i) for i in range(5)),
                 np.array([0.5, 0.5, 0.6, 0.9, 0.9, 0.9]), tuple(range(6)), 12.0, limit=70.0, pulse=240.0)  # fmt: skip


def hexapod() -> Robot:
    """Six legs of three joints on a body with its computer's heat left out."""
    names, links = [], []
    for leg_number in range(6):
        names += [f"leg{leg_number}_{joint}" for joint in ("coxa", "femur", "tibia")]
        first = 3 * leg_number
        links += [(first, first + 1, 4.0), (first + 1, first + 2, 5.0), (first, 18, 6.0)]
    return Robot("hexapod", (*names, "body"), np.append(np.full(18, 60.0), 1500.0),
                 np.append(np.tile([0.06, 0.08, 0.09], 6), 0.6), tuple(links), np.append(np.full(18, 1.5), 0.0),
                 tuple(range(19)), 3.0, limit=55.0)  # fmt: skip


ROBOTS = {
    make.__name__: make
    for make in (knee, motor, leg, quadruped, geared, airless, housed, gripper, prosthesis, arm, hexapod)
}
