"""Air moved by the robot's own motion carries more heat away as it travels faster."""

from lptn.basics.parameters import Parameter
from lptn.effects.base import LinkEffect, Signature, Symbol, Values
from lptn.effects.excitation import INPUTS_VARY


class ForcedConvection(LinkEffect):
    r"""Resistance to the surroundings falls with base speed.

    .. math:: R(v) = R_0 / (1 + \gamma |v|)

    Source: [QuadrupedLPTN, eq. 3].
    """

    key = "forced_convection"
    title = "forced convection with base speed"
    common = True
    needs = ("base_speed",)
    parameters = (Parameter("gamma", 0.5, "s/m", (0.0, 20.0), off=0.0, title="forced-convection gain"),)
    signature = Signature(
        looks_like="predicted too hot while travelling, right while standing",
        separate_by="same joint torque, standing and at two speeds, 15 min each",
        confused_with=("natural_convection",),
    )
    excitation = INPUTS_VARY
    source = "[QuadrupedLPTN, eq. 3]"

    def conductance_factor(self, temperature: Symbol, surroundings: Symbol, inputs: Values, p: Values) -> Symbol:
        return 1 + p.gamma * abs(inputs.base_speed)
