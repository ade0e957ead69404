"""A motor's drawing as its geometry file gives it: materials, what may stand in it, and the sizes that follow."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from importlib.resources import files
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field

from lptn.basics.errors import InputError
from lptn.basics.files import text_of
from lptn.basics.toml import Number, Strict, mistakes_by_line, quantity, toml_of
from lptn.effects.copper_loss import Amperes, ResistanceOf

# --- What motors are made of: handbook values at room temperature, and the mixture that a winding is ---


@dataclass(frozen=True)
class Material:
    """A material, laminated ones with two conductivities.

    Args:
        radial: conductivity across the axis [W/(m K)].
        axial: conductivity along the axis [W/(m K)].
        density: [kg/m³].
        specific_heat: [J/(kg K)].
    """

    radial: float
    axial: float
    density: float
    specific_heat: float


MATERIALS = {
    "steel": Material(45.0, 45.0, 7850.0, 470.0),
    "lamination": Material(28.0, 3.0, 7650.0, 470.0),
    "aluminium": Material(170.0, 170.0, 2700.0, 900.0),
    "magnet": Material(8.0, 8.0, 7500.0, 460.0),
    "titanium": Material(7.0, 7.0, 4430.0, 530.0),
    "plastic": Material(0.3, 0.3, 1300.0, 1500.0),
}
COPPER = Material(390.0, 390.0, 8930.0, 385.0)
RESIN_DENSITY, RESIN_HEAT = 1200.0, 1500.0  # kg/m³, J/(kg K)


def winding(fill: float, impregnation: float) -> Material:
    """Wires in impregnation.

    Across the wires the Hashin-Shtrikman bound of parallel cylinders, along them the mean of the sections.

    Args:
        fill: share of the section that is copper.
        impregnation: conductivity of what lies between the wires [W/(m K)].
    """
    copper, rest = COPPER.radial, impregnation
    upper, lower = (1 + fill) * copper + (1 - fill) * rest, (1 - fill) * copper + (1 + fill) * rest
    density = fill * COPPER.density + (1 - fill) * RESIN_DENSITY
    heat = fill * COPPER.density * COPPER.specific_heat + (1 - fill) * RESIN_DENSITY * RESIN_HEAT
    return Material(rest * upper / lower, fill * copper + (1 - fill) * rest, density, heat / density)


# --- What may stand in a geometry file: its tables and keys, numbers in any unit, checked by pydantic ---


Length = Annotated[Number, Field(gt=0, le=2), quantity("m")]
Conductivity = Annotated[Number, Field(gt=0, le=5000), quantity("W/(m*K)")]
Density = Annotated[Number, Field(gt=0, le=3e4), quantity("kg/m^3")]
SpecificHeat = Annotated[Number, Field(gt=0, le=2e4), quantity("J/(kg*K)")]
Film = Annotated[Number, Field(gt=0, le=1e7), quantity("W/(m^2*K)")]
Resistance = Annotated[Number, Field(gt=0, le=1e4), quantity("K/W")]
Ohm = Annotated[Number, Field(gt=0, le=100), quantity("ohm")]
TorqueConstant = Annotated[Number, Field(gt=0, le=1e3), quantity("N*m/A")]
Ratio = Annotated[Number, quantity("dimensionless")]
Pieces = Annotated[int, Field(ge=1, le=20, strict=True)]


class MotorTable(Strict):
    name: str = "motor"
    kind: Literal["inrunner", "outrunner"]
    length: Length
    slots: Annotated[int, Field(ge=2, le=200, strict=True)]
    tooth_width: Length
    overhang: Length


class WindingTable(Strict):
    resistance: Ohm
    input: Literal["current", "torque"] = "current"
    resistance_of: ResistanceOf = "phase"
    amperes: Amperes = "power_invariant"
    torque_constant: TorqueConstant | None = None
    fill: Annotated[Ratio, Field(gt=0.05, lt=0.95)] = 0.45  # share of copper: round wire wound by machine
    impregnation: Conductivity = 0.2  # W/(m K): varnish or resin
    liner: Length = 0.3e-3  # m: one sheet of insulating paper
    liner_conductivity: Conductivity = 0.15  # W/(m K): aramid paper


class CoolingTable(Strict):
    outside: Film = 12.0  # W/(m² K): free convection and radiation together
    ends: Film = 15.0  # W/(m² K): the same, in air that the rotor stirs
    fit: Film = 1500.0  # W/(m² K): as much as 0.02 mm of air
    gap_conductivity: Conductivity = 0.027  # W/(m K): still air at some 40 degC
    bearing: Resistance = 4.0  # K/W: the order of a small ball bearing
    mount: Resistance | None = None


class MaterialTable(Strict):
    conductivity: Conductivity | None = None
    conductivity_radial: Conductivity | None = None
    conductivity_axial: Conductivity | None = None
    density: Density
    specific_heat: SpecificHeat


class PiecesTable(Strict):
    axial: Pieces = 1
    winding: Pieces = 1
    yoke: Pieces = 1
    rotor: Pieces = 1
    housing: Pieces = 1


class LossTable(Strict):
    iron_gain: Annotated[Ratio, Field(ge=0)] = 0.0
    iron_exponent: Annotated[Ratio, Field(ge=1, le=2)] = 1.5


class GeometryFile(Strict):
    motor: MotorTable
    outer_radius: dict[str, Length]
    winding: WindingTable
    cooling: CoolingTable = CoolingTable()
    materials: dict[str, str | MaterialTable] = Field(default_factory=dict)
    pieces: PiecesTable = PiecesTable()
    losses: LossTable = LossTable()


# --- The drawing, checked, with the sizes that follow from it ---------------------------------------

ORDER = {
    "inrunner": ("shaft", "rotor", "magnets", "gap", "slots", "yoke", "housing"),
    "outrunner": ("shaft", "yoke", "slots", "gap", "magnets", "rotor"),
}
"""What follows what from the axis outwards."""
_USUAL = {
    "shaft": "steel",
    "rotor": "steel",
    "magnets": "magnet",
    "yoke": "lamination",
    "teeth": "lamination",
    "housing": "aluminium",
}


@dataclass(frozen=True)
class Layer:
    """One layer of slots and teeth, from radius to radius [m]; widths are at its middle."""

    inner: float
    outer: float
    slot_width: float

    @property
    def depth(self) -> float:
        """Radial size [m]."""
        return self.outer - self.inner


@dataclass(frozen=True)
class Geometry:
    """A geometry file and what follows from it.

    Args:
        path: the file, for messages.
        given: its tables, in SI.
    """

    path: Path
    given: GeometryFile

    @property
    def order(self) -> tuple[str, ...]:
        """Parts from the axis outwards."""
        return ORDER[self.given.motor.kind]

    @property
    def slice_length(self) -> float:
        """Axial length of one piece [m]."""
        return self.given.motor.length / self.given.pieces.axial

    def radii(self, part: str) -> tuple[float, float]:
        """Inner and outer radius [m]."""
        place = self.order.index(part)
        inner = self.given.outer_radius[self.order[place - 1]] if place else 0.0
        return inner, self.given.outer_radius[part]

    def layers(self, part: str) -> list[tuple[float, float]]:
        """Inner and outer radius [m] of each of a part's layers."""
        inner, outer = self.radii(part)
        n = getattr(self.given.pieces, {"slots": "winding"}.get(part, part), 1)
        return [(inner + (outer - inner) * i / n, inner + (outer - inner) * (i + 1) / n) for i in range(n)]

    def names(self, part: str) -> list[str]:
        """Names of a part's layers, from the inside; winding and teeth share those of the slots."""
        n = len(self.layers("slots" if part in ("winding", "tooth") else part))
        return [part] if n == 1 else [f"{part}_r{i}" for i in range(1, n + 1)]

    @cached_property
    def slot_layers(self) -> list[Layer]:
        """Slots and teeth, from the inside; the liner is no part of the slot."""
        motor = self.given.motor
        layers = []
        for inner, outer in self.layers("slots"):
            pitch = math.pi * (inner + outer) / motor.slots
            layers.append(Layer(inner, outer, pitch - motor.tooth_width - 2.0 * self.given.winding.liner))
        return layers

    @property
    def copper_shares(self) -> tuple[list[float], float]:
        """Share of the copper, and so of the loss, in each layer of the slots (all slices), and in one end winding."""
        motor = self.given.motor
        slots = [motor.slots * layer.slot_width * layer.depth * motor.length for layer in self.slot_layers]
        inner, outer = self.radii("slots")
        end = math.pi * (outer**2 - inner**2) * motor.overhang
        whole = sum(slots) + 2.0 * end
        return [volume / whole for volume in slots], end / whole

    @property
    def winding(self) -> Material:
        """The winding as one material."""
        return winding(self.given.winding.fill, self.given.winding.impregnation)

    def material(self, part: str) -> Material:
        """What a part is made of."""
        chosen = self.given.materials.get(part, _USUAL[part])
        if isinstance(chosen, str):
            return MATERIALS[chosen]
        both = chosen.conductivity or 0.0
        radial, axial = chosen.conductivity_radial or both, chosen.conductivity_axial or both
        return Material(radial, axial, chosen.density, chosen.specific_heat)

    def check(self) -> None:
        """Refuse a drawing of no motor.

        Raises:
            InputError: parts that overlap, slots without room, an unknown material.
        """
        radii, before = self.given.outer_radius, 0.0
        words = ", ".join(self.order)
        for part in radii:
            if part not in self.order:
                raise self._mistake(f"outer_radius.{part}", f'"{part}"', f"one of {words}")
        for part in self.order:
            if part not in radii:
                raise self._mistake("outer_radius", f"no {part}", f"the outer radius of each of {words}")
            if radii[part] <= before:
                raise self._mistake(f"outer_radius.{part}", f"{radii[part]:g} m", f"more than {before:g} m")
            before = radii[part]
        self._check_slots()
        self._check_materials()

    def _check_slots(self) -> None:
        narrow = min(layer.slot_width for layer in self.slot_layers)
        if narrow <= 0.0:
            room = self.given.motor.tooth_width + narrow
            raise self._mistake(
                "motor.tooth_width",
                f"{1e3 * self.given.motor.tooth_width:.3g} mm",
                f"less than {1e3 * max(room, 0.0):.3g} mm, so that slots with their liners have room",
            )
        if self.given.winding.input == "torque" and self.given.winding.torque_constant is None:
            raise self._mistake("winding", "input torque without torque_constant", "a key torque_constant in N*m/A")

    def _check_materials(self) -> None:
        for part, chosen in self.given.materials.items():
            place = f"materials.{part}"
            parts = [name for name in _USUAL if name == "teeth" or name in self.order]
            if part not in parts:
                raise self._mistake(place, f'"{part}"', f"one of {', '.join(parts)}")
            if isinstance(chosen, str) and chosen not in MATERIALS:
                raise self._mistake(place, f'"{chosen}"', f"one of {', '.join(MATERIALS)}, or a table of its values")
            if isinstance(chosen, MaterialTable):
                pair = (chosen.conductivity_radial, chosen.conductivity_axial)
                if (chosen.conductivity is None) == (None in pair):
                    raise self._mistake(place, "its conductivity", "conductivity, or conductivity_radial and _axial")

    def _mistake(self, place: str, problem: str, expected: str) -> InputError:
        return InputError(self.path, place, problem, expected)


def sample(kind: str = "inrunner") -> str:
    """The text of a geometry file to begin with, of an `"inrunner"` or an `"outrunner"`."""
    return (files(__package__) / "drawings" / f"{kind}.toml").read_text(encoding="utf-8")


def load_geometry(path: Path) -> Geometry:
    """Read a geometry file.

    Raises:
        InputError: it can't be read, or describes no motor; with the line of the mistake.
    """
    return parse_geometry(text_of(path, "a geometry file (`lptn motor` writes one)"), path)


def parse_geometry(text: str, path: Path) -> Geometry:
    """Read a geometry from the text of its file; `path` serves for messages.

    Raises:
        InputError: with the line of the mistake.
    """
    with mistakes_by_line(path, text):
        geometry = Geometry(path, GeometryFile.model_validate(toml_of(path, text)))
        geometry.check()
    return geometry
