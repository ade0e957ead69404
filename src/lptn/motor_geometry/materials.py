"""What motors are made of: handbook values at room temperature, and the mixture that a winding is."""

from __future__ import annotations

from dataclasses import dataclass


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
