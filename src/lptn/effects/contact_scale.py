"""A contact conducts better or worse than its like: paste, a pad, a screw, a strap."""

from lptn.basics.parameters import Parameter
from lptn.effects.base import ContactEffect, Signature, Symbol, Values
from lptn.effects.excitation import nodes_apart


class ContactScale(ContactEffect):
    r"""Conductance between two linked nodes changed by a constant factor.

    .. math:: \frac{1}{R'} = \frac{1 + g}{R}

    Of a link whose resistance is its own and fitted it changes nothing but that resistance.
    Two plates of aluminium conduct a fifth as well in air as with silicone oil between them.

    Source: definition; [IncroperaDeWitt, table 3.1].
    """

    key = "contact_scale"
    title = "better or worse contact"
    parameters = (Parameter("change", 0.5, "1", (-1.0, 50.0), off=0.0, title="change of the conductance"),)
    signature = Signature(
        looks_like="of two linked parts the heated one is predicted too cold and the other too hot, or the reverse",
        separate_by="hold a load until both stand, and look at the difference of the two; then cool down unpowered",
        confused_with=("hot_spot", "sensor_position", "conduction"),
    )
    excitation = nodes_apart()
    source = "definition"

    def conductance_factor(self, p: Values) -> Symbol:
        return 1 + p.change
