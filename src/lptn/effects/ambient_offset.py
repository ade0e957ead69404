"""The air around the robot is warmer or cooler than the ambient sensor says."""

from lptn.basics.parameters import LARGEST, Parameter
from lptn.effects.base import BoundaryEffect, Signature, Symbol, Values
from lptn.effects.excitation import REST_OR_LEVELS


class AmbientOffset(BoundaryEffect):
    r"""Constant error of a prescribed temperature.

    .. math:: T_E' = T_E + d

    Source: definition; the ambient sensor hangs elsewhere, in the sun, or above a heater.
    """

    key = "ambient_offset"
    title = "ambient warmer or cooler than given"
    measurement_error = True
    prior_odds = 0.5
    """An ambient sensor near the robot is right within a kelvin more often than not."""
    per_run = True
    in_one_run = (
        "in {run} the {place} was {size} K warmer than given",
        "in {run} the {place} was {size} K cooler than given",
    )
    parameters = (Parameter("offset", 2.0, "K", (-LARGEST, LARGEST), off=0.0, title="true minus given temperature"),)
    signature = Signature(
        looks_like="every node drifts off by the same amount, from a start that fits",
        separate_by="leave the robot unpowered for two hours: what does it settle at?",
        confused_with=("constant_heat", "sensor_offset", "surface_scale"),
    )
    excitation = REST_OR_LEVELS
    source = "definition"

    def error(self, temperature: Symbol, state: Symbol, p: Values) -> Symbol:
        return p.offset
