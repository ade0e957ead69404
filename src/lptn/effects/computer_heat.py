"""Part of the onboard computer's heat reaches a joint."""

from lptn.basics.parameters import Parameter
from lptn.effects.base import NodeEffect, Signature, Symbol, Values
from lptn.effects.excitation import INPUTS_VARY


class ComputerHeat(NodeEffect):
    r"""A share of the computer's logged power.

    .. math:: Q = f \, P_{pc}

    Source: [QuadrupedLPTN, eq. 1] (Q_other); the virtual quadruped's computer (`lptn.virtual`) sits between the hips.
    """

    key = "computer_heat"
    title = "heat of the onboard computer"
    options = {"input": ("pc_power", "computer_power")}  # noqa: RUF012
    parameters = (Parameter("fraction", 0.1, "1", (0.0, 1.0), off=0.0, title="share of the computer's power"),)
    signature = Signature(
        looks_like="predicted too cold whenever the computer works hard, at rest as well",
        separate_by="leave the robot resting for an hour with the computer under full load, then idle",
        confused_with=("constant_heat", "conduction", "battery_heat"),
    )
    excitation = INPUTS_VARY
    source = "[QuadrupedLPTN, eq. 1]"

    def heat(self, temperature: Symbol, inputs: Values, p: Values) -> Symbol:
        power = inputs.pc_power if self.chosen["input"] == "pc_power" else inputs.computer_power
        return p.fraction * power
