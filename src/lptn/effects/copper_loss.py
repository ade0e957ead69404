"""Current through the winding's resistance heats it."""

from typing import Literal

from lptn.basics.parameters import LARGEST, Parameter
from lptn.effects.base import NodeEffect, Signature, Symbol, Values
from lptn.effects.excitation import INPUTS_VARY

# Heat of a symmetric three-phase winding for 1 ohm of a star's phase and 1 ampere, by what the ampere is: the phases'
# currents squared, summed, and averaged over a turn. A delta of R is a star of R/3; two phases of a star are in series
# between two terminals.
Amperes = Literal["power_invariant", "amplitude", "rms", "block"]
ResistanceOf = Literal["phase", "line_to_line", "delta"]
_AMPERES: dict[str, float] = {"power_invariant": 1.0, "amplitude": 1.5, "rms": 3.0, "block": 2.0}
_RESISTANCES: dict[str, float] = {"phase": 1.0, "line_to_line": 1 / 2, "delta": 1 / 3}


class CopperLoss(NodeEffect):
    r"""Ohmic heat of the winding.

    .. math:: Q = f R_d I^2, \qquad I = \tau / k_\tau \text{ where only the joint torque is logged}

    Over an interval the RMS of current or torque gives the exact mean heat. The resistance is taken from
    the data sheet and held, since it sets the scale of all capacitances and resistances: one of another kind
    than is said makes all of them wrong by the same factor.

    `resistance_of` says what the resistance is of: one phase of a star, two terminals, or one side of a delta.
    `amperes` says what a logged ampere is, and an ampere of the torque constant: of the q axis as the drive's
    transform has it, `"power_invariant"` or `"amplitude"` (a line's peak); a line's RMS; or `"block"`, the current
    through two terminals at a time, which is all that a brushed motor has. f is 1 for the first of each; 1.5 for line
    to line and RMS; 0.75 for line to line and amplitude; 1 for line to line and block, and for delta and RMS. The
    current that a drive draws from its supply is none of these.

    Source: [QuadrupedLPTN, eq. 1, 15]; [Chen2017, eq. 2.4]; f from the sum of three sinusoids squared.
    """

    key = "copper_loss"
    title = "copper loss"
    options = {  # noqa: RUF012
        "input": ("torque", "current"),
        "resistance_of": tuple(_RESISTANCES),
        "amperes": tuple(_AMPERES),
    }
    parameters = (
        Parameter("resistance", 0.15, "ohm", (1e-6, LARGEST), title="winding resistance", fixed=True),
        Parameter("torque_constant", 0.84, "N*m/A", (1e-6, LARGEST), title="joint torque per ampere", fixed=True),
    )
    signature = Signature(
        looks_like="predicted too cold whenever the joint carries load",
        separate_by="hold one joint at two torques, 15 min each",
        confused_with=("constant_heat",),
    )
    excitation = INPUTS_VARY
    source = "I²R: [QuadrupedLPTN, eq. 1]"

    def heat(self, temperature: Symbol, inputs: Values, p: Values) -> Symbol:
        current = inputs.current if self.chosen["input"] == "current" else inputs.torque / p.torque_constant
        return self.factor * p.resistance * current**2

    @property
    def factor(self) -> float:
        """Heat for 1 ohm and 1 ampere of the kinds that are said [W]."""
        return _AMPERES[self.chosen["amperes"]] * _RESISTANCES[self.chosen["resistance_of"]]
