"""A drive that is switched on warms its joint, torque or no torque."""

from lptn.basics.parameters import LARGEST, Parameter
from lptn.effects.base import NodeEffect, Signature, Symbol, Values
from lptn.effects.excitation import INPUTS_VARY


class DriveHeat(NodeEffect):
    r"""Heat of the drive's electronics while it is on.

    .. math:: Q = Q_d \, s, \qquad s = 1 \text{ while powered, else } 0

    Over an interval the logged state is the share of it that the drive was on.

    Source: [QuadrupedLPTN, eq. 1; table 1] (the drives' part of Q_other; the table has unpowered runs).
    """

    key = "drive_heat"
    title = "heat of the drive while it is on"
    needs = ("powered",)
    parameters = (
        Parameter("power", 4.0, "W", (0.0, LARGEST), off=0.0, relative_to="conductance", title="heat of the drive"),
    )
    signature = Signature(
        looks_like="predicted too cold while the drives are on, right once they are off",
        separate_by="leave the robot resting for an hour with the drives on, then for an hour with them off",
        confused_with=("constant_heat",),
    )
    excitation = INPUTS_VARY
    source = "[QuadrupedLPTN, eq. 1]"

    def heat(self, temperature: Symbol, inputs: Values, p: Values) -> Symbol:
        return p.power * inputs.powered
