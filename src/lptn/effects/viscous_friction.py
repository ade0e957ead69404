"""Oil and grease in a moving joint turn motion into heat."""

from lptn.basics.parameters import LARGEST, Parameter
from lptn.effects.base import NodeEffect, Signature, Symbol, Values
from lptn.effects.excitation import speed_apart_from_load


class ViscousFriction(NodeEffect):
    r"""Heat of viscous friction.

    .. math:: Q = D \, \dot q^2

    The mean of the squared speed gives the exact mean heat. Eddy-current loss has the same form.

    Source: [QuadrupedLPTN, eq. 7, 8] (corrected).
    """

    key = "viscous_friction"
    title = "viscous friction of the joint"
    common = True
    needs = ("velocity_rms",)
    parameters = (Parameter("damping", 0.04, "N*m*s/rad", (0.0, LARGEST), off=0.0, title="viscous damping"),)
    signature = Signature(
        looks_like="predicted too cold when the joint moves fast, with the square of its speed",
        separate_by="swing the unloaded leg at two speeds, 15 min each",
        confused_with=("iron_loss", "coulomb_friction"),
    )
    excitation = speed_apart_from_load()
    source = "[QuadrupedLPTN, eq. 7, 8]"

    def heat(self, temperature: Symbol, inputs: Values, p: Values) -> Symbol:
        return p.damping * inputs.velocity_rms**2
