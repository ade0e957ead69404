"""Heat that no effect of the catalogue explains, as a curve over one input: learned, not named."""

from itertools import pairwise

from lptn.basics.parameters import LARGEST, Parameter
from lptn.effects.base import Effect, NodeEffect, Signature, Symbol, Values
from lptn.effects.excitation import INPUTS_VARY

PIECES = 8  # of the curve: so many show a bend, a threshold or a saturation; the prior holds those that no data fill
UNNAMED = "unexplained, but goes with "  # what is said of such heat, and never that it is explained
OWN_TEMPERATURE = "own_temperature"
_CORNER = 0.1  # of a piece: where two meet the curve bends, so that controllers get smooth derivatives


class LearnedHeat(NodeEffect):
    r"""Heat along a curve of eight pieces, which rises and never falls.

    .. math:: Q = \pm S \sum_{k=1}^{8} r_k \, \rho\!\left(\frac{x - x_{k-1}}{x_k - x_{k-1}}\right), \quad r_k \ge 0

    ρ goes from 0 to 1 over its piece. Over the magnitude x of a speed, a load or a power the heat is positive, zero at
    zero, its pieces become shorter towards zero (x_k goes with k²), where friction bends, and beyond the log it goes on
    along the last one. Over the node's own temperature it is a loss, which begins at the coldest that was logged and
    stays beyond the hottest: a heat that grew with its own temperature could run away where no log has been. Each r_k
    has the prior of a random walk, so that pieces without data stay level. It is never looked for as a name.

    Source: monotone regression splines ([Ramsay1988]), here of first order; a latent function learned within a
    thermal network as in [Kouw2024].
    """

    key = "learned_heat"
    title = "learned heat, without a name"
    options = {"input": ("velocity", "torque", "current", "power", OWN_TEMPERATURE)}  # noqa: RUF012
    parameters = (
        Parameter("scale", 3.0, "W", (1e-6, LARGEST), title="heat that rises are shares of", fixed=True),
        Parameter("start", 0.0, "1", title="where the curve begins, in the input's SI unit or degC", fixed=True),
        Parameter("span", 10.0, "1", (1e-9, LARGEST), title="the input's range in the logs", fixed=True),
        *(
            Parameter(f"rise_{number}", 0.2, "1", (0.0, LARGEST), prior=(0.0, 1.0), title=f"rise of piece {number}")
            for number in range(1, PIECES + 1)
        ),
    )
    signature = Signature(
        looks_like="heat that goes with one input, and that no effect of the catalogue explains",
        separate_by="hold the input at several levels, 15 min each, with everything else at rest",
        confused_with=("coulomb_friction", "iron_loss", "natural_convection"),
    )
    excitation = INPUTS_VARY
    source = "[Ramsay1988]; [Kouw2024]"

    def needed(self) -> tuple[str, ...]:
        return () if self.chosen["input"] == OWN_TEMPERATURE else super().needed()

    def heat(self, temperature: Symbol, inputs: Values, p: Values) -> Symbol:
        of_pieces = self.pieces(getattr(inputs, self.chosen["input"], temperature), p.start, p.span)
        rises = [getattr(p, f"rise_{number}") for number in range(1, PIECES + 1)]
        return p.scale * sum(rise * heat for rise, heat in zip(rises, of_pieces, strict=True))

    def pieces(self, value: Symbol, start: Symbol, span: Symbol) -> list[Symbol]:
        """Heat of each piece at an input, for a scale of 1 W and a rise of 1: a number, a symbol, or an array of them.

        Args:
            value: of the input, in its SI unit or degC.
            start: where the curve begins.
            span: from there to the end of the last piece.
        """
        own = self.chosen["input"] == OWN_TEMPERATURE
        share = ((value if own else abs(value)) - start) / span
        knots = [(number / PIECES) ** (1 if own else 2) for number in range(PIECES + 1)]
        heats = []
        for number, (left, right) in enumerate(pairwise(knots), start=1):
            at, origin = (share - left) / (right - left), -left / (right - left)
            open_end = number == PIECES and not own
            heats.append((-1 if own else 1) * (_ramp(at, open_end) - _ramp(origin, open_end)))
        return heats


def goes_with(effect: Effect, place: str) -> str:
    """The log column over which a learned heat is a curve, at a place or that which drives it."""
    feature = effect.chosen["input"]
    return f"{'temperature' if feature == OWN_TEMPERATURE else feature}.{place}"


def _ramp(at: Symbol, open_end: bool) -> Symbol:
    """From 0 to 1 between 0 and 1, level outside, with round corners; with an open end it goes on rising beyond 1."""
    rounded = (at**2 + _CORNER**2) ** 0.5
    return 0.5 * (rounded + at) if open_end else 0.5 * (rounded - ((at - 1) ** 2 + _CORNER**2) ** 0.5 + 1)
