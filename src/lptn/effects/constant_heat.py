"""Something beside the motor gives off a steady heat."""

from lptn.basics.parameters import LARGEST, Parameter
from lptn.effects.base import NodeEffect, Signature, Symbol, Values
from lptn.effects.excitation import REST_OR_LEVELS


class ConstantHeat(NodeEffect):
    r"""Constant heat: drive electronics, holding brake, sun.

    .. math:: Q = Q_0

    Source: [QuadrupedLPTN, eq. 1] (Q_other).
    """

    key = "constant_heat"
    title = "constant heat"
    common = True
    per_run = True
    in_one_run = (
        "in {run} {size} W more heat goes into {into} all the time: was something beside it on?",
        "in {run} {size} W less heat goes into {into} all the time",
    )
    parameters = (
        Parameter("power", 3.0, "W", (0.0, LARGEST), off=0.0, relative_to="conductance", title="constant heat"),
    )
    signature = Signature(
        looks_like="predicted too cold all the time, at rest as well",
        separate_by="leave the robot powered and resting for an hour; then switch it off for an hour",
        confused_with=("sensor_offset",),
    )
    excitation = REST_OR_LEVELS
    source = "[QuadrupedLPTN, eq. 1]"

    def heat(self, temperature: Symbol, inputs: Values, p: Values) -> Symbol:
        return p.power
