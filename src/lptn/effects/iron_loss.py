"""The field that turns with the rotor heats the iron it passes through."""

from lptn.basics.parameters import LARGEST, Parameter
from lptn.effects.base import NodeEffect, Signature, Symbol, Values
from lptn.effects.excitation import speed_apart_from_load


class IronLoss(NodeEffect):
    r"""Hysteresis and eddy-current heat, together a power of the speed.

    .. math:: Q = k \, |\omega|^n

    The exponent lies between 1 (hysteresis) and 2 (eddy currents); at the ends it is collinear with
    Coulomb and viscous friction, so a fit keeps away from them.

    Source: Steinmetz's law at constant flux ([Steinmetz1892]); eddy part 0.004 W s²/rad² in `lptn.virtual`.
    """

    key = "iron_loss"
    title = "speed-dependent iron loss"
    common = True
    needs = ("velocity_rms",)
    parameters = (
        Parameter("gain", 0.05, "W*(s/rad)^n", (0.0, LARGEST), off=0.0, title="loss at 1 rad/s"),
        Parameter("exponent", 1.5, "1", (1.1, 1.9), title="exponent of the speed", grid=(1.3, 1.5, 1.7)),
    )
    signature = Signature(
        looks_like="predicted too cold when the joint moves fast, even unloaded",
        separate_by="spin the unloaded motor at three speeds, 15 min each",
        confused_with=("viscous_friction", "coulomb_friction"),
    )
    excitation = speed_apart_from_load()
    source = "Steinmetz's law at constant flux ([Steinmetz1892])"

    def heat(self, temperature: Symbol, inputs: Values, p: Values) -> Symbol:
        standstill = 1e-12  # rad/s; keeps the derivative by the exponent finite at rest
        return p.gain * (abs(inputs.velocity_rms) + standstill) ** p.exponent
