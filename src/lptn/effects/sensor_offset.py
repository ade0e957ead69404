"""The sensor reads too high or too low by a constant."""

from lptn.basics.parameters import LARGEST, Parameter
from lptn.effects.base import SensorEffect, Signature, Symbol, Values
from lptn.effects.excitation import REST_OR_LEVELS


class SensorOffset(SensorEffect):
    r"""Constant error of the reading.

    .. math:: y = T + b

    Source: definition; [Chen2017, sec. 3.1.1] (thermocouples of ±5 °C).
    """

    key = "sensor_offset"
    title = "sensor offset"
    measurement_error = True
    prior_odds = 0.5
    """Common sensors keep to their class, 0.3 to 1 K, and a robot at rest shows those that do not."""
    per_run = True
    in_one_run = ("in {run} {of} reads {size} K high", "in {run} {of} reads {size} K low")
    parameters = (Parameter("offset", 1.0, "K", (-LARGEST, LARGEST), off=0.0, title="reading minus temperature"),)
    signature = Signature(
        looks_like="predicted off by the same amount all the time, and a rested robot reads off ambient",
        separate_by="a plain cool-down to a known ambient, at two ambient temperatures",
        confused_with=("constant_heat",),
    )
    excitation = REST_OR_LEVELS
    source = "definition"

    def error(self, temperature: Symbol, state: Symbol, p: Values) -> Symbol:
        return p.offset
