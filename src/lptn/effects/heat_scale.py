"""A logged power heats more or less than the model's gain says."""

from lptn.basics.parameters import Parameter
from lptn.effects.base import LossEffect, Signature, Symbol, Values
from lptn.effects.excitation import INPUTS_VARY


class HeatScale(LossEffect):
    r"""Heat of a logged power changed by a constant factor.

    .. math:: Q' = (1 + g) \, Q

    Said of one run it tells of a meter, a supply voltage or a duty cycle that was another one on that day.

    Source: definition; see `heat_input`.
    """

    key = "heat_scale"
    title = "more or less heat of a logged power"
    heat_of = "heat_input"
    per_run = True
    in_one_run = (
        "in {run} the logged power heats{at} {factor} times as much as in the fitted runs",
        "in {run} the logged power heats{at} only {factor} times as much as in the fitted runs",
    )
    parameters = (Parameter("change", 0.2, "1", (-1.0, 20.0), off=0.0, title="change of the heat"),)
    signature = Signature(
        looks_like="predicted too cold (or too hot) in proportion to the logged power",
        separate_by="switch the consumer on and off, 15 min each, with a meter of known accuracy in its supply",
        confused_with=("heat_input", "surface_scale"),
    )
    excitation = INPUTS_VARY
    source = "definition"

    def factor(self, temperature: Symbol, p: Values) -> Symbol:
        return 1 + p.change
