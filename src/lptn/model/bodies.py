"""Bodies that generate and conduct heat: shapes, conductances between their mean and their faces, perfect contact."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, reduce
from typing import Any, ClassVar

import casadi as ca

from lptn.basics.errors import InputError
from lptn.basics.parameters import Parameter

# --- Conduction along one axis: conductances between the mean of a body and its two faces ------------
#
# Along one axis the steady temperature is that of pure conduction plus that of a uniform source. With
# :math:`w` the weight of each face in the mean of pure conduction, :math:`\rho` the rise of the mean for each watt
# between faces held at zero, and :math:`G` the conductance from face to face, the same numbers follow from three
# conductances:
#
# .. math:: G_{mean,low} = w_{low} / \rho, \quad G_{mean,high} = w_{high} / \rho, \quad
#           G_{low,high} = G - w_{low} w_{high} / \rho
#
# This is the T-network with a negative resistance in its foot, its massless star point eliminated. The conductance from
# face to face is negative, and yet the whole takes in no work: its power is
# :math:`(\bar T - \sum w T)^2 / \rho + G (T_{low} - T_{high})^2`.
#
# Derived here; [BlockLPTN, eq. 9] gives the slab (R = -L/(6kA)). [GerlingDajaku2005], named there for the ring,
# was not available.


@dataclass(frozen=True)
class Axis:
    """Conductances for each W/(m K) of conductivity [m].

    Args:
        faces: names of the low and the high face; the high one alone where the body reaches to its centre line.
        mean: from the mean temperature to each face.
        profile: of the temperature along it.
        across: from face to face; negative for a slab or a ring.
    """

    faces: tuple[str, ...]
    mean: tuple[float, ...]
    profile: Profile
    across: float = 0.0


def slab_axis(faces: tuple[str, str], length: float, area: float) -> Axis:
    """Along `length` [m] through a constant `area` [m²] ([BlockLPTN, eq. 8, 9])."""
    one = area / length
    return Axis(faces, (6.0 * one, 6.0 * one), SlabProfile(length), -2.0 * one)


def ring_axis(faces: tuple[str, str], inner: float, outer: float, angle: float, length: float) -> Axis:
    """From the inner to the outer radius [m] of a ring, or of an arc of it, of an `angle` [rad] and a `length` [m].

    The weights are (1 ∓ 𝓛)/2 and ρ is 𝓛/(4 angle length), with 𝓛(x) = coth x - 1/x and x = ln(outer/inner).
    """
    x = math.log(outer / inner)
    curved = langevin(x)
    size = angle * length
    mean = 2.0 * size * (1.0 - curved) / curved, 2.0 * size * (1.0 + curved) / curved
    return Axis(faces, mean, RingProfile(inner, outer), size * (1.0 / x - 1.0 / curved + curved))


def langevin(x: float) -> float:
    """Langevin's function coth x - 1/x for x > 0."""
    small = 0.05  # below it coth x - 1/x loses digits; the series is exact to 1e-15 there
    if x < small:
        square = x * x
        return x / 3.0 * (1.0 - square / 15.0 * (1.0 - square * 2.0 / 21.0 * (1.0 - square / 10.0)))
    return 1.0 / math.tanh(x) - 1.0 / x


# --- The profile along one axis, and its hottest place -----------------------------------------------
#
# The mean and the temperatures of the faces say how much a uniform source curves the profile, and so the whole of it:
# in the steady state this is exact. After a step of the heat the profile of a slab takes L²/(16 a) longer to form than
# its mean takes to rise (a: diffusivity). That time is chosen so that the mean delay of the hottest place, the integral
# of what is missing of its rise, is that of Poisson's equation solved twice: 5 q L⁴/(384 k a) = q L⁴/(96 k a) + time
# q L²/(24 k), where one node has q L⁴/(96 k a). For a rod of radius R it is R²/(8 a).

_LEAST_CURVED = 1e-6  # K; what is straighter has its hottest place at a face


class Profile(ABC):
    """The temperature along one axis of a body with uniform heat."""

    @abstractmethod
    def hottest(self, mean: Any, faces: Sequence[Any]) -> Any:
        """Its greatest temperature [degC], for symbols and numbers.

        Args:
            mean: of the body [degC].
            faces: temperatures of the axis' faces [degC].
        """

    @abstractmethod
    def forming(self, open_faces: int) -> float:
        """How much longer than the rise of the mean it takes to form, times the diffusivity [m²].

        Args:
            open_faces: how many of its faces something is attached to.
        """


