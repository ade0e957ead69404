"""The true heat balance: what acts on the nodes in each interval, and its integration.

Fed with the exact means over each interval of |τ|, τ², |ω|, ω², |ω|^1.5, |τ ω| and |v|: heat is linear in these, and
the factors that depend on temperature hardly move in a second. There are two schemes with steps of 1 s: RK4 for the
leg, and for the quadruped, whose windings are light, a matrix exponential that is five times as fast.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from itertools import repeat
from typing import Self

import numpy as np
from scipy.linalg import expm

from .robot import GEAR, MOTOR_CONSTANT, PC, WINDING_RESISTANCE, Array, Robot

STEFAN_BOLTZMANN = 5.670374419e-8  # W/(m² K⁴)
KELVIN = 273.15
REFERENCE = 25.0  # degC, at which resistance and torque constant are given
TOO_HOT = 150.0  # degC: beyond it no sum of effects means anything
BLOCK = 60  # s between two looks at the limits

# --- what acts on the nodes ----------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Series:
    """Arrays with a row an interval; ``None`` for what there is not."""

    def since(self, interval: int) -> Self:
        """Return the same from this interval on."""
        rows = {one.name: getattr(self, one.name) for one in fields(self)}
        return replace(self, **{name: None if value is None else value[interval:] for name, value in rows.items()})

    @classmethod
    def joined(cls, pieces: Sequence[Self]) -> Self:
        """Return pieces that have the same arrays as one, one after the other."""
        first = pieces[0]
        names = [one.name for one in fields(first) if getattr(first, one.name) is not None]
        return replace(first, **{name: np.concatenate([getattr(piece, name) for piece in pieces]) for name in names})


Shared = Mapping[str, Array]
"""Means of what all nodes share by the columns of a log, each of shape (intervals, 1): power.pc and power.battery
(W), speed.fan (share of its full speed), irradiance.global (W/m²)."""


@dataclass(frozen=True)
class Means(Series):
    """Means of the inputs over intervals: of shape (intervals, joints), and (intervals, 1) for the wind.

    torque1: |τ|. torque2: τ². speed: |ω|. speed2: ω². speed15: |ω|^1.5. power: |τ ω|. wind: |v| to the robot's
    exponent. powered: share of the interval with the joint's drive on; ``None`` where drives have no heat of their own.
    shared: what all nodes share, ``None`` for nothing.
    """

    torque1: Array
    torque2: Array
    speed: Array
    speed2: Array
    speed15: Array
    power: Array
    wind: Array
    powered: Array | None = None
    shared: Shared | None = None

    @classmethod
    def of_samples(cls, torque: Array, velocity: Array, wind: Array, mean: Callable[[Array], Array]) -> Means:
        """Average samples by ``mean``, which takes values of shape (samples, joints); the wind is averaged already."""
        force, speed = np.abs(torque), np.abs(velocity)
        return cls(
            torque1=mean(force),
            torque2=mean(torque**2),
            speed=mean(speed),
            speed2=mean(speed**2),
            speed15=mean(speed**1.5),
            power=mean(force * speed),
            wind=wind,
        )


@dataclass(frozen=True)
class Forcing(Series):
    """What acts on the nodes in each interval; arrays have the shape (intervals, nodes).

    copper: W at 25 degC. other: W, independent of temperature; further columns are for the windings that are masses of
    their own. to_air: W/K at the ambient's temperature. shift: K of the ambient above the network's, of shape
    (intervals,); ``None`` for none.
    """

    copper: Array
    other: Array
    to_air: Array
    shift: Array | None = None

    def shifted(self, shift: Array | None) -> Forcing:
        """Return the same with the ambient above the network's by the shift (K) at the intervals' ends."""
        return self if shift is None else replace(self, shift=(shift[:-1] + shift[1:]) / 2)


def forcing(robot: Robot, means: Means, extra: Array) -> Forcing:
    """Turn means into what acts on the nodes; ``extra`` is further heat, W, of shape (intervals, nodes)."""
    friction = _at_nodes(robot, means.speed) * robot.coulomb + _at_nodes(robot, means.speed2) * robot.viscous
    friction = friction + _at_nodes(robot, means.speed15) * robot.iron + _at_nodes(robot, means.power) * robot.gear
    other = friction + robot.constant + extra
    drives = _at_nodes(robot, means.torque1) * robot.driver
    to_air = 1 + means.wind * robot.forced_convection
    if means.shared is not None:
        shared = means.shared
        power = shared["power.pc"] * robot.computer, shared["power.battery"] * robot.battery
        other = other + power[0] + power[1] + shared["irradiance.global"] * robot.sunlit
        to_air = to_air + shared["speed.fan"] * robot.fanned
    if means.powered is not None:
        drives = _at_nodes(robot, means.powered) * robot.drive + drives
    # The drive's board sits on the motor's back: it heats the winding where that is a mass of its own.
    wound = np.flatnonzero(robot.winding > 0)
    other = np.concatenate([other + drives * (robot.winding == 0), drives[:, wound]], axis=1)
    return Forcing(copper_loss(robot, means), other, to_air * robot.to_air)


def copper_loss(robot: Robot, means: Means) -> Array:
    """Return each node's copper loss at 25 degC, W, of shape (intervals, nodes)."""
    loss: Array = _at_nodes(robot, means.torque2) * robot.resistance / robot.torque_constant**2
    return loss


