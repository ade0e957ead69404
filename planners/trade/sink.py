"""A heat sink of one metal from two numbers, its heat capacity and its resistance to the air: mass, volume, fins.

The resistance asks for a surface, the surface for fins; what capacity is left is a slab.
Fins have two sides. Radiation is left out, so passive sinks come out somewhat large.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lptn.basics.arrays import FloatArray
from lptn.basics.toml import Strict
from lptn.effects.base import Symbol

from ..values import Conductivity, Density, NotNegative, SpecificHeat
from .curves import between

AIR_CONDUCTIVITY, AIR_VISCOSITY, AIR_DIFFUSIVITY = 0.0267, 1.67e-5, 2.36e-5
"""Of air at 37 degC (W/(m K), m²/s, m²/s): [IncroperaDeWitt, table A.4]."""
AIR_DENSITY = 1.138
"""Likewise [kg/m³]."""


class SinkMetal(Strict):
    """What a sink is made of: table `[materials.NAME]`."""

    density: Density
    specific_heat: SpecificHeat
    conductivity: Conductivity
    price: NotNegative | None = None  # per kilogram; none where nobody said


ALUMINIUM = SinkMetal(density=2700.0, specific_heat=897.0, conductivity=200.0)
MATERIALS = {
    "aluminium": ALUMINIUM,
    "copper": SinkMetal(density=8960.0, specific_heat=385.0, conductivity=390.0),
    "magnesium": SinkMetal(density=1810.0, specific_heat=1050.0, conductivity=72.0),
    "steel": SinkMetal(density=7850.0, specific_heat=490.0, conductivity=50.0),
}
"""Metals by name: density and specific heat after the CRC Handbook of Chemistry and Physics, conductivity that of
common alloys: extruded aluminium, magnesium AZ91, unalloyed steel."""


class Air(NamedTuple):
    """What the air does at a fin: film coefficient [W/(m² K)] and the spacing [m] at which it holds."""

    film: Symbol
    spacing: Symbol


def still_air(excess: float, height: float) -> Air:
    r"""Natural convection between vertical fins at the spacing that carries most heat in a given volume.

    .. math:: S = 2.714 \, (H \nu a / (g \beta \Delta T))^{1/4}, \qquad h = 1.307 \, k / S

    Args:
        excess: fins above the air [K].
        height: of the fins along the rising air [m].

    Source: [BarCohenRohsenow1984], isothermal plates.
    """
    driving = 9.81 * excess / 310.0 / (AIR_VISCOSITY * AIR_DIFFUSIVITY)  # m/s² of gravity, air of 310 K
    spacing = 2.714 * (height / driving) ** 0.25
    return Air(1.307 * AIR_CONDUCTIVITY / spacing, spacing)


def blown_air(speed: float | FloatArray, height: float) -> Air:
    r"""Laminar flow along fins so far apart that their boundary layers do not meet.

    .. math:: h = 0.664 \, (k/H) \, Re^{1/2} Pr^{1/3}, \qquad S = 2 \cdot 5 H / Re^{1/2}

    Args:
        speed: of the air between the fins [m/s].
        height: of the fins along the flow [m].

    Source: Pohlhausen's solution for a flat plate; [IncroperaDeWitt, chapter 7].
    """
    reynolds = speed * height / AIR_VISCOSITY
    prandtl = AIR_VISCOSITY / AIR_DIFFUSIVITY
    film = 0.664 * AIR_CONDUCTIVITY / height * np.sqrt(reynolds) * prandtl ** (1 / 3)
    return Air(film, 10 * height / np.sqrt(reynolds))


def fin_efficiency(
    film: Symbol, thickness: float, depth: float, conductivity: float = ALUMINIUM.conductivity
) -> Symbol:
    """Share of the film that a straight fin of a thickness and a depth [m] makes use of (tanh m L / m L)."""
    product = np.sqrt(2 * film / (conductivity * thickness)) * depth
    return np.tanh(product) / product


def fan_driven_air(
    resistance: Symbol,
    flow: FloatArray,
    pressure: FloatArray,
    height: float,
    thickness: float,
    depth: float,
    conductivity: float,
) -> Air:
    r"""What a fan's air does at the fins of a resistance to the air: the more fins, the more air they need.

    .. math:: p(\dot V) = \rho v^2 \left(\tfrac{1}{2} + \frac{1.328}{10}\right), \qquad
        \dot V = \frac{S v}{2 H h \eta R}

    The jet behind the fins is lost, and what the plates' laminar friction takes (1.328/√Re of the dynamic pressure by
    each side, at the spacing of `blown_air`); what bends and grilles take is left out.

    Args:
        resistance: of the sink to the air [K/W], a number, an array or a symbol.
        flow: points of the fan's curve [m³/s], ascending, shape (n,).
        pressure: there [Pa], falling.
        height: of the fins along the flow [m].
        thickness: of a fin [m].
        depth: of a fin, root to tip [m].
        conductivity: of the metal [W/(m K)].

    Returns:
        The film times the fins' efficiency, and their spacing.

    Source: [IncroperaDeWitt, chapter 7], Blasius's and Pohlhausen's solutions for a flat plate.
    """
    lost = AIR_DENSITY * (0.5 + 0.1328)
    shut = float(pressure[0])
    # From hardly any, at the most flow, where the film falls like a root: no fins take more air than the fan has.
    speed = np.sqrt(shut / lost) * np.linspace(1e-3, 1 - 1e-6, 200) ** 2
    moved = np.interp(lost * speed**2, pressure[::-1], flow[::-1])
    air = blown_air(speed, height)
    used = air.film * fin_efficiency(air.film, thickness, depth, conductivity)
    needs = air.spacing * speed / (2 * height * used * moved)  # the resistance that takes this flow; it rises with v
    return Air(between(resistance, needs, used), between(resistance, needs, air.spacing))


class SinkNumbers(NamedTuple):
    """What mass, volume and price of a sink follow from, beside capacity and resistance: numbers, or symbols.

    Args:
        film: film coefficient times fin efficiency [W/(m² K)].
        fin_thickness: of a fin [m].
        fin_spacing: between two fins [m].
        density: of the metal [kg/m³].
        specific_heat: of the metal [J/(kg K)].
        price_per_kg: of the metal.
    """

    film: Symbol
    fin_thickness: Symbol
    fin_spacing: Symbol
    density: Symbol = ALUMINIUM.density
    specific_heat: Symbol = ALUMINIUM.specific_heat
    price_per_kg: Symbol = 0.0

    def fin_mass(self, resistance: Symbol) -> Symbol:
        """Mass [kg] of the fins that a resistance to the air [K/W] needs."""
        return self.density * self.fin_thickness / (2 * self.film * resistance)

    def fin_share(self, capacity: Symbol, resistance: Symbol) -> Symbol:
        """Share of the metal that the fins need; a sink can be built up to 1."""
        return self.fin_mass(resistance) * self.specific_heat / capacity

    def spent(self, capacity: Symbol, resistance: Symbol) -> dict[str, Symbol]:
        """Mass [kg], volume [m³] and price of a sink [J/K, K/W].

        Volume is what fins with the air between them, and a slab of the rest of the metal, take up.
        """
        slab = (capacity / self.specific_heat - self.fin_mass(resistance)) / self.density
        fins = (self.fin_thickness + self.fin_spacing) / (2 * self.film * resistance)
        price = self.price_per_kg * capacity / self.specific_heat
        return {"mass": capacity / self.specific_heat, "volume": slab + fins, "price": price}
