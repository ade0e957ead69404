"""Standing: which forces at the feet hold a robot and its load, and which torques they ask of the joints."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lptn.basics.arrays import FloatArray

from .body import Body

GRAVITY = 9.81  # m/s²


@dataclass(frozen=True)
class Stance:
    """A posture and what it has to bear.

    Args:
        angles: of the joints [rad], shape (joints,), in the body's order.
        load: on the trunk [kg].
        load_at: where the load's centre is, in the trunk's frame [m].
        standing: the legs that touch the ground, all by default.
        friction: coefficient of friction that may be used.
        least_normal: least normal force of a foot that stands [N].
        roll, pitch: of the trunk [rad]; the ground is level.
    """

    angles: FloatArray | Sequence[float]
    load: float = 0.0
    load_at: tuple[float, float, float] = (0.0, 0.0, 0.1)
    standing: Sequence[str] | None = None
    friction: float = 0.6
    least_normal: float = 2.0
    roll: float = 0.0
    pitch: float = 0.0


@dataclass(frozen=True)
class Statics:
    """The linear equations of a stance; forces of the ground on the feet [N], leg by leg, in the trunk's frame.

    Equilibrium is `balance @ forces == weight`, torques of the joints [N·m] are `idle + lever @ forces`.

    Args:
        balance: shape (6, 3 legs): force and moment about the trunk's origin.
        weight: shape (6,).
        lever: shape (joints, 3 legs).
        idle: torque that the legs' own weight asks for, shape (joints,).
        up: the ground's normal, shape (3,).
        standing: which legs stand, shape (legs,).
        most: torque limits [N·m], shape (joints,).
    """

    balance: FloatArray
    weight: FloatArray
    lever: FloatArray
    idle: FloatArray
    up: FloatArray
    standing: list[bool]
    most: FloatArray

    def torques(self, forces: FloatArray) -> FloatArray:
        """Torque of each joint [N·m], shape (joints,), for forces of shape (legs, 3)."""
        return np.asarray(self.idle + self.lever @ np.ravel(forces))

    def equal(self) -> FloatArray:
        """The forces that hold the robot and differ least from equal vertical ones, shape (legs, 3)."""
        free = np.repeat(self.standing, 3)
        total = float(self.weight[:3] @ self.up)
        wish = np.outer(self.standing, self.up) * total / sum(self.standing)
        missing = self.weight - self.balance @ wish.ravel()
        forces = wish.ravel()
        forces[free] += np.linalg.pinv(self.balance[:, free]) @ missing
        return forces.reshape(-1, 3)


def statics(body: Body, stance: Stance) -> Statics:
    """The equations of a stance.

    Raises:
        ValueError: angles of the wrong number, a leg that the body hasn't, numbers that can't be.
    """
    names = [leg.name for leg in body.legs]
    standing = names if stance.standing is None else list(stance.standing)
    _check(body, stance, standing, names)
    up = _up(stance.roll, stance.pitch)
    legs = body.legs_at(np.asarray(stance.angles, dtype=float))
    count = len(legs)
    balance, lever, idle = np.zeros((6, 3 * count)), np.zeros((3 * count, 3 * count)), np.zeros(3 * count)
    masses, centres = [body.mass, stance.load], [body.centre, np.array(stance.load_at)]
    for k, (leg, state) in enumerate(zip(body.legs, legs, strict=True)):
        block = slice(3 * k, 3 * k + 3)
        contact = state.foot - body.foot_radius * up
        balance[:3, block], balance[3:, block] = np.eye(3), _cross(contact)
        # Virtual work: the joints hold what the ground's force and the links' weight would turn.
        lever[block, block] = -state.jacobian(contact).T
        for link in range(3):
            moved = state.jacobian(state.centres[link], link + 1)
            idle[block] += leg.masses[link] * GRAVITY * (moved.T @ up)
        masses += leg.masses.tolist()
        centres += list(state.centres)
    weight = np.concatenate([
        sum(masses) * GRAVITY * up,
        sum((np.cross(c, m * GRAVITY * up) for m, c in zip(masses, centres, strict=True)), np.zeros(3)),
    ])  # fmt: skip
    most = np.tile(body.torque_limit, count)
    return Statics(balance, weight, lever, idle, up, [name in standing for name in names], most)


def _check(body: Body, stance: Stance, standing: list[str], names: list[str]) -> None:
    if np.shape(stance.angles) != (len(body.joints),) or not np.isfinite(stance.angles).all():
        raise ValueError(f"angles: found shape {np.shape(stance.angles)}; expected {len(body.joints)} numbers [rad]")
    unknown = [name for name in standing if name not in names]
    if unknown or len(standing) < 3:
        found = unknown[0] if unknown else f"{len(standing)} legs"
        raise ValueError(f"standing: found {found}; expected three or more of {', '.join(names)}")
    for name, value, least in (("load", stance.load, 0.0), ("friction", stance.friction, 1e-3),
                               ("least_normal", stance.least_normal, 0.0)):  # fmt: skip
        if not (np.isfinite(value) and value >= least):
            raise ValueError(f"{name}: found {value:g}; expected {least:g} or more")


def _up(roll: float, pitch: float) -> FloatArray:
    """The world's vertical in the trunk's frame."""
    return np.array([-np.sin(pitch), np.sin(roll) * np.cos(pitch), np.cos(roll) * np.cos(pitch)])


def _cross(r: FloatArray) -> FloatArray:
    x, y, z = r.tolist()
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
