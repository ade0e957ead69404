"""The sensor's error grows with time."""

from collections.abc import Sequence

from lptn.basics.parameters import LARGEST, Parameter
from lptn.effects.base import CLOCK, ExcessEffect, NetworkPlaces, Signature, Symbol, Values
from lptn.effects.excitation import long_enough


class SensorDrift(ExcessEffect):
    r"""Error of the reading that grows evenly from the start of a log.

    .. math:: y = T + r \, t

    The time is kept as a state, :math:`T_t = T + t \cdot 1000\,\mathrm{K/h}`.

    A search does not look for it where the model takes all heat to be constant: that heat seldom is, and a slow change
    of it, for which the catalogue has no name, would be named a drift.

    Source: definition; [QuadrupedLPTN, application 2] (a sensor that drifts is the fault that its monitor looks for).
    """

    key = "sensor_drift"
    title = "sensor drift"
    measurement_error = True
    prior_odds = 0.03
    """Calibrated sensors drift by fractions of a kelvin in a year; a drift within a log is a defect, that none of the
    thirteen measured logs of `tests/benchmarks/measured_verdicts.py` is known to have."""
    per_run = True
    in_one_run = ("in {run} {of} drifts up by {size} K an hour", "in {run} {of} drifts down by {size} K an hour")
    parameters = (Parameter("rate", 1.0, "K/h", (-LARGEST, LARGEST), off=0.0, title="drift of the reading"),)
    signature = Signature(
        looks_like="predicted off by more and more, whatever the robot does",
        separate_by="two hours at rest with nothing powered: does the reading leave the ambient?",
        confused_with=("sensor_offset", "constant_heat", "second_mass", "shared_mass"),
    )
    excitation = long_enough()
    source = "definition"
    rises = CLOCK

    @classmethod
    def makes_a_difference(cls, place: str, layout: NetworkPlaces, driving: Sequence[Sequence[str]]) -> bool:
        """Where all heat is taken to be constant, heat that is not would be named a drift."""
        return place not in layout.nodes_of_constant_heat

    def error(self, temperature: Symbol, state: Symbol, p: Values) -> Symbol:
        return p.rate * (state - temperature) / (3600.0 * CLOCK)

    def excess_rate(self, excess: Symbol, heat: Symbol, p: Values) -> Symbol:
        return self.rises
