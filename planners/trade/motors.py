"""Motors that a trade study knows by name, as their data sheets give them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

MAGNET_COEFFICIENT = -0.0012
"""Temperature coefficient of the flux density of NdFeB magnets [1/K], [Chen2017, eq. 2.6]."""
ENAMEL_LIMIT = 105.0
"""Winding temperature at which the enamel fails [degC], [Chen2017, fig. 4-9]; curves without a limit go to it."""
REFERENCE = 25.0
"""Temperature at which data sheets are taken to hold [degC]; neither sheet states it."""


class Datum(NamedTuple):
    """A number, its unit and its source."""

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
        return math.pi * self.diameter.value**2 / 4 * self.length.value


_ENAMEL = Datum(ENAMEL_LIMIT, "degC", "[Chen2017, fig. 4-9]: thermal failure of the winding's enamel")
_MAGNET = Datum(150.0, "degC", "[Chen2017, eq. 2.6]: the average NdFeB magnet")

U8 = Motor(
    "U8",
    Datum(0.240, "kg", "[Chen2017, table A.1]"),
    Datum(0.0871, "m", "T-Motor's drawing of the U8; not in the thesis [Chen2017, chapter 5]"),
    Datum(0.02665, "m", "T-Motor's drawing of the U8; not in the thesis [Chen2017, chapter 5]"),
    Datum(60 / (2 * math.pi * 100), "N*m/A", "100 rpm/V, [Chen2017, eq. 2.1]; its text rounds to 0.1"),
    Datum(0.186, "ohm", "[Chen2017, table A.1]"),
    Datum(35.0, "A", "[Chen2017, table A.1]: stall current"),
    _ENAMEL,
    _MAGNET,
    "u8",
)
U10 = Motor(
    "U10",
    Datum(0.400, "kg", "[Chen2017, appendix A.2]"),
    Datum(0.0868, "m", "[Chen2017, appendix A.2]"),
    Datum(0.0355, "m", "[Chen2017, appendix A.2]"),
    Datum(60 / (2 * math.pi * 100), "N*m/A", "100 rpm/V, [Chen2017, appendix A.2]"),
    Datum(0.095, "ohm", "[Chen2017, appendix A.2]"),
    Datum(35.0, "A", "[Chen2017, appendix A.2]: maximum continuous current for 180 s"),
    _ENAMEL,
    _MAGNET,
    "u10",
)
MOTORS = {motor.name: motor for motor in (U8, U10)}
"""The motors whose data are known here, by name."""
