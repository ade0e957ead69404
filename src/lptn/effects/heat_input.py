"""A logged power, or a duty, heats the node."""

from lptn.basics.parameters import LARGEST, Parameter
from lptn.effects.base import NodeEffect, Signature, Symbol, Values
from lptn.effects.excitation import INPUTS_VARY


class HeatInput(NodeEffect):
    r"""Heat in proportion to a logged power.

    .. math:: Q = g \, P

    The gain carries the unit where the log holds a duty instead of watts.

    Source: definition; the onboard computer of [QuadrupedLPTN] and laboratory heaters are driven so.
    """

    key = "heat_input"
    title = "heat in proportion to a logged power"
    needs = ("power",)
    parameters = (Parameter("gain", 1.0, "W/W", (0.0, LARGEST), off=0.0, title="watts per logged unit"),)
    signature = Signature(
        looks_like="predicted too cold whenever the logged power is high",
        separate_by="switch the consumer on and off, 15 min each, with everything else at rest",
        confused_with=("constant_heat",),
    )
    excitation = INPUTS_VARY
    source = "definition"

    def heat(self, temperature: Symbol, inputs: Values, p: Values) -> Symbol:
        return p.gain * inputs.power
