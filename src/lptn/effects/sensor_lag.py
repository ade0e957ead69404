"""The sensor follows the node's temperature late."""

from typing import ClassVar

from lptn.basics.parameters import LARGEST, Parameter
from lptn.effects.base import Conditions, SensorEffect, Signature, Symbol, Values
from lptn.effects.excitation import LOAD_STEPS


class SensorLag(SensorEffect):
    r"""First-order lag of the sensor: glue, a bead of epoxy, a filter.

    .. math:: y = T_p + f (T_s - T_p), \qquad \dot T_s = (T_p - T_s) / t_s

    The fraction *f* is 0 when off and 1 for a sensor that is wholly behind the lag. What it follows late is the
    temperature where it sits, :math:`T_p`: the node's, or where it is at a hot spot or between two parts, theirs.

    Source: first-order sensor; [Chen2017, sec. 3.1.1] (thermocouples on the housing).
    """

    key = "sensor_lag"
    title = "sensor lag"
    common = True
    has_state = True
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("fraction", 1.0, "1", (0.0, 1.0), off=0.0, on=1.0, title="share behind the lag"),
        Parameter("time_constant", 15.0, "s", (0.5, LARGEST), title="time constant", grid=(5.0, 15.0, 45.0)),
    )
    signature = Signature(
        looks_like="the reading comes late at every change of load, by the same time up and down",
        separate_by="short strong bursts of load, 1 min on and 3 min off",
        confused_with=("second_mass", "sensor_loose"),
    )
    excitation = LOAD_STEPS
    source = "first-order sensor"

    def error(self, temperature: Symbol, state: Symbol, p: Values) -> Symbol:
        return p.fraction * (state - temperature)

    def reading_error(self, here: Conditions) -> Symbol:
        return self.error(here.at_sensor, here.state, here.p)

    def state_rate(self, here: Conditions) -> Symbol:
        return self.rate(here.at_sensor, here.state, here.p)

    def rate(self, temperature: Symbol, state: Symbol, p: Values) -> Symbol:
        return (temperature - state) / p.time_constant
