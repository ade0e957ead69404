"""The model file of a motor from its drawing: bodies cut along axis and radius, linked where they touch; losses."""

from __future__ import annotations

import math
from itertools import pairwise

from lptn.basics.errors import InputError
from lptn.model.file import parse_model
from lptn.robots.motor_drawing import Geometry, Material

# --- Its parts as elements, cut along axis and radius, linked where they touch ---------------------
#
# Slots and teeth are cuboids (x along the circumference, y outwards, z along the axis), as many side by side as there
# are slots; all else are rings. Simplifications, said in the file as well: the teeth have parallel sides, slots the
# width at the middle of their layer; end faces of iron, magnets and shaft pass no heat but where a mount or bearing
# is; the gap's air stands still.


_FITS = {("yoke", "housing"), ("shaft", "yoke")}  # joints of two parts; all other neighbours are one piece, or bonded


def model_text(geometry: Geometry) -> str:
    """The text of a model file.

    Raises:
        InputError: the motor makes no model, for instance by pieces that weigh nothing.
    """
    text = _Writer(geometry).text()
    try:
        parse_model(text, geometry.path)
    except InputError as error:
        raise InputError(geometry.path, "pieces", error.found, f"{error.expected} (in the model made of it)") from error
    return text


class _Writer:
    """Collects the tables of a model file."""

    def __init__(self, geometry: Geometry) -> None:
        self.geometry, self.given = geometry, geometry.given
        self.axial, self.length = self.given.pieces.axial, geometry.slice_length
        self.stacked: list[str] = []
        """Parts and layers of the stack, without their slice."""
        self.nodes: list[str] = []
        self.links: list[str] = []

    def text(self) -> str:
        """The whole file."""
        for part in self.geometry.order:
            if part == "slots":
                self._slots()
            elif part != "gap":
                self._rings(part)
        self._end_windings()
        self._along_the_axis()
        for inner, outer in pairwise(self.geometry.order):
            self._between(inner, outer)
        self._outside()
        return "\n".join([*self._head(), *self.nodes, *self.links, *_loss_tables(self.geometry)])

    def _head(self) -> list[str]:
        names = [f"{name}_z{i}" for name in self.stacked for i in range(1, self.axial + 1)]
        listed = ",\n    ".join(f'"{name}"' for name in (*names, "end_winding_front", "end_winding_back"))
        kind = self.given.motor.kind
        name = self.given.motor.name.replace("\\", "").replace('"', "'").replace("\n", " ")  # it stands between quotes
        return [
            f"# {kind} from its drawing {self.geometry.path.name}: {self.axial} slices along the axis (_z1 in front).",
            "# Derived, not measured: treat every film, fit and bearing as a start value. End faces of iron, magnets",
            "# and shaft pass no heat but at mount and bearings; teeth have parallel sides; still air in the gap.",
            "# Log columns: time, temperature.ambient, "
            f"{self.given.winding.input}.motor, and a temperature of any node, such as",
            '# [columns] "temperature.end_winding_front" = "my thermistor".',
            "",
            "[model]",
            f'name = "{name}"',
            f"joints = [\n    {listed},\n]",
            'ambient = "temperature.ambient"',
            "",
        ]

    # --- nodes ---------------------------------------------------------------------------------------

    def _rings(self, part: str) -> None:
        layers, material = self.geometry.layers(part), self.geometry.material(part)
        for (inner, outer), name in zip(layers, self.geometry.names(part), strict=True):
            sizes = [("inner_radius", inner), ("outer_radius", outer)] if inner else [("radius", outer)]
            kind = "annulus" if inner else "cylinder"
            directions = [("radial", material.radial), ("axial", material.axial)]
            self._element(f"{name}_z*", kind, [*sizes, ("length", self.length)], directions, material)
            self.stacked.append(name)

    def _slots(self) -> None:
        motor, winding, iron = self.given.motor, self.geometry.winding, self.geometry.material("teeth")
        for layer, slot, tooth in zip(
            self.geometry.slot_layers, self.geometry.names("winding"), self.geometry.names("tooth"), strict=True
        ):
            for name, width, material in ((slot, layer.slot_width, winding), (tooth, motor.tooth_width, iron)):
                sizes = [("length_x", width), ("length_y", layer.depth), ("length_z", self.length)]
                directions = [("x", material.radial), ("y", material.radial), ("z", material.axial)]
                self._element(f"{name}_z*", "cuboid", sizes, directions, material, motor.slots)
                self.stacked.append(name)

    def _end_windings(self) -> None:
        inner, outer = self.geometry.radii("slots")
        sizes = [("inner_radius", inner), ("outer_radius", outer), ("length", self.given.motor.overhang)]
        across = self.geometry.winding.radial  # the wires run around the axis here
        directions = [("radial", across), ("axial", across)]
        self._element("end_winding_*", "annulus", sizes, directions, self.geometry.winding)

    def _element(
        self,
        pattern: str,
        kind: str,
        sizes: list[tuple[str, float]],
        directions: list[tuple[str, float]],
        material: Material,
        count: int = 1,
    ) -> None:
        self.nodes += [f'[nodes."{pattern}".element]', f'kind = "{kind}"']
        self.nodes += [f'{key} = {{ value = {1e3 * size:.6g}, unit = "mm" }}' for key, size in sizes]
        self.nodes += [f"count = {count}"] if count > 1 else []
        self.nodes += [f'conductivity_{key} = {{ value = {k:.4g}, share = "all" }}' for key, k in directions]
        self.nodes += [f"density = {material.density:.6g}", f"specific_heat = {material.specific_heat:.6g}", ""]

    # --- links ---------------------------------------------------------------------------------------

    def _link(self, one: str, other: str, resistance: float | None, comment: str = "") -> None:
        self.links += ["[[links]]" + (f"  # {comment}" if comment else ""), f'between = ["{one}", "{other}"]']
        if resistance is None:
            self.links += ["perfect = true", ""]
        else:
            self.links += [f'resistance = {{ value = {resistance:.6g}, unit = "K/W", share = "all" }}', ""]

    def _radially(self, one: str, other: str, resistance: float | None, comment: str = "") -> None:
        """A link in every slice; each of the two names ends in its face."""
        (one, face), (other, facing) = one.split("."), other.split(".")
        self._link(f"{one}_{{slice}}.{face}", f"{other}_{{slice}}.{facing}", resistance, comment)

    def _along_the_axis(self) -> None:
        boxes = [*self.geometry.names("winding"), *self.geometry.names("tooth")]
        for i in range(1, self.axial):
            for name in self.stacked:
                low, high = ("z0", "z1") if name in boxes else ("front", "back")
                self._link(f"{name}_z{i}.{high}", f"{name}_z{i + 1}.{low}", None)
        for name in self.geometry.names("winding"):
            self._link(f"{name}_z1.z0", "end_winding_front.back", None)
            self._link(f"{name}_z{self.axial}.z1", "end_winding_back.front", None)
        self._within_the_slots()
        for part in self.geometry.order:
            if part not in ("gap", "slots"):
                for one, other in pairwise(self.geometry.names(part)):
                    self._radially(f"{one}.outer", f"{other}.inner", None)

    def _within_the_slots(self) -> None:
        given = self.given.winding
        for layer, slot, tooth in zip(
            self.geometry.slot_layers, self.geometry.names("winding"), self.geometry.names("tooth"), strict=True
        ):
            side = self.given.motor.slots * layer.depth * self.length
            liner = given.liner / (given.liner_conductivity * side)
            self._radially(f"{slot}.x0", f"{tooth}.x1", liner, "slot liner")
            self._radially(f"{slot}.x1", f"{tooth}.x0", liner, "slot liner")
        for part in ("winding", "tooth"):
            for one, other in pairwise(self.geometry.names(part)):
                self._radially(f"{one}.y1", f"{other}.y0", None)

    def _between(self, inner: str, outer: str) -> None:
        """The joint between a part and the next one outwards."""
        radius, length = self.geometry.radii(outer)[0], self.length
        if "gap" in (inner, outer):
            if inner == "gap":
                self._gap()
        elif "slots" in (inner, outer):
            self._slots_to_yoke(radius, inner == "slots")
        else:
            fit = (inner, outer) in _FITS
            resistance = 1.0 / (self.given.cooling.fit * math.tau * radius * length) if fit else None
            self._radially(
                f"{self.geometry.names(inner)[-1]}.outer",
                f"{self.geometry.names(outer)[0]}.inner",
                resistance,
                "fit" * fit,
            )

    def _slots_to_yoke(self, radius: float, yoke_outside: bool) -> None:
        row, face = (-1, "y1") if yoke_outside else (0, "y0")
        yoke = f"{self.geometry.names('yoke')[0]}.inner" if yoke_outside else f"{self.geometry.names('yoke')[-1]}.outer"
        layer, given = self.geometry.slot_layers[row], self.given.winding
        area = self.given.motor.slots * layer.slot_width * self.length
        self._radially(f"{self.geometry.names('tooth')[row]}.{face}", yoke, None)
        liner = given.liner / (given.liner_conductivity * area)
        self._radially(f"{self.geometry.names('winding')[row]}.{face}", yoke, liner, "slot liner at its bottom")

    def _gap(self) -> None:
        inner, outer = self.geometry.radii("gap")
        air = math.log(outer / inner) / (self.given.cooling.gap_conductivity * math.tau * self.length)
        teeth, magnets = self.geometry.names("tooth"), self.geometry.names("magnets")
        if self.given.motor.kind == "inrunner":
            self._radially(f"{magnets[-1]}.outer", f"{teeth[0]}.y0", air, "air gap")
        else:
            self._radially(f"{teeth[-1]}.y1", f"{magnets[0]}.inner", air, "air gap")

    def _outside(self) -> None:
        cooling, last = self.given.cooling, self.geometry.order[-1]
        area = math.tau * self.geometry.radii(last)[1] * self.length
        self._link(
            f"{self.geometry.names(last)[-1]}_z*.outer", "ambient", 1.0 / (cooling.outside * area), "outer surface"
        )
        inner, outer = self.geometry.radii("slots")
        overhang = self.given.motor.overhang
        surfaces = {"inner": math.tau * inner * overhang, "outer": math.tau * outer * overhang}
        for face, surface in surfaces.items():
            self._link(f"end_winding_*.{face}", "ambient", 1.0 / (cooling.ends * surface), "end winding to air")
        ring = 1.0 / (cooling.ends * math.pi * (outer**2 - inner**2))
        self._link("end_winding_front.front", "ambient", ring, "end winding to air")
        self._link("end_winding_back.back", "ambient", ring, "end winding to air")
        fixed, turning = (last, "shaft") if self.given.motor.kind == "inrunner" else ("shaft", last)
        if cooling.mount is not None:
            self._link(f"{self.geometry.names(fixed)[-1]}_z1.front", "ambient", cooling.mount, "mount")
        for end in ("_z1.front", f"_z{self.axial}.back"):
            one, other = self.geometry.names(fixed)[0], self.geometry.names(turning)[0]
            self._link(f"{one}{end}", f"{other}{end}", cooling.bearing, "bearing")