def battery_power(rest: Array, means: Means) -> Array:
    """Return what the battery gives to the nominal robot, W, of shape (intervals, 1).

    Copper loss and mechanical power of all joints, beside the rest: computer and drives.
    """
    copper = WINDING_RESISTANCE / (GEAR * MOTOR_CONSTANT) ** 2 * means.torque2
    power: Array = rest + (copper + means.power).sum(axis=1, keepdims=True)
    return power


def _at_nodes(robot: Robot, values: Array) -> Array:
    missing = len(robot.nodes) - values.shape[1]
    return np.pad(values, ((0, 0), (0, missing))) if missing else values


# --- the balance and its integration -------------------------------------------------------------------------------


class Balance:
    """The heat balance around one ambient temperature (degC); states are the nodes, the windings, the hidden masses.

    ``sensed`` are the indices of the states that the nodes' sensors sit on.
    """

    def __init__(self, robot: Robot, ambient: float) -> None:
        self.robot, self.ambient, self.count = robot, ambient, len(robot.nodes)
        self.wound = np.flatnonzero(robot.winding > 0)
        first = self.count + len(self.wound)
        self.windings = slice(self.count, first)
        # Without a winding of its own, the node makes the copper's heat and has the sensor.
        self.copper = np.arange(self.count)
        self.copper[self.wound] = np.arange(self.count, first)
        self.unwound = np.where(robot.winding > 0, 0.0, 1.0)
        self.sensed = self.copper[: robot.sensed]
        links = robot.links + [(int(i), self.count + k, 1 / robot.inside[i]) for k, i in enumerate(self.wound)]
        links = links + [(end, first + k, 1 / m.resistance) for k, m in enumerate(robot.masses) for end in m.ends]
        self.hidden_air = np.array([0.0] * first + [m.to_air for m in robot.masses])
        self.exchange = -np.diag(self.hidden_air)
        for i, j, conductance in links:
            self.exchange[[i, j], [i, j]] -= conductance
            self.exchange[[i, j], [j, i]] += conductance
        self.supply = self.hidden_air * ambient + np.array([0.0] * first + [m.heat for m in robot.masses])
        masses = [m.capacity for m in robot.masses]
        self.capacity = np.concatenate([robot.capacity, robot.winding[self.wound], masses])
        self.ambient_fourth = (ambient + KELVIN) ** 4
        self.emission = robot.emissive_area * STEFAN_BOLTZMANN  # W/K⁴

    def held(self, inputs: Mapping[str, float], seconds: int) -> Forcing:
        """Return what acts on the nodes while the columns of a log hold, for a robot that is stepped from outside.

        Torque is the RMS, velocity the mean magnitude. Gear loss takes speed and torque for proportional, iron loss
        the speed for constant; the quadruped has neither.
        """
        robot = self.robot

        def of(quantity: str) -> Array:
            return np.array([[inputs[f"{quantity}.{joint}"] for joint in robot.nodes[: robot.joints]]])

        torque, speed, rms = of("torque"), of("velocity"), of("velocity_rms")
        wind = np.array([[abs(inputs["speed.base"]) ** robot.wind_exponent]])
        means = Means(torque, torque**2, speed, rms**2, rms**1.5, torque * rms, wind, of("powered"))
        extra = np.zeros((1, len(robot.nodes)))
        extra[0, robot.nodes.index(PC)] = inputs[f"power.{PC}"]
        second = forcing(robot, means, extra)
        shift = np.array([inputs["temperature.ambient"] - self.ambient])
        acting = (second.copper, second.other, second.to_air, shift)
        return Forcing(*(np.repeat(term, seconds, axis=0) for term in acting))

    def slope(self, T: Array, copper: Array, other: Array, to_air: Array, shift: float | None = None) -> Array:
        """Return dT/dt in K/s at the temperatures T (degC), under one interval of a ``Forcing``."""
        robot, node = self.robot, T[: self.count]
        ambient, fourth = self.ambient, self.ambient_fourth
        if shift is not None:
            ambient, fourth = ambient + shift, (ambient + shift + KELVIN) ** 4
        above, warm = node - ambient, T[self.copper] - REFERENCE
        generated = copper * (1 + robot.resistance_rise * warm) / (1 - robot.torque_constant_drop * warm) ** 2
        convected = to_air * np.exp(robot.natural_convection * above) * above
        radiated = self.emission * ((node + KELVIN) ** 4 - fourth)
        heat: Array = self.exchange @ T + self.supply
        if shift is not None:
            heat += self.hidden_air * shift
        heat[: self.count] += self.unwound * generated + other[: self.count] - convected - radiated
        if len(self.wound):
            heat[self.windings] += generated[self.wound] + other[self.count :]
        slope: Array = heat / self.capacity
        return slope

    def start(self, nodes: Array) -> Array:
        """Return the state with the nodes at these temperatures (degC), each winding and hidden mass at its nodes'."""
        inner = [nodes[m.ends].mean() for m in self.robot.masses]
        return np.concatenate([nodes, nodes[self.wound], inner])

    def solve(self, forcing: Forcing, start: Array) -> Array:
        """Return temperatures (degC) at 0, 1, … s, of shape (seconds + 1, states), by RK4 steps of 1 s."""
        T = np.empty((len(forcing.copper) + 1, len(start)))
        T[0] = start
        shifts = repeat(None) if forcing.shift is None else forcing.shift
        # The shifts may go on for ever: not strict.
        for k, (copper, other, to_air, shift) in enumerate(
            zip(forcing.copper, forcing.other, forcing.to_air, shifts, strict=False)
        ):
            now, inputs = T[k], (copper, other, to_air, shift)
            a = self.slope(now, *inputs)
            b = self.slope(now + a / 2, *inputs)
            c = self.slope(now + b / 2, *inputs)
            d = self.slope(now + c, *inputs)
            T[k + 1] = now + (a + 2 * b + 2 * c + d) / 6
        return T


