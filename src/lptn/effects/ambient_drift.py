"""The air around the robot warms or cools while nobody logs it."""

from collections.abc import Sequence

from lptn.basics.parameters import LARGEST, Parameter
from lptn.effects.base import CLOCK, BoundaryEffect, NetworkPlaces, Signature, Symbol, Values
from lptn.effects.excitation import long_enough


class AmbientDrift(BoundaryEffect):
    r"""A prescribed temperature that is taken as constant rises evenly from the start of a log.

    .. math:: T_E' = T_E + r \, t

    The time is kept as a state, :math:`T_t = T_E + t \cdot 1000\,\mathrm{K/h}`. Where the air is logged its log says
    how it rises, and nobody is asked for this.

    Source: definition; a room warms when the sun reaches it, when people or robots work in it.
    """

    key = "ambient_drift"
    title = "unlogged ambient drift"
    measurement_error = True
    per_run = True
    has_state = True
    in_one_run = ("in {run} the {place} warmed by {size} K an hour", "in {run} the {place} cooled by {size} K an hour")
    parameters = (Parameter("rate", 1.0, "K/h", (-LARGEST, LARGEST), off=0.0, title="rise of the temperature"),)
    signature = Signature(
        looks_like="every node is off by more and more, all by about the same, whatever the robot does",
        separate_by="log the air, or leave the robot unpowered beside a thermometer for an hour",
        confused_with=("sensor_drift", "shared_mass", "surface_scale"),
    )
    excitation = long_enough()
    source = "definition"
    rises = CLOCK

    @classmethod
    def makes_a_difference(cls, place: str, layout: NetworkPlaces, driving: Sequence[Sequence[str]]) -> bool:
        """It matters only where no column says what the temperature does."""
        return place in layout.unlogged

    def error(self, temperature: Symbol, state: Symbol, p: Values) -> Symbol:
        return p.rate * (state - temperature) / (3600.0 * CLOCK)

    def rate(self, temperature: Symbol, state: Symbol, p: Values) -> Symbol:
        return self.rises
