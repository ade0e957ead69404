"""The temperatures of a log come later, or earlier, than its torques and speeds."""

from lptn.basics.parameters import Parameter
from lptn.effects.base import ClockEffect, Signature, Symbol, Values
from lptn.effects.excitation import LOAD_STEPS


class ClockOffset(ClockEffect):
    r"""A delay of all readings of the robot against its inputs.

    .. math:: y(t) = T(t - d)

    Before a run's first instant and behind its last the temperature is taken as constant. A negative delay means
    readings that come early.

    Source: definition; two computers log inputs and temperatures, each by its own clock.
    """

    key = "clock_offset"
    title = "clock offset between temperatures and inputs"
    measurement_error = True
    prior_odds = 0.01
    """Most logs have one clock, and no measured one that this project ships has two that are apart; in those of two the
    offset is seconds, and is aligned where they are joined."""
    per_run = True
    whole_robot = True
    in_one_run = (
        "in {run} the temperatures come {size} s later than the inputs: are its clocks apart?",
        "in {run} the temperatures come {size} s earlier than the inputs: are its clocks apart?",
    )
    parameters = (Parameter("delay", 10.0, "s", (-7200.0, 7200.0), off=0.0, title="delay of the readings"),)
    signature = Signature(
        looks_like="all readings come late (or early) at every change of load, by the same time on every node",
        separate_by="one short strong burst of load from rest: when does the first node begin to warm?",
        confused_with=("sensor_lag", "winding_mass", "second_mass"),
    )
    excitation = LOAD_STEPS
    source = "definition"

    def delay(self, p: Values) -> Symbol:
        return p.delay
