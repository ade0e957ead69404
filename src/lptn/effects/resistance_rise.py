"""A hot winding has more resistance and so more copper loss."""

from lptn.basics.parameters import Parameter
from lptn.effects.base import LossEffect, Signature, Symbol, Values
from lptn.effects.excitation import hot


class ResistanceRise(LossEffect):
    r"""Winding resistance rises with temperature.

    .. math:: R_d(T) = R_d \, [1 + \alpha (T - T_\mathrm{ref})]

    Source: [QuadrupedLPTN, eq. 6]; [Chen2017, eq. 2.5] (one documented coefficient, 0.0039 1/K for copper).
    """

    key = "resistance_rise"
    title = "winding resistance rising with temperature"
    common = True
    alike = True
    heat_of = "copper_loss"
    parameters = (
        Parameter("alpha", 0.0039, "1/K", (0.0, 0.02), off=0.0, title="temperature coefficient"),
        Parameter("reference", 25.0, "degC", (-50.0, 200.0), title="reference temperature", fixed=True),
    )
    signature = Signature(
        looks_like="predicted too cold under load when already hot, right under the same load when cool",
        separate_by="the same torque from a cold and from a hot start; log the current besides the torque",
        confused_with=("torque_constant_drop",),
    )
    excitation = hot()
    source = "[QuadrupedLPTN, eq. 6]"

    def factor(self, temperature: Symbol, p: Values) -> Symbol:
        return 1 + p.alpha * (temperature - p.reference)
