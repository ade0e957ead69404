"""A standing robot: its body (masses, lengths, feet), its posture and load, and the torques that hold it.

Legs turn at the hip about x, at thigh and calf about y.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from importlib.resources import files
from pathlib import Path
from typing import Annotated, Any

import casadi as ca
import numpy as np
from pydantic import Field

from lptn.basics.arrays import FloatArray
from lptn.basics.errors import InputError
from lptn.basics.files import text_of
from lptn.basics.toml import Number, Strict, mistakes_by_line, toml_of
from lptn.planners.values import NotNegative, Positive

PARTS = ("hip", "thigh", "calf")
Vector = Annotated[list[Number], Field(min_length=3, max_length=3)]
GRAVITY = 9.81  # m/s²


@dataclass(frozen=True)
class Leg:
    """One leg; vectors in m, each in the frame of the link before.

    Args:
        name: such as `FR`; its joints are `FR_hip`, `FR_thigh`, `FR_calf`.
        joints: where the axes of hip, thigh and calf are, shape (3, 3).
        foot: in the calf's frame, shape (3,).
        masses: of hip, thigh and calf [kg], shape (3,).
        centres: of mass, each in its own link's frame, shape (3, 3).
    """

    name: str
    joints: FloatArray
    foot: FloatArray
    masses: FloatArray
    centres: FloatArray

    @cached_property
    def statics(self) -> ca.Function:
        """(angles [rad], the ground's normal, radius of the foot [m]) -> what the leg bears, in the trunk's frame.

        Where the foot touches the ground [m]; the links' centres of mass [m], one a column; torques of the joints per
        force there [m]; torques that the links' own weight asks for [N·m].
        """
        angles, up, radius = (ca.SX.sym(name, size) for name, size in (("angles", 3), ("up", 3), ("radius", 1)))
        turned, origin, centres = ca.SX.eye(3), ca.SX.zeros(3), list[ca.SX]()
        for k in range(3):
            origin = origin + turned @ self.joints[k]
            c, s = ca.cos(angles[k]), ca.sin(angles[k])
            about: list[Any] = (
                [1, 0, 0, 0, c, s, 0, -s, c] if k == 0 else [c, 0, -s, 0, 1, 0, s, 0, c]
            )  # column by column
            turned = turned @ ca.reshape(ca.vertcat(*about), 3, 3)
            centres.append(origin + turned @ self.centres[k])
        # Virtual work: the joints hold what the ground's force, on the calf, and the links' weight would turn.
        below = ca.SX.sym("below", 3)  # that point, from the foot's middle, in the calf's frame
        contact = origin + turned @ (self.foot + below)
        height = sum(mass * ca.dot(up, centre) for mass, centre in zip(self.masses.tolist(), centres, strict=True))
        found = [contact, ca.horzcat(*centres), -ca.jacobian(contact, angles).T, GRAVITY * ca.gradient(height, angles)]
        found = ca.substitute(found, [below], [-radius * turned.T @ up])
        return ca.Function("statics", [angles, up, radius], [ca.densify(one) for one in found])


@dataclass(frozen=True)
class Body:
    """A robot on legs.

    Args:
        name: what it is called.
        legs: in the order of the joints.
        mass: of the trunk [kg].
        centre: of mass of the trunk [m], shape (3,).
        torque_limit: of hip, thigh and calf [N·m], shape (3,).
        foot_radius: of the feet [m].
    """

    name: str
    legs: tuple[Leg, ...]
    mass: float
    centre: FloatArray
    torque_limit: FloatArray
    foot_radius: float = 0.0

    @property
    def joints(self) -> list[str]:
        """Names of all joints, leg by leg."""
        return [f"{leg.name}_{part}" for leg in self.legs for part in PARTS]


# --- standing ------------------------------------------------------------------------------------


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
    if np.shape(stance.angles) != (len(body.joints),) or not np.isfinite(stance.angles).all():
        raise ValueError(f"angles: found shape {np.shape(stance.angles)}; expected {len(body.joints)} numbers [rad]")
    names = [leg.name for leg in body.legs]
    standing = names if stance.standing is None else list(stance.standing)
    unknown = [name for name in standing if name not in names]
    if unknown or len(standing) < 3:
        wrong = unknown[0] if unknown else f"{len(standing)} legs"
        raise ValueError(f"standing: found {wrong}; expected three or more of {', '.join(names)}")
    for name, least in (("load", 0.0), ("friction", 1e-3), ("least_normal", 0.0)):
        if not least <= (value := getattr(stance, name)) < np.inf:
            raise ValueError(f"{name}: found {value:g}; expected {least:g} or more")
    # The world's vertical in the trunk's frame.
    level = np.cos(stance.pitch)
    up = np.array([-np.sin(stance.pitch), np.sin(stance.roll) * level, np.cos(stance.roll) * level])
    count = len(body.legs)
    balance, lever, idle = np.zeros((6, 3 * count)), np.zeros((3 * count, 3 * count)), np.zeros(3 * count)
    masses, centres = [body.mass, stance.load], [body.centre, np.array(stance.load_at)]
    for k, (leg, angles) in enumerate(zip(body.legs, np.reshape(stance.angles, (-1, 3)), strict=True)):
        block = slice(3 * k, 3 * k + 3)
        contact, links, lever[block, block], held = (x.full() for x in leg.statics(angles, up, body.foot_radius))
        balance[:3, block], balance[3:, block] = np.eye(3), np.cross(contact.ravel(), np.eye(3)).T
        idle[block] = held.ravel()
        masses += leg.masses.tolist()
        centres += list(links.T)
    weight = np.concatenate([
        sum(masses) * GRAVITY * up,
        sum((np.cross(c, m * GRAVITY * up) for m, c in zip(masses, centres, strict=True)), np.zeros(3)),
    ])  # fmt: skip
    most = np.tile(body.torque_limit, count)
    return Statics(balance, weight, lever, idle, up, [name in standing for name in names], most)


# --- files --------------------------------------------------------------------------------------


class _Link(Strict):
    mass: Positive
    centre: Vector


class _LegTable(Strict):
    thigh_at: Vector
    calf_at: Vector
    foot_at: Vector
    hip: _Link
    thigh: _Link
    calf: _Link


class _File(Strict):
    name: str
    torque_limit: Annotated[list[Positive], Field(min_length=3, max_length=3)]
    foot_radius: NotNegative = 0.0
    trunk: _Link
    leg: _LegTable
    hips: Annotated[dict[str, Vector], Field(min_length=3)]


def load_body(source: str | Path = "a1") -> Body:
    """A robot by its name here (`a1`), or from a file of your own with the same keys as `a1.toml`.

    Args:
        source: a name without a suffix, or a `.toml` file.

    Raises:
        InputError: there is no such file, or something in it can't be used.
    """
    if isinstance(source, str) and not source.endswith(".toml"):
        ready = files("lptn.applications.load_sharing").joinpath(f"{source}.toml")
        if not ready.is_file():
            raise InputError("body", "name", f'"{source}"', 'a1, or the path of a ".toml" file')
        path, text = Path(f"{source}.toml"), ready.read_text(encoding="utf-8")
    else:
        path = Path(source)
        text = text_of(path, "a file like a1.toml")
    with mistakes_by_line(path, text):
        tables = _File.model_validate(toml_of(path, text))
    links = [getattr(tables.leg, part) for part in PARTS]
    legs = []
    for name, at in tables.hips.items():
        # The left leg's values mirrored for a leg whose hip is on the right, the hip's for one at the rear.
        mirror = np.array([1.0, 1.0 if at[1] >= 0 else -1.0, 1.0])
        centres = np.array([link.centre for link in links]) * mirror
        centres[0, 0] *= 1.0 if at[0] >= 0 else -1.0
        joints = np.array([at, np.array(tables.leg.thigh_at) * mirror, np.array(tables.leg.calf_at) * mirror])
        legs.append(
            Leg(name, joints, np.array(tables.leg.foot_at) * mirror, np.array([link.mass for link in links]), centres)
        )
    return Body(
        tables.name, tuple(legs), tables.trunk.mass, np.array(tables.trunk.centre), np.array(tables.torque_limit),
        tables.foot_radius,
    )  # fmt: skip
