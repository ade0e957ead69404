"""Warm magnets give less torque per ampere, so the same torque takes more current."""

from lptn.basics.parameters import Parameter
from lptn.effects.base import LossEffect, Signature, Symbol, Values
from lptn.effects.excitation import hot


class TorqueConstantDrop(LossEffect):
    r"""Torque constant falls with temperature.

    .. math:: k_\tau(T) = k_\tau \, [1 - \kappa (T - T_\mathrm{ref})], \qquad Q \propto k_\tau(T)^{-2}

    It matters only where the heat is computed from torque; a logged current already holds it.

    Source: [Chen2017, eq. 2.6] (0.0012 1/K).
    """

    key = "torque_constant_drop"
    title = "torque constant falling with temperature"
    common = True
    heat_of = "copper_loss"
    needs = ("torque",)
    prior_odds = 0.3
    """Drivers mostly log as torque what is current times a constant, which holds it already."""
    parameters = (
        Parameter("kappa", 0.0012, "1/K", (0.0, 0.005), off=0.0, title="temperature coefficient"),
        Parameter("reference", 25.0, "degC", (-50.0, 200.0), title="reference temperature", fixed=True),
    )
    signature = Signature(
        looks_like="predicted too cold under load when already hot, from the logged torque",
        separate_by="log the current besides the torque: at equal torque it rises with temperature",
        confused_with=("resistance_rise",),
    )
    excitation = hot()
    source = "[Chen2017, eq. 2.6]"

    def factor(self, temperature: Symbol, p: Values) -> Symbol:
        return (1 - p.kappa * (temperature - p.reference)) ** -2
