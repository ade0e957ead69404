"""An inrunner in finite volumes, from plain numbers: no line of the model's code is used."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from tests.robots.sector import Index, Sector

Span = tuple[int, int]


@dataclass(frozen=True)
class Drawing:
    """The test motor, SI; radii are outer ones, from the axis outwards."""

    slots: int = 12
    length: float = 0.020
    overhang: float = 0.005
    tooth_width: float = 0.005
    radii: tuple[tuple[str, float], ...] = (
        ("shaft", 0.005),
        ("rotor", 0.016),
        ("magnets", 0.0185),
        ("gap", 0.019),
        ("slots", 0.029),
        ("yoke", 0.033),
        ("housing", 0.036),
    )
    conductivity: tuple[tuple[str, float, float], ...] = (
        ("shaft", 45.0, 45.0),
        ("rotor", 45.0, 45.0),
        ("magnets", 8.0, 8.0),
        ("yoke", 28.0, 3.0),
        ("housing", 170.0, 170.0),
    )
    tooth: tuple[float, float] = (28.0, 3.0)
    winding: tuple[float, float] = (0.52667, 175.61)
    liner: float = 0.3e-3
    liner_conductivity: float = 0.15
    outside: float = 12.0
    ends: float = 15.0
    fit: float = 1500.0
    gap_conductivity: float = 0.027
    bearing: float = 4.0
    mount: float = 2.0
    power: float = 12.8


LONG = Drawing(
    slots=18,
    length=0.045,
    overhang=0.008,
    tooth_width=0.004,
    radii=(
        ("shaft", 0.006),
        ("rotor", 0.022),
        ("magnets", 0.025),
        ("gap", 0.0256),
        ("slots", 0.036),
        ("yoke", 0.041),
        ("housing", 0.046),
    ),
    liner=0.2e-3,
    outside=40.0,
    mount=0.8,
    power=30.0,
)
FLAT = Drawing(
    slots=9,
    length=0.010,
    overhang=0.003,
    tooth_width=0.006,
    radii=(
        ("shaft", 0.004),
        ("rotor", 0.012),
        ("magnets", 0.014),
        ("gap", 0.0145),
        ("slots", 0.021),
        ("yoke", 0.024),
        ("housing", 0.0255),
    ),
    ends=30.0,
    mount=6.0,
    power=5.0,
)


def temperatures(d: Drawing, fine: int = 1) -> dict[str, float]:
    """Mean temperatures above the surroundings [K] of winding, end windings and every part."""
    radial, spans = _radial_cells(d, fine)
    middle = (dict(d.radii)["gap"] + dict(d.radii)["slots"]) / 2.0
    tooth, liner, half = d.tooth_width / 2.0 / middle, d.liner / middle, math.pi / d.slots
    nt, nw, nz, ne = 2 * fine, 6 * fine, 5 * fine, 5 * fine
    angles = np.concatenate(
        [np.linspace(0.0, tooth, nt + 1), [tooth + liner], np.linspace(tooth + liner, half, nw + 1)[1:]]
    )
    # Across the end winding's root heat spreads within a tenth of a millimetre: along the wires it is easy.
    overhang = d.overhang * np.linspace(0.0, 1.0, ne + 1) ** 3
    axis = np.concatenate(
        [
            -overhang[::-1],
            np.linspace(0.0, d.length, nz + 1)[1:],
            d.length + overhang[1:],
        ]
    )
    s = Sector(radial, angles, axis)
    stack, slot = slice(ne, ne + nz), slice(*spans["slots"])
    teeth, wires = slice(0, nt), slice(nt + 1, nt + 1 + nw)
    for part, across, run_filter in d.conductivity:
        for direction, k in enumerate((across, across, run_filter)):
            s.k[direction, slice(*spans[part]), :, stack] = k
    for direction, number in enumerate((0, 0, 1)):
        s.k[direction, slot, teeth, stack] = d.tooth[number]
        s.k[direction, slot, wires, stack] = d.winding[number]
    s.k[1, slot, nt, stack] = d.liner_conductivity
    for end in (slice(0, ne), slice(ne + nz, None)):
        for direction, k in enumerate((d.winding[0], d.winding[1], d.winding[0])):  # the wires run around here
            s.k[direction, slot, :, end] = k
    s.cut[2, slot, : nt + 1, [ne - 1, ne + nz - 1]] = True
    copper = s.volume[slot, wires, stack].sum() + s.volume[slot, :, :ne].sum() * 2.0
    density = d.power / (2 * d.slots) / copper
    s.source[slot, wires, stack] = s.source[slot, :, :ne] = s.source[slot, :, ne + nz :] = density
    _joints(s, d, spans, (stack, teeth, wires), (ne, nz))
    solution = s.solve()
    ends = [s.mean(solution, (slot, slice(None), end)) for end in (slice(0, ne), slice(ne + nz, None))]
    answer = {part: s.mean(solution, (slice(*spans[part]), slice(None), stack)) for part, _, _ in d.conductivity}
    answer |= {"tooth": s.mean(solution, (slot, teeth, stack)), "winding": s.mean(solution, (slot, wires, stack))}
    return answer | {"end_winding": sum(ends) / 2.0}


def _radial_cells(d: Drawing, fine: int) -> tuple[np.ndarray, dict[str, Span]]:
    """Edges along the radius, and which cells belong to which part."""
    edges, spans, inner = [1e-7], {}, 1e-7
    for part, outer in d.radii:
        n = 1 if part == "gap" else fine * {"slots": 8}.get(part, 3)
        spans[part] = (len(edges) - 1, len(edges) - 1 + n)
        edges += list(np.linspace(inner, outer, n + 1)[1:])
        inner = outer
    return np.array(edges), spans


def _joints(
    s: Sector, d: Drawing, spans: dict[str, Span], where: tuple[slice, slice, slice], sizes: tuple[int, int]
) -> None:
    """Fit, liner at the slot's bottom, air gap, films, mount and bearings."""
    (stack, teeth, wires), (ne, nz), radii = where, sizes, dict(d.radii)
    pieces = 2 * d.slots
    s.skin[0, spans["yoke"][1] - 1] = 1.0 / d.fit
    # The liner lies beneath the wires only, so it goes into their last cells' conductance.
    last = spans["slots"][1] - 1
    s.cut[0, last, teeth.stop : wires.stop, :] = True
    for j in range(wires.start, wires.stop):
        for m in range(ne, ne + nz):
            cell, above = s.index[last, j, m], s.index[last + 1, j, m]
            area = float(s.area(0, 1)[last, j, m])
            skin = d.liner / d.liner_conductivity / area
            ways = 1.0 / float(s.half(0, 1)[last, j, m]) + skin + 1.0 / float(s.half(0, 0)[last + 1, j, m])
            s._couple(np.array([cell]), np.array([above]), np.array([1.0 / ways]))
    magnet, tip = spans["magnets"][1] - 1, spans["slots"][0]
    gap = math.log(radii["gap"] / radii["magnets"]) / (d.gap_conductivity * math.pi / d.slots)
    for m in range(ne, ne + nz):
        length = float(s.z[m + 1] - s.z[m])
        s.link((s.index[magnet, :, m].ravel(), 0, 1), (s.index[tip, teeth, m].ravel(), 0, 0), gap / length)
    surface = s.index[-1, :, stack].ravel()
    s.link((surface, 0, 1), None, 1.0 / (d.outside * float(s.area(0, 1).ravel()[surface].sum())))
    slot = slice(*spans["slots"])
    for end, face, side in ((slice(0, ne), 0, 0), (slice(ne + nz, None), -1, 1)):
        for cells, axis, direction in (
            (s.index[slot.start, :, end], 0, 0),
            (s.index[slot.stop - 1, :, end], 0, 1),
            (s.index[slot, :, face], 2, side),
        ):
            flat: Index = cells.ravel()
            s.link((flat, axis, direction), None, 1.0 / (d.ends * float(s.area(axis, direction).ravel()[flat].sum())))
    house, shaft = (slice(*spans[part]) for part in ("housing", "shaft"))
    s.link((s.index[house, :, ne].ravel(), 2, 0), None, d.mount * pieces)
    for m, side in ((ne, 0), (ne + nz - 1, 1)):
        s.link((s.index[house, :, m].ravel(), 2, side), (s.index[shaft, :, m].ravel(), 2, side), d.bearing * pieces)
