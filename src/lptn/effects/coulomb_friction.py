"""Dry friction in a moving joint turns into heat."""

from lptn.basics.parameters import LARGEST, Parameter
from lptn.effects.base import NodeEffect, Signature, Symbol, Values
from lptn.effects.excitation import speed_apart_from_load


class CoulombFriction(NodeEffect):
    r"""Heat of Coulomb friction.

    .. math:: Q = F_k \, |\dot q|

    The mean of the absolute speed gives the exact mean heat. The sign follows the physics, not the
    printed formula, which gives negative heat for backward motion.

    Source: [QuadrupedLPTN, eq. 7, 8] (corrected).
    """

    key = "coulomb_friction"
    title = "Coulomb friction of the joint"
    common = True
    needs = ("velocity",)
    parameters = (Parameter("torque", 0.25, "N*m", (0.0, LARGEST), off=0.0, title="Coulomb friction torque"),)
    signature = Signature(
        looks_like="predicted too cold whenever the joint moves, in proportion to its speed",
        separate_by="swing the unloaded leg at two speeds, 15 min each",
        confused_with=("viscous_friction", "iron_loss"),
    )
    excitation = speed_apart_from_load()
    source = "[QuadrupedLPTN, eq. 7, 8]"

    def heat(self, temperature: Symbol, inputs: Values, p: Values) -> Symbol:
        return p.torque * abs(inputs.velocity)
