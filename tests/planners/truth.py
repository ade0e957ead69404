"""A quadruped in closed loop: truth from `lptn.virtual`, and a model of it whose every parameter is off."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from lptn.basics.arrays import FloatArray
from lptn.basics.places import class_of, edge
from lptn.model.file import parse_model
from lptn.model.model import Model
from lptn.model.network import Network
from lptn.robots.presets import preset_text
from lptn.virtual import Balance, Robot, draw_quadruped
from lptn.virtual import Forcing as Drive

AMBIENT, SPEED, JOINT_SPEED, COMPUTER = 25.0, 0.5, 2.0, 12.0  # degC, m/s, rad/s, W
NATURAL, FORCED, RISE, COULOMB, VISCOUS = 0.006, 0.5, 0.0039, 0.25, 0.04


def true_robot(seed: int) -> Robot:
    """Twelve joints and the computer, with friction, rising resistance, natural and forced convection."""
    robot = draw_quadruped(seed, "plain")
    for name, value in (("resistance_rise", RISE), ("natural_convection", NATURAL), ("forced_convection", FORCED),
                        ("coulomb", COULOMB), ("viscous", VISCOUS)):  # fmt: skip
        getattr(robot, name)[: robot.joints] = value
    return robot


class World:
    """The true robot walking at constant speed; only its torques are chosen.

    Args:
        robot: the truth.
        start: temperatures of the nodes [degC].
        noise: standard deviation of a reading [K].
        seed: of the noise.
    """

    def __init__(self, robot: Robot, start: FloatArray | float, noise: float = 0.0, seed: int = 0) -> None:
        self.robot, self.network = robot, Balance(robot, AMBIENT)
        self.temperature = self.network.start(np.broadcast_to(start, len(robot.nodes)).astype(float))
        self.noise, self._random = noise, np.random.default_rng(seed)

    def step(self, torque: FloatArray, seconds: int) -> FloatArray:
        """Hold torques [N*m]; returns the temperatures after each second, shape (seconds, nodes)."""
        robot, joints = self.robot, slice(0, self.robot.joints)
        copper, other = np.zeros(len(robot.nodes)), np.zeros(len(robot.nodes))
        copper[joints] = robot.resistance[joints] * (torque / robot.torque_constant[joints]) ** 2
        other += robot.coulomb * JOINT_SPEED + robot.viscous * JOINT_SPEED**2 + robot.drive
        other[robot.nodes.index("pc")] += COMPUTER
        to_air = robot.to_air * (1 + robot.forced_convection * SPEED)
        held = [np.tile(constant, (seconds, 1)) for constant in (copper, other, to_air)]
        path = self.network.solve(Drive(*held), self.temperature)
        self.temperature = path[-1]
        return np.asarray(path[1:])

    def read(self) -> FloatArray:
        """Readings [degC] with noise."""
        return np.asarray(self.temperature + self.noise * self._random.standard_normal(len(self.temperature)))


def model_of(robot: Robot, error: float, seed: int = 0) -> Model:
    """The preset quadruped at the robot's values, every one of them off by `error` (relative), up or down at random."""
    network = parse_model(preset_text("quadruped"), Path("quadruped.toml")).network
    random = np.random.default_rng(seed)
    values = {}
    for parameter in network.parameters:
        true = _true(robot, network, parameter.name)
        if true is not None:
            values[parameter.name] = true * (1 + error * random.choice([-1.0, 1.0]))
    return Model(network.with_values(values))


def conditions(names: tuple[str, ...]) -> FloatArray:
    """Inputs of the model beside torques, as they are in this world."""
    given = {"temperature.ambient": AMBIENT, "speed.base": SPEED, "power.pc": COMPUTER}
    by_feature = {"velocity": JOINT_SPEED, "velocity_rms": JOINT_SPEED, "powered": 1.0}
    return np.array([given[name] if name in given else by_feature[name.partition(".")[0]] for name in names])


def _true(robot: Robot, network: Network, name: str) -> float | None:
    """The robot's value of a parameter of the model; `None` for one that is exact (a reference temperature, a gain)."""
    kind, _, place = name.rpartition(".")
    nodes = robot.nodes
    if kind == "capacity":
        return float(robot.capacity[nodes.index(place)])
    if kind == "resistance":
        ends = [end for end in place.split("~") if end != "ambient"]
        if len(ends) == 1:
            return float(1 / robot.to_air[nodes.index(ends[0])])
        resistances = {edge(nodes[i], nodes[j]): 1 / g for i, j, g in robot.links}
        return float(resistances[place])
    arrays = {"copper_loss.resistance": robot.resistance, "resistance_rise.alpha": robot.resistance_rise,
              "coulomb_friction.torque": robot.coulomb, "viscous_friction.damping": robot.viscous,
              "drive_heat.power": robot.drive, "natural_convection.beta": robot.natural_convection,
              "forced_convection.gamma": robot.forced_convection}  # fmt: skip
    if kind not in arrays:
        return None
    index = nodes.index(place) if place in nodes else next(i for i, node in enumerate(nodes) if _like(node, place))
    return float(arrays[kind][index])


def _like(node: str, place: str) -> bool:
    return place in ("*", "*_*", class_of(node))


def stage_means(values: FloatArray, step: float, stages: FloatArray) -> FloatArray:
    """Means of a piecewise constant signal over each stage; its last value goes on for ever.

    Args:
        values: shape (n, signals), each row held for `step` seconds.
        step: [s].
        stages: lengths [s], shape (stages,).

    Returns:
        Shape (stages, signals).
    """
    ends = np.concatenate([[0.0], np.cumsum(stages)])
    edges = step * np.arange(len(values) + 1)
    edges[-1] = max(edges[-1], ends[-1])
    sums = np.vstack([np.zeros((1, values.shape[1])), np.cumsum(values * np.diff(edges)[:, None], axis=0)])
    at = np.column_stack([np.interp(ends, edges, column) for column in sums.T])
    return np.asarray(np.diff(at, axis=0) / np.asarray(stages)[:, None])
