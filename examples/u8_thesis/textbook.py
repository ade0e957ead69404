"""Textbook formulas of motors as [Chen2017, chapter 2] has them, and quantities of round wire and packages."""

from __future__ import annotations

import math

from lptn.planners.trade.motors import MAGNET_COEFFICIENT, REFERENCE

COPPER_COEFFICIENT = 0.0039
"""Temperature coefficient of copper's resistance [1/K], [Chen2017, eq. 2.5] (0.0039 in its tables)."""
COPPER_RESISTIVITY = 1.68e-8
"""Resistivity of copper at 20 degC [ohm m]; the value that gives the wire length of [Chen2017, sec. 3.2.1]."""
U8_RATED_TORQUE = 1.01
"""Maximum continuous torque of the U8 [N·m], [Chen2017, table A.1]."""
U8_RESISTANCE, U10_RESISTANCE = 0.186, 0.095
"""Of the windings at 25 degC [ohm], [Chen2017, table A.1; appendix A.2]."""


def torque_constant(at_reference: float, temperature: float, coefficient: float = MAGNET_COEFFICIENT) -> float:
    """Torque constant [N·m/A] with the magnets at a temperature [degC].

    Args:
        at_reference: at 25 degC [N·m/A].
        temperature: of the magnets [degC].
        coefficient: 1/K, negative.

    Source: [Chen2017, eq. 2.6].
    """
    return float(at_reference * (1 + coefficient * (temperature - REFERENCE)))


def winding_resistance(at_reference: float, temperature: float, coefficient: float = COPPER_COEFFICIENT) -> float:
    """Winding resistance [ohm] at a temperature [degC], from that at 25 degC [ohm].

    Source: [Chen2017, eq. 2.5].
    """
    return float(at_reference * (1 + coefficient * (temperature - REFERENCE)))


def copper_loss(current: float, resistance: float) -> float:
    """Heat [W] of a current [A] in a resistance [ohm].

    Source: [Chen2017, eq. 2.4].
    """
    return current**2 * resistance


def rated_current(torque: float, constant: float) -> float:
    """Current [A] that gives a torque [N·m] at a torque constant [N·m/A].

    Source: [Chen2017, eq. 2.1].
    """
    return torque / constant


def peak_specific_torque(constant: float, saturation_current: float, mass: float) -> float:
    """Peak torque per mass [N·m/kg] from torque constant [N·m/A], saturation current [A] and mass [kg].

    Source: [Chen2017, eq. 2.2]; the saturation current of neither motor is stated there.
    """
    return constant * saturation_current / mass


def thermal_specific_torque(constant: float, mass: float, thermal_resistance: float, resistance: float) -> float:
    """Continuous torque per mass and per root of the temperature rise [N·m/(kg √K)].

    Args:
        constant: torque constant [N·m/A].
        mass: kg.
        thermal_resistance: from the winding to the air [K/W].
        resistance: of the winding [ohm].

    Source: [Chen2017, eq. 2.3].
    """
    return constant / (mass * math.sqrt(thermal_resistance * resistance))


def biot_number(coefficient: float, volume: float, area: float, conductivity: float) -> float:
    """Biot number from a film coefficient [W/(m² K)], volume [m³], area [m²] and conductivity [W/(m K)].

    Source: [Chen2017, eq. 2.8], with volume over area as the length.
    """
    return volume / area * coefficient / conductivity


def convection_resistance(coefficient: float, area: float) -> float:
    """Thermal resistance [K/W] of a film coefficient [W/(m² K)] on an area [m²]; [Chen2017, eq. 2.7]."""
    return 1 / (coefficient * area)


def conduction_resistance(length: float, conductivity: float, area: float) -> float:
    """Thermal resistance [K/W] of a wall: length [m], conductivity [W/(m K)], area [m²]; [Chen2017, eq. 2.9]."""
    return length / (conductivity * area)


def wire_length(resistance: float, diameter: float, resistivity: float = COPPER_RESISTIVITY) -> float:
    """Length [m] of round wire of a resistance [ohm] and a diameter [m]; [Chen2017, sec. 3.2.1]."""
    return resistance * math.pi * diameter**2 / 4 / resistivity


def wire_surface(length: float, diameter: float) -> float:
    """Lateral surface [m²] of round wire of a length and a diameter [m]; [Chen2017, sec. 3.2.1]."""
    return math.pi * diameter * length


def wire_capacity(length: float, diameter: float, density: float = 8960.0, specific_heat: float = 385.0) -> float:
    """Heat capacity [J/K] of round copper wire of a length and a diameter [m]."""
    return density * specific_heat * length * math.pi * diameter**2 / 4


def cylinder_surface(diameter: float, length: float) -> float:
    """Surface [m²] of a cylinder with its two faces, of a diameter and a length [m]."""
    return math.pi * diameter * (length + diameter / 2)


def box_volume(diameter: float, length: float) -> float:
    """Volume [m³] of the box around a cylinder of a diameter and a length [m]."""
    return diameter**2 * length
