"""Two parts that touch, or share a bracket, exchange heat."""

from lptn.basics.parameters import LARGEST, Parameter
from lptn.effects.base import EdgeEffect, Signature, Symbol, Values
from lptn.effects.excitation import nodes_apart


class Conduction(EdgeEffect):
    r"""Conduction between two nodes.

    .. math:: Q_{i} = G \, (T_j - T_i) = -Q_{j}

    Source: [QuadrupedLPTN, eq. 5] (sign corrected).
    """

    key = "conduction"
    title = "conduction between two nodes"
    common = True
    parameters = (
        Parameter(
            "conductance", 0.3, "W/K", (0.0, LARGEST), off=0.0, relative_to="conductance", title="thermal conductance"
        ),
    )
    signature = Signature(
        looks_like="an unpowered node warms beside a powered one, and the powered one is predicted too hot",
        separate_by="power one of the two for 20 min, then only the other",
        confused_with=("constant_heat", "contact_scale"),
    )
    excitation = nodes_apart()
    source = "[QuadrupedLPTN, eq. 5]"

    def conductance(self, p: Values) -> Symbol:
        return p.conductance
