"""The field of the winding's current induces losses in parts that carry no current."""

from lptn.basics.parameters import LARGEST, Parameter
from lptn.effects.base import NodeEffect, Signature, Symbol, Values
from lptn.effects.excitation import INPUTS_VARY


class StrayLoadLoss(NodeEffect):
    r"""Heat in iron, magnets or housing in proportion to the square of the winding's current.

    .. math:: Q = k \, I^2

    Source: stray-load loss of electrical machines ([IEEE112]: proportional to the current squared).
    """

    key = "stray_load_loss"
    title = "stray-load loss of the winding's current"
    needs = ("current",)
    parameters = (Parameter("resistance", 0.002, "ohm", (0.0, LARGEST), off=0.0, title="equivalent resistance"),)
    signature = Signature(
        looks_like="predicted too cold under load in a part that carries no current, at any speed",
        separate_by="the same speed at two currents, 20 min each",
        confused_with=("conduction", "constant_heat"),
    )
    excitation = INPUTS_VARY
    source = "stray-load loss ([IEEE112])"

    def heat(self, temperature: Symbol, inputs: Values, p: Values) -> Symbol:
        return p.resistance * inputs.current**2