@dataclass(frozen=True)
class SlabProfile(Profile):
    """A parabola: T = low + (high - low) s + c s (1 - s), with s = x/L and c = 6 (mean - (low + high)/2)."""

    length: float

    def hottest(self, mean: Any, faces: Sequence[Any]) -> Any:
        low, high = faces
        curved = 6.0 * (mean - (low + high) / 2.0)
        # [BlockLPTN, eq. 5], corrected
        place = _within(0.5 + (high - low) / (2.0 * ca.fmax(curved, _LEAST_CURVED)), 0.0, 1.0)
        return ca.fmax(ca.fmax(low, high), low + (high - low) * place + curved * place * (1.0 - place))

    def forming(self, open_faces: int) -> float:
        one_side = 4.0  # a slab with one face closed is half of one that is twice as thick
        return self.length**2 / 16.0 * (1.0 if open_faces == 2 else one_side)


@dataclass(frozen=True)
class RingProfile(Profile):
    r"""T = low + (high - low + c) ln(r/r_i)/x - c (r² - r_i²)/(r_o² - r_i²), with x = ln(r_o/r_i).

    c is 2/𝓛(x) times what the source lifts the mean above that of pure conduction.
    """

    inner: float
    outer: float

    def hottest(self, mean: Any, faces: Sequence[Any]) -> Any:
        low, high = faces
        x = math.log(self.outer / self.inner)
        share, most = langevin(x), math.expm1(2.0 * x)  # most: (r_o² - r_i²)/r_i²
        curved = 2.0 / share * (mean - (low * (1.0 - share) + high * (1.0 + share)) / 2.0)
        rising = high - low + curved
        square = _within(rising * most / (2.0 * x * ca.fmax(curved, _LEAST_CURVED)), 1.0, 1.0 + most)  # (r/r_i)²
        there = low + rising * ca.log(square) / (2.0 * x) - curved * (square - 1.0) / most
        return ca.fmax(ca.fmax(low, high), there)

    def forming(self, open_faces: int) -> float:
        return SlabProfile(self.outer - self.inner).forming(open_faces)  # as of a slab as thick


@dataclass(frozen=True)
class RodProfile(Profile):
    """T = face + c (1 - r²/R²), with c = 2 (mean - face): hottest on the axis, or at the surface."""

    radius: float

    def hottest(self, mean: Any, faces: Sequence[Any]) -> Any:
        (face,) = faces
        return ca.fmax(face, 2.0 * mean - face)

    def forming(self, open_faces: int) -> float:
        return self.radius**2 / 8.0


def _within(value: Any, least: float, most: float) -> Any:
    return ca.fmin(ca.fmax(value, least), most)


# --- The bodies: cuboid, ring or arc of one, cylinder ---------------------------------------------
#
# Along each axis a body is exact as above; the axes share the mean temperature. Where the heat
# through each face is spread evenly over it, mean temperature and heat flows are exact in all axes at once. Where faces
# of two or three axes are held at uniform temperatures side by side, the heat crowds at their common edges and
# the mean rise by a source comes out too high: a long square bar 18.6 %, a cube 37.7 %. Films and contacts
# outside bring this down, and so do finer pieces.
#
# Derived here: [WrobelMellor2010], named by [BlockLPTN] for the cuboid, was not available.


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
    units = {"inner_radius": "m", "outer_radius": "m", "length": "m", "angle": "rad", "count": "1"}  # noqa: RUF012
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
        to_surface = 4.0 * self.count * math.tau * self.length  # R = 1/(4 angle length k)
        return {
            "radial": Axis(("outer",), (to_surface,), RodProfile(self.radius)),
            "axial": slab_axis(("front", "back"), self.length, self.volume / self.length),
        }


KINDS: dict[str, type[Shape]] = {kind.kind: kind for kind in (Cuboid, Annulus, Cylinder)}


@dataclass(frozen=True)
class Element:
    """A body of a material, as a node of a network.

    Args:
        shape: the body.
        conductivity: for each of its directions [W/(m K)]; one parameter may serve for several.
        hottest: whether its hottest point is a place of its own, `"winding.hottest"`, that limits may be set for.
    """

    shape: Shape
    conductivity: Mapping[str, Parameter]
    hottest: bool = False


# --- The bodies of a network: their faces, which of them touch perfectly, and the conduction inside ---


@dataclass(frozen=True)
class Conductor:
    """Conduction inside an element: conductivity, by its index, times a shape factor [m]; it may be negative."""

    ends: tuple[str, str]
    conductivity: int
    shape: float


@dataclass(frozen=True)
class HeatedAxis:
    """An axis of an element along which heat can flow.

    Args:
        profile: of its temperature.
        faces: the places whose temperatures its faces have.
        conductivity: index of the conductivity.
        forming: how much longer than the rise of the mean the profile takes to form, times the diffusivity [m²].
    """

    profile: Profile
    faces: tuple[str, ...]
    conductivity: int
    forming: float