# --- Its losses: copper by volume of winding, iron by volume of teeth and yoke ----------------------


def _loss_tables(geometry: Geometry) -> list[str]:
    """Lines of the file's effects; one motor's current, or torque, and speed drive all pieces."""
    shares, end = geometry.copper_shares
    lines = []
    for name, share in zip(geometry.names("winding"), shares, strict=True):
        lines += _copper(geometry, f"{name}_z*", share / geometry.given.pieces.axial)
    lines += _copper(geometry, "end_winding_*", end)
    lines += ["[[effects]]", 'kind = "resistance_rise"', 'at = "*winding_*"', 'share = "all"']
    copper_rise = 0.00393  # 1/K; temperature coefficient of copper's resistance (IEC 60028)
    lines += [f"alpha = {{ value = {copper_rise}, fixed = true }}", ""]
    return lines + (_iron(geometry) if geometry.given.losses.iron_gain else [])


def _copper(geometry: Geometry, at: str, share: float) -> list[str]:
    winding = geometry.given.winding
    lines = [
        f"[[effects]]  # {share:.2%} of the copper each",
        'kind = "copper_loss"',
        f'at = "{at}"',
        'driven_by = "motor"',
        f'input = "{winding.input}"',
        f'resistance_of = "{winding.resistance_of}"',
        f'amperes = "{winding.amperes}"',
        'share = "all"',
        f"resistance = {winding.resistance * share:.6g}",
    ]
    return [*lines, *([f"torque_constant = {winding.torque_constant:.6g}"] if winding.input == "torque" else []), ""]


def _iron(geometry: Geometry) -> list[str]:
    """Speed-dependent loss, spread over teeth and yoke by volume."""
    losses, motor = geometry.given.losses, geometry.given.motor
    volumes = {
        name: motor.slots * motor.tooth_width * layer.depth
        for name, layer in zip(geometry.names("tooth"), geometry.slot_layers, strict=True)
    }
    rings = zip(geometry.names("yoke"), geometry.layers("yoke"), strict=True)
    volumes |= {name: math.pi * (outer**2 - inner**2) for name, (inner, outer) in rings}
    lines: list[str] = []
    for name, volume in volumes.items():
        gain = losses.iron_gain * volume / sum(volumes.values()) / geometry.given.pieces.axial
        lines += ["[[effects]]", 'kind = "iron_loss"', f'at = "{name}_z*"', 'driven_by = "motor"', 'share = "all"']
        exponent = f"{{ value = {losses.iron_exponent:.6g}, bounds = [1, 2], fixed = true }}"
        lines += [f"gain = {gain:.6g}", f"exponent = {exponent}", ""]
    return lines
