"""Current through the winding's resistance heats it."""

from __future__ import annotations

from types import SimpleNamespace

from lptn.basics.parameters import LARGEST, Parameter
from lptn.effects.base import NodeEffect, Signature, Symbol
from lptn.effects.excitation import INPUTS_VARY


class CopperLoss(NodeEffect):
    r"""Ohmic heat of the winding.

    .. math:: Q = R_d I^2, \qquad I = \tau / k_\tau \text{ where only the joint torque is logged}

    Over an interval the RMS of current or torque gives the exact mean heat. The resistance is taken from
    the data sheet and held, since it sets the scale of all capacitances and resistances.

    Source: [QuadrupedLPTN, eq. 1, 15]; [Chen2017, eq. 2.4].
    """

    key = "copper_loss"
    title = "copper loss"
    options = {"input": ("torque", "current")}  # noqa: RUF012
    parameters = (
        Parameter("resistance", 0.15, "ohm", (1e-6, LARGEST), typical=0.15, title="winding resistance", fixed=True),
        Parameter(
            "torque_constant", 0.84, "N*m/A", (1e-6, LARGEST), typical=0.84, title="joint torque per ampere", fixed=True
        ),
    )
    signature = Signature(
        looks_like="predicted too cold whenever the joint carries load",
        separate_by="hold one joint at two torques, 15 min each",
        confused_with=("constant_heat",),
    )
    excitation = INPUTS_VARY
    source = "I²R: [QuadrupedLPTN, eq. 1]"

    def heat(self, temperature: Symbol, inputs: SimpleNamespace, p: SimpleNamespace) -> Symbol:
        current = inputs.current if self.chosen["input"] == "current" else inputs.torque / p.torque_constant
        return p.resistance * current**2
