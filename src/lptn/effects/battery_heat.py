"""Part of the battery's power ends as heat at a joint."""

from lptn.basics.parameters import Parameter
from lptn.effects.base import NodeEffect, Signature, Symbol, Values
from lptn.effects.excitation import INPUTS_VARY


class BatteryHeat(NodeEffect):
    r"""A share of the battery's logged power.

    .. math:: Q = f \, |P_{battery}|

    The battery's own loss goes with its power, charging or discharging, and warms what it sits on.

    Source: definition; the virtual quadruped's battery (`lptn.virtual`) gives off 12 W beside the trunk.
    """

    key = "battery_heat"
    title = "heat of the battery"
    needs = ("battery_power",)
    parameters = (Parameter("fraction", 0.02, "1", (0.0, 1.0), off=0.0, title="share of the battery's power"),)
    signature = Signature(
        looks_like="predicted too cold whenever the whole robot draws much power, at resting joints as well",
        separate_by="load the joints far from the battery for 20 min while those beside it rest",
        confused_with=("constant_heat", "conduction", "computer_heat"),
    )
    excitation = INPUTS_VARY
    source = "definition"

    def heat(self, temperature: Symbol, inputs: Values, p: Values) -> Symbol:
        return p.fraction * abs(inputs.battery_power)
