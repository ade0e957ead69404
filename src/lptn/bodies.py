"""The elements of a network: their faces, which of them touch perfectly, and the conduction inside."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

from lptn.elements import Axis, Shape
from lptn.errors import InputError


@dataclass(frozen=True)
class Conductor:
    """Conduction inside an element: conductivity, by its index, times a shape factor [m]; it may be negative."""

    ends: tuple[str, str]
    conductivity: int
    shape: float


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
            found = f"perfect contact of {one} and {other}"
            raise InputError(self.origin, where, found, "a face without a fixed temperature at one end at least")
        if first != second:
            self._same[first] = second
        self.touch(one, other)

    def lay_conductors(self, conductivity: Callable[[str, str], int]) -> None:
        """The conductances of every axis that something is attached to; through the others no heat can pass.

        Args:
            conductivity: the index of an element's conductivity in a direction.
        """
        for name, shape in self.shapes.items():
            for direction, axis in shape.axes.items():
                if self._touched.intersection(f"{name}.{face}" for face in axis.faces):
                    self._lay(name, axis, conductivity(name, direction))

    def _lay(self, name: str, axis: Axis, conductivity: int) -> None:
        ends = [self.where(f"{name}.{face}") for face in axis.faces]
        for end, factor in zip(ends, axis.mean, strict=True):
            self.conductors.append(Conductor((name, end), conductivity, factor))
            if end in self.faces:
                self.massless.setdefault(end, name)
        if len(ends) == 2 and ends[0] != ends[1]:
            self.conductors.append(Conductor((ends[0], ends[1]), conductivity, axis.across))