class Exponential:
    """Steps of 1 s for one network, within 1e-3 K of RK4: conduction exactly, all else at the middle of each second.

    Conduction between nodes, windings and masses is linear and constant, so its matrix exponential carries a second
    exactly, however light a winding is. Copper, convection and radiation hardly change in a second; they are evaluated
    once, at the temperatures expected in its middle (second order).
    """

    def __init__(self, network: Balance) -> None:
        self.network, states = network, len(network.capacity)
        rates = network.exchange / network.capacity[:, None]
        # exp of [[A, 1], [0, 0]] holds exp(A) and the integral of exp(A t): what a constant slope adds.
        both = np.zeros((2 * states, 2 * states))
        both[:states, :states], both[:states, states:] = rates, np.eye(states)
        whole = expm(both)
        keep, add = whole[:states, :states], whole[:states, states:] / network.capacity
        robot, count = network.robot, network.count
        # Copper's heat goes to the winding, or to the node where there is none.
        copper = np.zeros((states, count))
        copper[network.copper, np.arange(count)] = 1.0
        self.step = np.concatenate([keep, add[:, : network.windings.stop], add @ copper], axis=1)
        self.supply = add @ network.supply
        self.hidden_air = add @ network.hidden_air
        self.nonlinear = bool(robot.natural_convection.any()), bool(robot.torque_constant_drop.any())

    def solve(self, forcing: Forcing, start: Array, *, above: float = np.inf, below: float = -np.inf) -> Array:
        """Return temperatures (degC) at 0, 1, … s.

        Args:
            forcing: what acts in each second.
            start: the state at 0 s.
            above: degC; the last row is the first one with a joint's sensor above it.
            below: degC; the last row is the first one with all joints' sensors below it.

        Returns:
            Shape (seconds + 1, states), or fewer rows if a limit was passed.
        """
        T = np.empty((len(forcing.copper) + 1, len(start)))
        T[0], before = start, start
        watched = self.network.sensed[: self.network.robot.joints]
        for begin in range(0, len(forcing.copper), BLOCK):
            end = min(begin + BLOCK, len(forcing.copper))
            before = self._advance(T, before, forcing, begin, end)
            hottest = T[begin + 1 : end + 1, watched].max(axis=1)
            passed = np.flatnonzero((hottest > above) | (hottest < below))
            if len(passed):
                return T[: begin + 2 + passed[0]].copy()
        return T

    def _advance(self, T: Array, before: Array, forcing: Forcing, begin: int, end: int) -> Array:
        """Fill the rows from begin + 1 to end; ``before`` is the row before begin. Return the last row but one."""
        network, robot = self.network, self.network.robot
        natural, magnets = self.nonlinear
        count, emission, rise, drop = network.count, network.emission, robot.resistance_rise, robot.torque_constant_drop
        states = T.shape[1]
        shift = np.zeros(len(forcing.copper)) if forcing.shift is None else forcing.shift
        ambient, ambient_fourth = network.ambient + shift, np.full(len(shift), network.ambient_fourth)
        if forcing.shift is not None:
            ambient_fourth = (ambient + KELVIN) ** 4
        acting = np.empty(self.step.shape[1])
        for k in range(begin, end):
            now = T[k]
            middle = 1.5 * now - 0.5 * before
            node, warm = middle[:count], middle[network.copper] - REFERENCE
            higher = node - ambient[k]
            generated = forcing.copper[k] * (1 + rise * warm)
            if magnets:
                generated /= (1 - drop * warm) ** 2
            lost = forcing.to_air[k] * higher
            if natural:
                lost *= np.exp(robot.natural_convection * higher)
            squared = (node + KELVIN) ** 2
            lost += emission * (squared * squared - ambient_fourth[k])
            acting[:states], acting[states:-count], acting[-count:] = now, forcing.other[k], generated
            acting[states : states + count] -= lost
            T[k + 1] = self.step @ acting + self.supply + shift[k] * self.hidden_air
            before = now
        return before


def check_temperatures(states: Array, robot: str, run: str) -> None:
    """Refuse what no robot survives; ``robot`` and ``run`` are for the message.

    Raises:
        ValueError: effects so large that the robot passes 150 degC.
    """
    if not np.all(states < TOO_HOT):
        raise ValueError(f"hidden: the {robot} passes {TOO_HOT:g} degC in {run}; expected smaller sizes")
