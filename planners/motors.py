"""Motors of the cooling study as their data sheets give them, and the textbook quantities made from such data."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

COPPER_COEFFICIENT = 0.0039
"""Temperature coefficient of copper's resistance [1/K], source S1, row E2.5 (0.0039 in its tables)."""
MAGNET_COEFFICIENT = -0.0012
"""Temperature coefficient of the flux density of NdFeB magnets [1/K], source S1, row E2.6."""
REFERENCE = 25.0
"""Temperature at which data sheets are taken to hold [degC]; neither sheet states it."""
COPPER_RESISTIVITY = 1.68e-8
"""Resistivity of copper at 20 degC [ohm m]; the value that gives source S1's wire length (row N9)."""


class Datum(NamedTuple):
    """A number, its unit and where it stands."""

    value: float
    unit: str
    source: str


@dataclass(frozen=True)
class Motor:
    """What a study needs to know of a motor beside its thermal network.

    Args:
        name: what people call it.
        mass: kg.
        diameter: m.
        length: m.
        torque_constant: N·m/A with the magnets at 25 degC.
        resistance: of the winding at 25 degC [ohm].
        most_current: the largest current that a study may ask for [A].
        winding_limit: degC.
        magnet_limit: degC.
        model: name of the ready model file that holds its thermal network.
    """

    name: str
    mass: Datum
    diameter: Datum
    length: Datum
    torque_constant: Datum
    resistance: Datum
    most_current: Datum
    winding_limit: Datum
    magnet_limit: Datum
    model: str

    @property
    def volume(self) -> float:
        """Volume of the cylinder that the motor fills [m³]."""
        return cylinder_volume(self.diameter.value, self.length.value)


_ENAMEL = Datum(105.0, "degC", "source S1, figure 4-9: thermal failure of the winding's enamel")
_MAGNET = Datum(150.0, "degC", "source S1, row E2.6: the average NdFeB magnet")

U8 = Motor(
    "U8",
    Datum(0.240, "kg", "source S1, table A.1"),
    Datum(0.0871, "m", "T-Motor's drawing of the U8; not in source S1 (row N10)"),
    Datum(0.02665, "m", "T-Motor's drawing of the U8; not in source S1 (row N10)"),
    Datum(60 / (2 * math.pi * 100), "N*m/A", "100 rpm/V, source S1, row E2.1; its text rounds to 0.1"),
    Datum(0.186, "ohm", "source S1, table A.1"),
    Datum(35.0, "A", "source S1, table A.1: stall current"),
    _ENAMEL,
    _MAGNET,
    "u8",
)
U10 = Motor(
    "U10",
    Datum(0.400, "kg", "source S1, appendix A.2"),
    Datum(0.0868, "m", "source S1, appendix A.2"),
    Datum(0.0355, "m", "source S1, appendix A.2"),
    Datum(60 / (2 * math.pi * 100), "N*m/A", "100 rpm/V, source S1, appendix A.2"),
    Datum(0.095, "ohm", "source S1, appendix A.2"),
    Datum(35.0, "A", "source S1, appendix A.2: maximum continuous current for 180 s"),
    _ENAMEL,
    _MAGNET,
    "u10",
)
MOTORS = {motor.name: motor for motor in (U8, U10)}
"""The motors whose data are known here, by name."""
U8_RATED_TORQUE = Datum(1.01, "N*m", "source S1, table A.1: maximum continuous torque")
U8_STALL_TORQUE = Datum(3.2, "N*m", "source S1, table A.1")


def torque_constant(at_reference: float, temperature: float, coefficient: float = MAGNET_COEFFICIENT) -> float:
    """Torque constant [N·m/A] with the magnets at a temperature [degC].

    Args:
        at_reference: at 25 degC [N·m/A].
        temperature: of the magnets [degC].
        coefficient: 1/K, negative.

    Source: source S1, row E2.6.
    """
    return at_reference * (1 + coefficient * (temperature - REFERENCE))


def winding_resistance(at_reference: float, temperature: float, coefficient: float = COPPER_COEFFICIENT) -> float:
    """Winding resistance [ohm] at a temperature [degC], from that at 25 degC [ohm].

    Source: source S1, row E2.5.
    """
    return at_reference * (1 + coefficient * (temperature - REFERENCE))


def copper_loss(current: float, resistance: float) -> float:
    """Heat [W] of a current [A] in a resistance [ohm].

    Source: source S1, row E2.4.
    """
    return current**2 * resistance


def rated_current(torque: float, constant: float) -> float:
    """Current [A] that gives a torque [N·m] at a torque constant [N·m/A].

    Source: source S1, row E2.1.
    """
    return torque / constant


def peak_specific_torque(constant: float, saturation_current: float, mass: float) -> float:
    """Peak torque per mass [N·m/kg] from torque constant [N·m/A], saturation current [A] and mass [kg].

    Source: source S1, row E2.2; the saturation current of neither motor is stated there.
    """
    return constant * saturation_current / mass


def thermal_specific_torque(constant: float, mass: float, thermal_resistance: float, resistance: float) -> float:
    """Continuous torque per mass and per root of the temperature rise [N·m/(kg √K)].

    Args:
        constant: torque constant [N·m/A].
        mass: kg.
        thermal_resistance: from the winding to the air [K/W].
        resistance: of the winding [ohm].

    Source: source S1, row E2.3.
    """
    return constant / (mass * math.sqrt(thermal_resistance * resistance))


def biot_number(coefficient: float, volume: float, area: float, conductivity: float) -> float:
    """Biot number from a film coefficient [W/(m² K)], volume [m³], area [m²] and conductivity [W/(m K)].

    Source: source S1, row E2.8, with volume over area as the length.
    """
    return volume / area * coefficient / conductivity


def convection_resistance(coefficient: float, area: float) -> float:
    """Thermal resistance [K/W] of a film coefficient [W/(m² K)] on an area [m²]; source S1, row E2.7."""
    return 1 / (coefficient * area)


def conduction_resistance(length: float, conductivity: float, area: float) -> float:
    """Thermal resistance [K/W] of a wall: length [m], conductivity [W/(m K)], area [m²]; source S1, row E2.9."""
    return length / (conductivity * area)


def wire_length(resistance: float, diameter: float, resistivity: float = COPPER_RESISTIVITY) -> float:
    """Length [m] of round wire of a resistance [ohm] and a diameter [m]; source S1, row N9."""
    return resistance * math.pi * diameter**2 / 4 / resistivity


def wire_surface(length: float, diameter: float) -> float:
    """Lateral surface [m²] of round wire of a length and a diameter [m]; source S1, row N9."""
    return math.pi * diameter * length


def wire_capacity(length: float, diameter: float, density: float = 8960.0, specific_heat: float = 385.0) -> float:
    """Heat capacity [J/K] of round copper wire of a length and a diameter [m]."""
    return density * specific_heat * length * math.pi * diameter**2 / 4


def cylinder_volume(diameter: float, length: float) -> float:
    """Volume [m³] of a cylinder of a diameter and a length [m]."""
    return math.pi * diameter**2 / 4 * length


def box_volume(diameter: float, length: float) -> float:
    """Volume [m³] of the box around a cylinder of a diameter and a length [m]."""
    return diameter**2 * length
