"""The bodies: cuboid, ring or arc of one, cylinder; their volume, faces and the conductances along each axis.

Along each axis an element is exact as in `lptn.elements.axis`; the axes share the mean temperature. Where the heat
through each face is spread evenly over it, mean temperature and heat flows are exact in all axes at once. Where faces
of two or three axes are held at uniform temperatures side by side, the heat crowds at their common edges and
the mean rise by a source comes out too high: a long square bar 18.6 %, a cube 37.7 %. Films and contacts
outside bring this down, and so do finer pieces.

Derived here: [WrobelMellor2010], named by [BlockLPTN] for the cuboid, was not available.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

from lptn.elements.axis import Axis, ring_axis, rod_axis, slab_axis
from lptn.parameters import Parameter


@dataclass(frozen=True)
class Shape(ABC):
    """A body, or `count` equal ones side by side that count as one.

    Attributes:
        kind: what model files call it.
        units: the SI unit of each dimension.
        directions: names of its axes, as in `conductivity_<direction>`.
    """

    kind: ClassVar[str]
    units: ClassVar[Mapping[str, str]]
    directions: ClassVar[tuple[str, ...]]

    @property
    @abstractmethod
    def volume(self) -> float:
        """Volume [m³] of all `count` bodies."""

    @cached_property
    @abstractmethod
    def axes(self) -> dict[str, Axis]:
        """The conductances along each direction."""

    @property
    def faces(self) -> tuple[str, ...]:
        """Names of all faces."""
        return tuple(face for axis in self.axes.values() for face in axis.faces)

    def wrong(self) -> tuple[str, str, str] | None:
        """The dimension that makes no body, what it is, and what was expected; `None` for a sound body."""
        return None


@dataclass(frozen=True)
class Cuboid(Shape):
    """A box: faces `x0` and `x1`, `y0` and `y1`, `z0` and `z1`.

    Args:
        length_x: size along x [m]; `length_y`, `length_z` likewise.
        count: how many stand side by side.
    """

    length_x: float
    length_y: float
    length_z: float
    count: float = 1.0
    kind = "cuboid"
    units = {"length_x": "m", "length_y": "m", "length_z": "m", "count": "1"}  # noqa: RUF012
    directions = ("x", "y", "z")

    @property
    def volume(self) -> float:
        return self.count * self.length_x * self.length_y * self.length_z

    @cached_property
    def axes(self) -> dict[str, Axis]:
        sizes = {"x": self.length_x, "y": self.length_y, "z": self.length_z}
        return {name: slab_axis((f"{name}0", f"{name}1"), size, self.volume / size) for name, size in sizes.items()}


@dataclass(frozen=True)
class Annulus(Shape):
    """A ring (stator yoke, housing, end winding), or an arc of one: faces `inner`, `outer`, `front`, `back`.

    Args:
        inner_radius: [m].
        outer_radius: [m].
        length: along the axis [m].
        angle: of the arc [rad]; its two cut faces pass no heat.
        count: how many stand side by side.
    """

    inner_radius: float
    outer_radius: float
    length: float
    angle: float = math.tau
    count: float = 1.0
    kind = "annulus"
    units = {  # noqa: RUF012
        "inner_radius": "m",
        "outer_radius": "m",
        "length": "m",
        "angle": "rad",
        "count": "1",
    }
    directions = ("radial", "axial")

    @property
    def volume(self) -> float:
        return self._section * self.length

    @property
    def _section(self) -> float:
        return self.count * self.angle / 2.0 * (self.outer_radius**2 - self.inner_radius**2)

    @cached_property
    def axes(self) -> dict[str, Axis]:
        angle = self.count * self.angle
        return {
            "radial": ring_axis(("inner", "outer"), self.inner_radius, self.outer_radius, angle, self.length),
            "axial": slab_axis(("front", "back"), self.length, self._section),
        }

    def wrong(self) -> tuple[str, str, str] | None:
        if self.inner_radius >= self.outer_radius:
            expected = f"more than inner_radius = {self.inner_radius:g} m"
            return "outer_radius", f"{self.outer_radius:g} m", expected
        if self.angle * self.count > math.tau * (1 + 1e-9):
            return "angle", f"{self.count:g} × {math.degrees(self.angle):g} deg", "a full circle, 360 deg, at most"
        return None


@dataclass(frozen=True)
class Cylinder(Shape):
    """A solid cylinder (shaft): faces `outer`, `front`, `back`.

    Args:
        radius: [m].
        length: along the axis [m].
        count: how many stand side by side.
    """

    radius: float
    length: float
    count: float = 1.0
    kind = "cylinder"
    units = {"radius": "m", "length": "m", "count": "1"}  # noqa: RUF012
    directions = ("radial", "axial")

    @property
    def volume(self) -> float:
        return self.count * math.pi * self.radius**2 * self.length

    @cached_property
    def axes(self) -> dict[str, Axis]:
        return {
            "radial": rod_axis("outer", self.count * math.tau, self.length),
            "axial": slab_axis(("front", "back"), self.length, self.volume / self.length),
        }


KINDS: dict[str, type[Shape]] = {kind.kind: kind for kind in (Cuboid, Annulus, Cylinder)}


@dataclass(frozen=True)
class Element:
    """A body of a material, as a node of a network.

    Args:
        shape: the body.
        conductivity: for each of its directions [W/(m K)]; one parameter may serve for several.
    """

    shape: Shape
    conductivity: Mapping[str, Parameter]
