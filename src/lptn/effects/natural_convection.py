"""A hotter surface drives more air past itself."""

import casadi as ca

from lptn.basics.parameters import Parameter
from lptn.effects.base import LinkEffect, Signature, Symbol, Values
from lptn.effects.excitation import hot


class NaturalConvection(LinkEffect):
    r"""Resistance to the surroundings falls with the temperature difference.

    .. math:: R(\Delta T) = R_0 \, e^{-\beta \Delta T}

    Source: [QuadrupedLPTN, eq. 3] (empirical; the heat loss is monotone for a difference above -1/β).
    """

    key = "natural_convection"
    title = "natural convection growing with the temperature difference"
    common = True
    alike = True
    parameters = (Parameter("beta", 0.006, "1/K", (0.0, 0.05), off=0.0, title="natural-convection exponent"),)
    signature = Signature(
        looks_like="predicted too hot at the hottest, too cold at the coolest, in the same run",
        separate_by="heat to 60 degC or more, then cool down unpowered for 30 min, at two ambients",
        confused_with=("radiation",),
    )
    excitation = hot()
    source = "[QuadrupedLPTN, eq. 3]"

    def conductance_factor(self, temperature: Symbol, surroundings: Symbol, inputs: Values, p: Values) -> Symbol:
        return ca.exp(p.beta * (temperature - surroundings))