@dataclass(frozen=True)
class HottestPoint:
    """The hottest point of an element.

    Along each axis the profile is that of uniform heat; where the heat through each face is spread evenly over it,
    the profiles of several axes add. Of several, the quickest to form sets how fast the hottest point follows.

    Args:
        element: name of the element.
        volume: of all its bodies [m³].
        axes: those along which heat can flow.
    """

    element: str
    volume: float
    axes: tuple[HeatedAxis, ...]

    @property
    def name(self) -> str:
        """What the place is called."""
        return f"{self.element}.{HOTTEST}"

    def above_mean(self, temperature: Mapping[str, Any]) -> Any:
        """By how much it is warmer than the mean once the profiles are formed [K]; temperatures in degC by place."""
        mean = temperature[self.element]
        return sum(
            (axis.profile.hottest(mean, [temperature[face] for face in axis.faces]) - mean for axis in self.axes),
            start=0.0,
        )

    def forming_rate(self, p: Any, capacity: Any) -> Any:
        """How fast its profiles form [1/s], from the network's parameters and the element's capacity [J/K]."""
        rates = (p[axis.conductivity] * self.volume / (capacity * axis.forming) for axis in self.axes)
        at_once = 1.0  # s; a metal's profile forms in milliseconds and is flat: a state as quick would only cost steps
        return ca.fmin(reduce(ca.fmax, rates), 1.0 / at_once)


HOTTEST = "hottest"
"""How the hottest point of an element is called, behind the element's name and a dot."""


class Bodies:
    """What a network's elements add to it, worked out as links are read.

    A face is a place without capacitance, `"stator.outer"`. In perfect contact it *is* the place that it touches.

    Args:
        origin: the file of the network, for messages.
    """

    def __init__(self, origin: str) -> None:
        self.origin = origin
        self.shapes: dict[str, Shape] = {}
        self.faces: dict[str, str] = {}
        """Every face and the element it belongs to."""
        self.massless: dict[str, str] = {}
        """Faces with a temperature of their own, and their element; known once the conductors are laid."""
        self.conductors: list[Conductor] = []
        self.hottest: list[HottestPoint] = []
        """Hottest points of the elements that have one; known once the conductors are laid."""
        self._same: dict[str, str] = {}
        self._touched: set[str] = set()

    def add(self, name: str, shape: Shape) -> None:
        """A node that is an element."""
        self.shapes[name] = shape
        self.faces.update((f"{name}.{face}", name) for face in shape.faces)

    def faces_of(self, name: str) -> list[str]:
        """Names of an element's faces."""
        return [f"{name}.{face}" for face in self.shapes[name].faces]

    def linkable(self, names: Iterable[str]) -> list[str]:
        """Names that a link may end at: those given, an element's faces in its place."""
        return [end for name in names for end in (self.faces_of(name) if name in self.shapes else [name])]

    def where(self, place: str) -> str:
        """The place whose temperature a place has: itself, unless it is a face in perfect contact."""
        while place in self._same:
            place = self._same[place]
        return place

    def touch(self, *places: str) -> None:
        """Something is attached to these places."""
        self._touched.update(places)

    def touched_places(self) -> set[str]:
        """Elements with something at a face, and all else that something is attached to."""
        return {self.faces.get(place, place) for place in self._touched}

    def join(self, one: str, other: str, where: str) -> None:
        """Perfect contact between a face and another face or node.

        Raises:
            InputError: neither end is a face, or both have a temperature already.
        """
        first, second = self.where(one), self.where(other)
        if first not in self.faces:
            first, second = second, first
        if first not in self.faces:
            problem = f"perfect contact of {one} and {other}"
            raise InputError(self.origin, where, problem, "a face without a fixed temperature at one end at least")
        if first != second:
            self._same[first] = second
        self.touch(one, other)

    def lay_conductors(self, conductivity: Callable[[str, str], int], hottest: Collection[str] = ()) -> None:
        """The conductances of every axis that something is attached to; through the others no heat can pass.

        Args:
            conductivity: the index of an element's conductivity in a direction.
            hottest: names of the elements whose hottest point is a place.
        """
        for name, shape in self.shapes.items():
            heated: list[HeatedAxis] = []
            for direction, axis in shape.axes.items():
                touched = len(self._touched.intersection(f"{name}.{face}" for face in axis.faces))
                if touched:
                    index = conductivity(name, direction)
                    ends = self._lay(name, axis, index)
                    heated.append(HeatedAxis(axis.profile, ends, index, axis.profile.forming(touched)))
            if name in hottest and heated:
                self.hottest.append(HottestPoint(name, shape.volume, tuple(heated)))

    def _lay(self, name: str, axis: Axis, conductivity: int) -> tuple[str, ...]:
        """Lay the conductors of one axis; returns the places whose temperatures its faces have."""
        ends = [self.where(f"{name}.{face}") for face in axis.faces]
        for end, factor in zip(ends, axis.mean, strict=True):
            self.conductors.append(Conductor((name, end), conductivity, factor))
            if end in self.faces:
                self.massless.setdefault(end, name)
        if len(ends) == 2 and ends[0] != ends[1]:
            self.conductors.append(Conductor((ends[0], ends[1]), conductivity, axis.across))
        return tuple(ends)
