"""A gear that passes power on loses part of it as heat."""

from lptn.basics.parameters import Parameter
from lptn.effects.base import NodeEffect, Signature, Symbol, Values
from lptn.effects.excitation import speed_apart_from_load


class GearLoss(NodeEffect):
    r"""A share of the mechanical power, driving or braking.

    .. math:: Q = k \, |\tau \, \dot q|

    The mean of the absolute power gives the exact mean heat. Losses that don't depend on the load are friction.

    Source: load-dependent loss of gears ([ISO14179-1]); 2 to 20 % for the gears of robot joints.
    """

    key = "gear_loss"
    title = "gear loss, a share of the mechanical power"
    common = True
    needs = ("mechanical_power",)
    parameters = (Parameter("fraction", 0.1, "1", (0.0, 1.0), off=0.0, title="share of the mechanical power lost"),)
    signature = Signature(
        looks_like="predicted too cold when the joint moves under load, right when it moves unloaded or holds still",
        separate_by="lift and lower the same load at two speeds, 15 min each, and swing unloaded at those speeds",
        confused_with=("coulomb_friction", "viscous_friction", "loss_scale"),
    )
    excitation = speed_apart_from_load()
    source = "load-dependent gear loss ([ISO14179-1])"

    def heat(self, temperature: Symbol, inputs: Values, p: Values) -> Symbol:
        return p.fraction * abs(inputs.mechanical_power)
