"""A robot whose legs turn at the hip about x, at thigh and calf about y: masses, lengths, feet, and how they move."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import Field, ValidationError

from lptn.basics.arrays import FloatArray
from lptn.basics.errors import InputError
from lptn.basics.toml import from_validation, text_of
from lptn.model.file import Number, Strict

PARTS = ("hip", "thigh", "calf")
Vector = Annotated[list[Number], Field(min_length=3, max_length=3)]
_Positive = Annotated[Number, Field(gt=0)]
_AXES = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 1.0, 0.0]])


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


@dataclass(frozen=True)
class LegState:
    """A leg at its joint angles, in the trunk's frame.

    Args:
        foot: where the foot's middle is [m], shape (3,).
        centres: of mass of the links [m], shape (3, 3).
        origins: of the joints [m], shape (3, 3).
        axes: of the joints, shape (3, 3).
    """

    foot: FloatArray
    centres: FloatArray
    origins: FloatArray
    axes: FloatArray

    def jacobian(self, point: FloatArray, joints: int = 3) -> FloatArray:
        """How a point on the link behind the first `joints` joints moves with the angles, shape (3, 3)."""
        columns = np.zeros((3, 3))
        for k in range(joints):
            columns[:, k] = np.cross(self.axes[k], point - self.origins[k])
        return columns


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

    def legs_at(self, angles: FloatArray) -> list[LegState]:
        """The legs at joint angles [rad], shape (3 legs,), in the order of `joints`."""
        return [_at(leg, each) for leg, each in zip(self.legs, np.reshape(angles, (-1, 3)), strict=True)]


def _at(leg: Leg, angles: FloatArray) -> LegState:
    turned, origin = np.eye(3), np.zeros(3)
    origins, axes, centres = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    for k, angle in enumerate(angles.tolist()):
        origin = origin + turned @ leg.joints[k]
        axes[k] = turned @ _AXES[k]
        c, s = np.cos(angle), np.sin(angle)
        about = [[1, 0, 0], [0, c, -s], [0, s, c]] if k == 0 else [[c, 0, s], [0, 1, 0], [-s, 0, c]]
        turned = turned @ np.array(about)
        origins[k], centres[k] = origin, origin + turned @ leg.centres[k]
    return LegState(origin + turned @ leg.foot, centres, origins, axes)


# --- files --------------------------------------------------------------------------------------


class _Link(Strict):
    mass: _Positive
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
    torque_limit: Annotated[list[_Positive], Field(min_length=3, max_length=3)]
    foot_radius: Annotated[Number, Field(ge=0)] = 0.0
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
        ready = files("lptn.planners.load_sharing").joinpath(f"{source}.toml")
        if not ready.is_file():
            raise InputError("body", "name", f'"{source}"', 'a1, or the path of a ".toml" file')
        path, text = Path(f"{source}.toml"), ready.read_text(encoding="utf-8")
    else:
        path = Path(source)
        text = text_of(path, "a file like a1.toml")
    try:
        return _body(_File.model_validate(tomllib.loads(text)))
    except tomllib.TOMLDecodeError as error:
        raise InputError(path, "file", str(error), "TOML") from error
    except ValidationError as error:
        raise from_validation(error, path, text) from error


def _body(tables: _File) -> Body:
    legs = tuple(_leg(name, np.array(at), tables.leg) for name, at in tables.hips.items())
    return Body(
        tables.name, legs, tables.trunk.mass, np.array(tables.trunk.centre), np.array(tables.torque_limit),
        tables.foot_radius,
    )  # fmt: skip


def _leg(name: str, at: FloatArray, table: _LegTable) -> Leg:
    """The left leg's values mirrored for a leg whose hip is on the right, the hip's for one at the rear."""
    mirror = np.array([1.0, 1.0 if at[1] >= 0 else -1.0, 1.0])
    links: Mapping[str, Any] = {part: getattr(table, part) for part in PARTS}
    centres = np.array([links[part].centre for part in PARTS]) * mirror
    centres[0, 0] *= 1.0 if at[0] >= 0 else -1.0
    return Leg(
        name,
        np.array([at, np.array(table.thigh_at) * mirror, np.array(table.calf_at) * mirror]),
        np.array(table.foot_at) * mirror,
        np.array([links[part].mass for part in PARTS]),
        centres,
    )
