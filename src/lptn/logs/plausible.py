"""What each quantity of a robot can be: range, distance from the air and from other sensors, rate.

The one table that every check of a log reads. A channel is doubted by what it leaves here; what one log says of itself,
as its sensors' noise and steps, is in `channels.py`.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Plausible:
    """What a quantity can be, in SI or degC; of all but temperatures the magnitude.

    Attributes:
        most: of a temperature the middle reading, of all else 99 of 100: no part of a robot has more.
        most_whole: the same where all are whole numbers: nobody measures large ones so coarsely.
        unit: in which such numbers rather are.
        full_scale: of a converter whose counts they may be, in the line that is proposed: no number tells it.
    """

    most: float
    most_whole: float
    unit: str
    full_scale: float = 0.0


PLAUSIBLE = {
    # Insulation of the best class bears 240 degC, magnets less, and none of them for half of a log.
    "temperature": Plausible(200.0, 200.0, "K", 125.0),
    "torque": Plausible(1000.0, 150.0, "mN*m", 50.0),
    "current": Plausible(1000.0, 250.0, "mA", 40.0),
    "velocity": Plausible(2000.0, 300.0, "rpm"),  # 19,000 rpm
    # Of torque and speed, or of a supply: the strongest joints of legged robots reach some 3 kW for a moment.
    "power": Plausible(5000.0, 5000.0, "mW"),
}

# --- Temperatures: range ------------------------------------------------------------------------------

KELVIN = 273.15  # K, of 0 degC: below its negative there is none
COLDEST, HOTTEST = -60.0, 300.0
"""degC, of a sensor on a robot: the middle reading, and any reading, beyond which no part of it is."""
OUTDOORS = (-30.0, 60.0)
"""degC, in which robots still work, and begin at rest: what surrounds all others is no colder, and no warmer."""
USUAL = 22.0  # degC, of a room
CODES = (0.0, -127.0, 85.0, -999.0, 999.0, 127.0, 255.0, 65535.0, 32767.0, -32768.0)
"""degC that failing sensors are known to give: DS18B20 at power-up (85) and disconnected (-127), codes of drives and of
converters of 8 and 16 bit."""

# --- Temperatures: beside the air, beside each other, and in time ---------------------------------------

ALIKE = 3.0
"""K, by which sensors of one temperature differ, or one of them seems to move at once, and by which a part goes by
itself, as where a fan starts. Half of it is the standard deviation of sensors at rest; twice as much is another
temperature."""
FAR = 10.0
"""K, from all that is beside it: no part is so much colder than all that surrounds it, and no sensor so far from where
it was but by a code or a broken wire."""
COLDER, WARMER = 5.0, 70.0  # K: a robot's first reading beside the air's; sensors differ, and robots begin warm
OVER = 25.0  # K, over the room of another run, or over the air: hardly any log begins so warm, and in °F all do
RATE = 1.0  # K/s: a winding at stall warms as fast, for some seconds

# --- Joints -----------------------------------------------------------------------------------------------

MOVING, AT_REST = 0.05, 0.01
"""rad/s: the mean size of the speed of a joint that moves; an encoder's noise, and so little that friction of 10 N·m
makes 0.1 W of it."""
