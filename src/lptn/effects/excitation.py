"""What happens in logs, and the rules of thumb by which an effect says what it needs of that to show.

A rule looks at what the robot was put through and at no model: what passes may still be beyond the data, which
`lptn diagnose` works out. Each effect names its rule as `excitation`; `lptn check` measures the logs and asks it.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass

CHANGE = 0.1  # of an input's largest one-minute mean: less counts as constant
ZERO = 1e-9  # in any SI unit: below it an input is 0 but for rounding


@dataclass(frozen=True)
class Excitation:
    """What the runs put the robot through.

    Args:
        minutes: length of all runs together.
        runs: how many there are.
        levels: of load, distinct in one-minute means, of the joint that has most of them; 0 if no load is logged.
        still: share of the time at rest.
        cool_downs: stretches of less than half the largest load in which a joint cools by 1 K and more, likewise.
        steps: jumps of the load from one minute to the next by 30 % of the largest, likewise.
        rise: K, how far the hottest node gets above its surroundings, or above the start if those aren't logged.
        spread: K, the range of the difference between nodes; 0 with one node.
        ambient: K, largest range of the surroundings in a run; 0 if they aren't logged.
        coarse: K, the largest step in which a sensor moves; 0 where all are fine.
        ranges: by input column its least and largest one-minute mean.
        together: by place how closely its speed and its load go together, a correlation; where both are logged.
    """

    minutes: float
    runs: int
    levels: int
    still: float
    cool_downs: int
    steps: int
    rise: float
    spread: float
    ambient: float
    coarse: float
    ranges: Mapping[str, tuple[float, float]]
    together: Mapping[str, float]

    def varies(self, column: str) -> bool:
        """Whether an input's one-minute means differ by a tenth of the largest."""
        low, high = self.ranges.get(column, (0.0, 0.0))
        return high - low > CHANGE * max(abs(low), abs(high)) and high - low > ZERO

    def as_json(self) -> dict[str, object]:
        """For other programs."""
        ranges = {column: list(ends) for column, ends in self.ranges.items()}
        return self.__dict__ | {"ranges": ranges, "together": dict(self.together)}


@dataclass(frozen=True)
class ExcitationRule:
    """What an effect needs of logs to show.

    Args:
        needs: in words, for people.
        lacking: what the logs lack, in a few words, from what happens in them and the places where the effect could
            stand; `""` where nothing is lacking.
    """

    needs: str
    lacking: Callable[[Excitation, Collection[str]], str]


INPUTS_VARY = ExcitationRule("its inputs change from minute to minute", lambda logs, places: "")
"""Nothing but what is asked of every effect that reads inputs: that they are logged and not constant."""


def hot(rise: float = 10.0) -> ExcitationRule:
    """What bends with temperature: a rise above the surroundings, passed through at more than one load.

    Args:
        rise: of the hottest node [K]; over 10 K the usual laws bend the loss of heat by 5 % or so, more than the
            scatter of a fit.
    """

    def lacking(logs: Excitation, _: Collection[str]) -> str:
        if logs.rise < rise:
            return f"the hottest node gets only {logs.rise:.2g} K above its surroundings"
        return "" if logs.cool_downs or logs.levels > 1 else "one level of load and no cool-down"

    return ExcitationRule(f"a node {rise:g} K above its surroundings, and a cool-down or two levels of load", lacking)


LOAD_STEPS = ExcitationRule(
    "a jump of the load, or a cool-down",
    lambda logs, _: "" if logs.steps or logs.cool_downs else "no jump of the load from one minute to the next",
)
"""What answers late or early to a change: a hidden mass, a lag, a clock."""


def _rest_or_levels(logs: Excitation, _: Collection[str]) -> str:
    at_rest = 0.02  # share of the time: some minutes of standstill in an hour are enough to see what rest looks like
    if logs.cool_downs or logs.still > at_rest or logs.levels > 1:
        return ""
    return "no standstill and one level of load: it looks like more heat"


REST_OR_LEVELS = ExcitationRule("a standstill, a cool-down or two levels of load", _rest_or_levels)
"""What is there with and without load: a constant heat, an offset."""


def speed_apart_from_load(most: float = 0.97) -> ExcitationRule:
    """What goes with the speed: speed and load of a place must not have a correlation above `most`.

    Beyond 0.97 less than 6 % of the variance of the speed is free of the load.
    """

    def lacking(logs: Excitation, places: Collection[str]) -> str:
        own = [logs.together[place] for place in places if place in logs.together]
        if own and min(own) > most:
            return f"speed and load go together (correlation {min(own):.2f}): it looks like more copper loss"
        return ""

    return ExcitationRule("speed that doesn't just follow the load", lacking)


def nodes_apart(spread: float = 0.5) -> ExcitationRule:
    """What needs nodes of different temperatures: by `spread` [K], and by two steps of a coarse sensor.

    Nodes that differ by less exchange too little heat to tell from what reaches them otherwise.
    """

    def lacking(logs: Excitation, _: Collection[str]) -> str:
        enough = logs.spread >= max(spread, 2 * logs.coarse)
        return "" if enough else f"the nodes' temperatures differ by {logs.spread:.2g} K more or less, no more"

    return ExcitationRule(f"differences between the nodes that change by {spread:g} K", lacking)


def surroundings_change(by: float = 1.0) -> ExcitationRule:
    """What acts on a change of the surroundings, by so many kelvin: less is within the error of an ambient sensor."""

    def lacking(logs: Excitation, _: Collection[str]) -> str:
        if not logs.ambient > ZERO:
            return "no change of the surroundings is logged"
        return "" if logs.ambient >= by else f"in no run do the surroundings change by more than {logs.ambient:.2g} K"

    return ExcitationRule(f"surroundings that change by {by:g} K in a run", lacking)


def long_enough(minutes: float = 30.0) -> ExcitationRule:
    """What grows with time: logs of so many minutes, in which a drift of 1 K/h is half a kelvin, above the noise."""

    def lacking(logs: Excitation, _: Collection[str]) -> str:
        return "" if logs.minutes >= minutes else f"{logs.minutes:.3g} min are too short for a drift"

    return ExcitationRule(f"logs of {minutes:g} min or more", lacking)


SEVERAL_RUNS_OR_PLACES = ExcitationRule(
    "several runs, or several places",
    lambda logs, places: (
        "" if logs.runs > 1 or len(places) > 1 else "one run and one place: a fitted parameter takes it up"
    ),
)
"""What differs from the rest by a factor: there has to be a rest."""
