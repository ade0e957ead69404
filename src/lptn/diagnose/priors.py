"""Prior odds: how often a candidate is what is missing, beside the others."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np

from lptn.basics.arrays import FloatArray
from lptn.basics.places import EVERYWHERE
from lptn.diagnose.candidates import Candidate
from lptn.effects import Effect

OCCAM = 20.0
"""Times less probable than the best, from which on a model is out of Occam's window [MadiganRaftery1994]."""


def in_occams_window(probabilities: FloatArray) -> list[int]:
    """Numbers of the models that the most probable one does not rule out, the most probable first."""
    order = np.argsort(-probabilities, kind="stable")
    return [int(number) for number in order if probabilities[number] * OCCAM >= probabilities[order[0]]]


_ERRORS_ALIKE = 0.1
"""How usual the same error of several sensors is beside an error of one. A defect befalls single sensors; to drift
alike, or to be off alike, they need a cause in common, such as the supply of all their bridges."""
_ONE_OF_LIKES = 0.3
"""How usual it is of one place alone, beside others like it, to have what follows from how it is built: as other rare
things are (`Effect.prior_odds`). Like parts are painted alike, and all windings are copper: a joint that loses more
heat than its likes is in a draught rather than the only one that radiates."""


Level = Literal["all", "class", "one", "one of likes"]


def log_priors(candidates: Sequence[Candidate]) -> FloatArray:
    """Logarithms of the probabilities, beforehand, that it is this candidate that is missing, shape (candidates,).

    An effect's odds are split over its levels (everywhere, a class of nodes, one node), evenly but for errors of
    sensors and for what like places have alike; then evenly over the places of a level. Those of single runs likewise.
    """
    weights = np.zeros(len(candidates))
    for effect in {candidate.effect: None for candidate in candidates}:
        own = [k for k, candidate in enumerate(candidates) if candidate.effect is effect]
        most = max(len(candidates[k].places) for k in own)
        levels = [(bool(candidates[k].run), _level(candidates[k], most)) for k in own]
        for k, level in zip(own, levels, strict=True):
            shares = {other: _share_of_level(effect, other[1]) for other in levels if other[0] == level[0]}
            weights[k] = candidates[k].prior_odds * shares[level] / sum(shares.values()) / levels.count(level)
    return np.asarray(np.log(weights / weights.sum()))


def _share_of_level(effect: type[Effect], level: Level) -> float:
    if effect.measurement_error and level != "one":
        return _ERRORS_ALIKE
    return _ONE_OF_LIKES if level == "one of likes" else 1.0


def _level(candidate: Candidate, most: int) -> Level:
    if len(candidate.places) == 1:
        return "one of likes" if candidate.one_of_likes else "one"
    return "all" if candidate.pattern == EVERYWHERE or len(candidate.places) == most else "class"
