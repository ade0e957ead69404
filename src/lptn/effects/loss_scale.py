"""The heat computed from torque or current is wrong by a factor: another torque constant, another resistance."""

from lptn.basics.parameters import Parameter
from lptn.effects.base import LossEffect, Signature, Symbol, Values
from lptn.effects.excitation import SEVERAL_RUNS_OR_PLACES


class LossScale(LossEffect):
    r"""Copper loss changed by a constant factor.

    .. math:: Q' = (1 + g) \, Q, \qquad 1 + g = \frac{R'_d}{R_d} \left( \frac{k_\tau}{k'_\tau} \right)^2

    A torque constant that is really 10 % lower than the model's gives *g* = 0.23.

    Source: definition; [QuadrupedLPTN, eq. 15] (torque constant and resistance come from data sheets).
    """

    key = "loss_scale"
    title = "wrong torque constant or resistance"
    heat_of = "copper_loss"
    per_run = True
    in_one_run = (
        "in {run} the copper loss{at} is {factor} times what the model computes",
        "in {run} the copper loss{at} is only {factor} times what the model computes",
    )
    parameters = (Parameter("change", 0.2, "1", (-1.0, 20.0), off=0.0, title="change of the copper loss"),)
    signature = Signature(
        looks_like="predicted too cold (or too hot) in proportion to the square of the load, warm or cold",
        separate_by="hold one joint at two torques, 15 min each; measure current and torque together",
        confused_with=("stray_load_loss", "resistance_rise"),
    )
    excitation = SEVERAL_RUNS_OR_PLACES
    source = "definition"

    def factor(self, temperature: Symbol, p: Values) -> Symbol:
        return 1 + p.change
