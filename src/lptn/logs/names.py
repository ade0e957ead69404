"""Column names taken apart: words, indices, and the unit that a name ends in."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass


def _set(words: str) -> frozenset[str]:
    return frozenset(words.split())


_BRACKETED = re.compile(r"[\[(]\s*([^\[\]()]+?)\s*[\])]\s*$")
_WORD = re.compile(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])|\d+|°|µ|%")

UNITS: Mapping[str, Mapping[str, str]] = {
    "time": {
        "s": "s", "sec": "s", "secs": "s", "seconds": "s", "ms": "ms", "msec": "ms", "millis": "ms",
        "milliseconds": "ms", "us": "us", "usec": "us", "micros": "us", "microseconds": "us", "µ s": "us", "ns": "ns",
        "nsec": "ns", "nanos": "ns", "nanoseconds": "ns", "min": "min", "minutes": "min",
    },
    "temperature": {
        "c": "degC", "degc": "degC", "deg c": "degC", "° c": "degC", "celsius": "degC", "f": "degF", "degf": "degF",
        "deg f": "degF", "° f": "degF", "fahrenheit": "degF", "k": "K", "degk": "K", "kelvin": "K",
    },
    "torque": {
        "nm": "N*m", "n m": "N*m", "mnm": "mN*m", "m nm": "mN*m", "m n m": "mN*m", "ncm": "N*cm", "knm": "kN*m",
    },
    "current": {"a": "A", "amp": "A", "amps": "A", "ampere": "A", "ma": "mA", "m a": "mA", "milliamps": "mA"},
    "velocity": {
        "rad s": "rad/s", "rads": "rad/s", "radps": "rad/s", "rpm": "rpm", "1 min": "rpm", "deg s": "deg/s",
        "degps": "deg/s", "dps": "deg/s", "rps": "turn/s", "rev s": "turn/s",
    },
    "speed": {"m s": "m/s", "mps": "m/s", "ms": "m/s", "km h": "km/h", "kmh": "km/h", "kph": "km/h", "mm s": "mm/s"},
    "power": {"w": "W", "watt": "W", "watts": "W", "mw": "mW", "m w": "mW", "kw": "kW", "k w": "kW"},
}  # fmt: skip
"""What names end in, by quantity, in lower case with words apart, and the unit that it means."""

ELECTRICAL = ("erpm", "e rpm")
"""Speeds in electrical turns: the number of pole pairs, which no log says, makes them mechanical."""


@dataclass(frozen=True)
class Parts:
    """A column's name taken apart.

    Args:
        words: in lower case, letters and digits apart, `FR_calfTemp2` being fr, calf, temp, 2.
        bracket: what stands in a bracket at the end, such as a unit or an index; '' if nothing does.
    """

    words: tuple[str, ...]
    bracket: str

    def unit(self, quantity: str) -> str:
        """The unit that the name ends in, or has in a bracket; '' where it has none that `quantity` could have."""
        known = UNITS.get(quantity, {})
        if (inside := " ".join(words_of(self.bracket))) in known:
            return known[inside]
        for count in (3, 2, 1):
            ending = " ".join(self.words[-count:])
            # A letter alone is a unit only behind something that it is the unit of.
            if len(self.words) > count and ending in known:
                return known[ending]
        return ""

    @property
    def electrical(self) -> bool:
        """Whether it is a speed in electrical turns."""
        return " ".join(self.words).endswith(ELECTRICAL) or "erpm" in self.words


def words_of(name: str) -> tuple[str, ...]:
    """The words of a name, in lower case."""
    return tuple(word.lower() for word in _WORD.findall(name))


def parts_of(name: str) -> Parts:
    """A name taken apart; what stands in a bracket and is no unit are words of it."""
    match = _BRACKETED.search(name)
    if match is None:
        return Parts(words_of(name), "")
    before, inside = name[: match.start()], match[1]
    words = words_of(inside)
    is_unit = not inside.isdigit() and any(" ".join(words) in known for known in UNITS.values())
    return Parts((*words_of(before), *(() if is_unit else words)), inside)


QUANTITIES: Mapping[str, frozenset[str]] = {
    "time": _set("time t timestamp stamp ts clock elapsed"),
    "temperature": _set("temperature temperatures temp temps tmp t thermistor ntc pt therm thermocouple"),
    "torque": _set("torque torques tau effort trq tq moment"),
    "current": _set("current currents i cur curr iq amps amp"),
    "velocity": _set("velocity velocities vel omega speed dq qd qdot rpm w"),
    "speed": _set("speed velocity vel v vx"),
    "power": _set("power watt watts p"),
    "powered": _set("powered enabled enable"),
    "fan": _set("fan duty"),
    "irradiance": _set("irradiance sun solar"),
}
"""Words that say which quantity a column holds."""

PLACES: Mapping[str, frozenset[str]] = {
    "ambient": _set("ambient amb room air env environment lab surroundings"),
    "base": _set("base body trunk robot com"),
    "battery": _set("battery batt bat"),
    "pc": _set("pc computer cpu onboard"),
    "winding": _set("winding windings coil copper"),
    "housing": _set("housing case casing body shell"),
    "calf": _set("calf knee shank"),
}
"""Words that say which place, where it is not called by its own name."""

NOT_MEASURED = _set(
    "cmd command commanded des desired target ref reference goal limit max min set setpoint error err status flag "
    "count fault warning id mode"
)
"""Words of columns that hold what was wanted, or something about a quantity, and not the quantity."""
