"""A fan that switches itself on when its motor is warm, and that no log records."""

import casadi as ca

from lptn.basics.parameters import Parameter
from lptn.effects import LinkEffect, Signature
from lptn.effects.base import Symbol, Values
from lptn.effects.excitation import hot

WIDTH = 5.0  # K; the fan speeds up over some kelvin, and a fit wants a slope


class ThermostatFan(LinkEffect):
    r"""Conductance to the surroundings rising where the node is warmer than a thermostat's setting.

    .. math:: \frac{1}{R'} = \frac{1}{R} \left( 1 + \frac{g}{1 + e^{-(T - T_s) / 5\,\mathrm{K}}} \right)

    The gain *g* is the amplitude, the setting :math:`T_s` the shape.

    Source: definition; fans of drives and power supplies.
    """

    key = "thermostat_fan"
    title = "a fan that a thermostat switches on"
    parameters = (
        Parameter("gain", 1.0, "1", (0.0, 20.0), off=0.0, title="rise of the conductance"),
        Parameter("setting", 45.0, "degC", (20.0, 100.0), title="thermostat's setting", grid=(35.0, 45.0, 55.0)),
    )
    signature = Signature(
        looks_like="predicted too hot above one temperature, right below it",
        separate_by="heat slowly to the limit and cool down again: does the slope break at one temperature?",
        confused_with=("natural_convection", "radiation"),
    )
    excitation = hot(rise=20.0)  # K above the surroundings, so that the fan comes on
    source = "definition"

    def conductance_factor(self, temperature: Symbol, surroundings: Symbol, inputs: Values, p: Values) -> Symbol:
        """Factor on the conductance, 1 when off; temperatures in degC."""
        return 1 + p.gain / (1 + ca.exp((p.setting - temperature) / WIDTH))
