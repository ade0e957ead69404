"""A node loses heat faster or slower than its link says: a fan, a cover, a wet or dusty surface."""

from lptn.basics.parameters import Parameter
from lptn.effects.base import LinkEffect, Signature, Symbol, Values
from lptn.effects.excitation import SEVERAL_RUNS_OR_PLACES


class SurfaceScale(LinkEffect):
    r"""Conductance to the surroundings changed by a constant factor.

    .. math:: \frac{1}{R'} = \frac{1 + g}{R}

    Said of one run it tells a condition that the log doesn't hold, such as a fan that was on.

    Source: definition; [Chen2017, table 4.2], where a fan changes the loss to the air.
    """

    key = "surface_scale"
    title = "faster or slower heat loss"
    per_run = True
    in_one_run = (
        "{run} loses heat{at} {factor} times as fast as the other runs: was a fan on?",
        "{run} loses heat{at} only {factor} times as fast as the other runs: was it covered, or out of the wind?",
    )
    parameters = (Parameter("change", 0.3, "1", (-1.0, 20.0), off=0.0, title="change of the conductance"),)
    signature = Signature(
        looks_like="predicted too hot (or too cold) in proportion to how far it lies above the surroundings",
        separate_by="heat up, then cool down unpowered for 30 min; the rate of cooling tells it from heat",
        confused_with=("natural_convection", "ambient_offset"),
    )
    excitation = SEVERAL_RUNS_OR_PLACES
    source = "definition"

    def conductance_factor(self, temperature: Symbol, surroundings: Symbol, inputs: Values, p: Values) -> Symbol:
        return 1 + p.change
