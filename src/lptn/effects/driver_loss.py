"""The drive's transistors and diodes have a voltage drop that hardly depends on the current."""

from lptn.basics.parameters import LARGEST, Parameter
from lptn.effects.base import NodeEffect, Signature, Symbol, Values
from lptn.effects.excitation import INPUTS_VARY


class DriverLoss(NodeEffect):
    r"""Heat in proportion to the current's absolute value.

    .. math:: Q = v \, |I|, \qquad |I| = |\tau| / k_\tau \text{ where only the joint torque is logged}

    The mean of the absolute value gives the exact mean heat. Switching losses have the same form.

    Source: conduction loss of a semiconductor with a threshold voltage, and switching loss at constant frequency.
    """

    key = "driver_loss"
    title = "loss of the drive in proportion to the current"
    common = True
    options = {"input": ("torque_abs", "current_abs")}  # noqa: RUF012
    parameters = (
        Parameter("voltage", 0.5, "V", (0.0, LARGEST), off=0.0, title="voltage drop of the drive"),
        Parameter("torque_constant", 0.84, "N*m/A", (1e-6, LARGEST), title="joint torque per ampere", fixed=True),
    )
    signature = Signature(
        looks_like="predicted too cold at small loads more than at large ones, beside a copper loss that fits",
        separate_by="hold one joint at three torques, 15 min each: linear or with the square?",
        confused_with=("loss_scale", "drive_heat", "gear_loss"),
    )
    excitation = INPUTS_VARY
    source = "semiconductor with a threshold voltage"

    def heat(self, temperature: Symbol, inputs: Values, p: Values) -> Symbol:
        if self.chosen["input"] == "current_abs":
            return p.voltage * abs(inputs.current_abs)
        return p.voltage * abs(inputs.torque_abs) / p.torque_constant
