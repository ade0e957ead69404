"""Part of the heat goes in and out of a mass that has no sensor."""

from lptn.basics.parameters import LARGEST, Parameter
from lptn.effects.base import MassEffect, Signature, Symbol, Values
from lptn.effects.excitation import LOAD_STEPS


class SecondMass(MassEffect):
    r"""A second thermal mass behind a resistance: housing behind winding, gearbox behind motor.

    .. math:: Q = \frac{C_2}{t_2} (T_2 - T), \qquad \dot T_2 = (T - T_2) / t_2

    With the time constant :math:`t_2 = R_2 C_2` as the shape, the capacitance enters as an amplitude.

    Source: two-node network of winding and housing, fitted to the facts of [Chen2017, sec. 3.1.2].
    """

    key = "second_mass"
    title = "a second thermal mass"
    common = True
    parameters = (
        Parameter(
            "capacity",
            50.0,
            "J/K",
            (0.0, LARGEST),
            off=0.0,
            relative_to="capacity",
            title="capacitance of the second mass",
        ),
        Parameter(
            "time_constant", 120.0, "s", (1.0, LARGEST), title="its time constant", grid=(15.0, 60.0, 240.0, 900.0)
        ),
    )
    signature = Signature(
        looks_like="fast at first, slow later: predicted too slow at the onset of heating, too fast after it",
        separate_by="a step of load for 20 min from rest, then 40 min of rest",
        confused_with=("sensor_lag",),
    )
    excitation = LOAD_STEPS
    source = "two-node network, fitted to [Chen2017, sec. 3.1.2]"

    def heat(self, temperature: Symbol, state: Symbol, p: Values) -> Symbol:
        return p.capacity / p.time_constant * (state - temperature)

    def rate(self, temperature: Symbol, state: Symbol, p: Values) -> Symbol:
        return (temperature - state) / p.time_constant
