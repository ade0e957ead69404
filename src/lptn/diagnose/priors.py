"""Prior odds: how often a candidate occurs, relative to the others."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from lptn.basics.arrays import FloatArray
from lptn.basics.places import EVERYWHERE
from lptn.diagnose.candidates import Candidate

OCCAM = 20.0
"""Times less probable than the best, from which on a model is out of Occam's window [MadiganRaftery1994]. On measured
logs no verdict changes with 13 or 30."""


def in_occams_window(probabilities: FloatArray) -> list[int]:
    """Numbers of the models that the most probable one does not rule out, the most probable first."""
    order = np.argsort(-probabilities, kind="stable")
    return [int(number) for number in order if probabilities[number] * OCCAM >= probabilities[order[0]]]


_ERRORS_ALIKE = 0.1
"""How usual the same error of several sensors is beside an error of one. Defects are of single sensors; to drift
alike, or to be off alike, they need a cause in common, such as the supply of all their bridges."""
_ONE_OF_LIKES = 0.3
"""How usual it is of one place alone, beside others like it, to have what follows from how it is built: as other rare
things are (`Effect.prior_odds`). Like parts are painted alike, and all windings are copper: a joint that loses more
heat than its likes is in a draught rather than the only one that radiates."""


def log_priors(candidates: Sequence[Candidate]) -> FloatArray:
    """Logarithms of the probabilities, beforehand, that it is this candidate that is missing, shape (candidates,).

    An effect's odds are split over its levels (everywhere, a class of nodes, one node), evenly but for errors of
    sensors and for what like places have alike; then evenly over the places of a level. Those of single runs likewise.
    """
    weights = np.zeros(len(candidates))
    for effect in {candidate.effect: None for candidate in candidates}:
        own = {k: candidate for k, candidate in enumerate(candidates) if candidate.effect is effect}
        most = max(len(candidate.places) for candidate in own.values())
        levels = {k: (bool(candidate.run), *_level(candidate, most)) for k, candidate in own.items()}
        for k, (of_run, _, share) in levels.items():
            whole = sum(other[-1] for other in set(levels.values()) if other[0] == of_run)
            weights[k] = own[k].prior_odds * share / whole / list(levels.values()).count(levels[k])
    return np.asarray(np.log(weights / weights.sum()))


def _level(candidate: Candidate, most: int) -> tuple[str, float]:
    """The level of a candidate's place, and how often it occurs relative to the effect's other places."""
    if len(candidate.places) > 1:
        level = "all" if candidate.pattern == EVERYWHERE or len(candidate.places) == most else "class"
    else:
        level = "one of likes" if candidate.one_of_likes else "one"
    if candidate.effect.measurement_error and level != "one":
        return level, _ERRORS_ALIKE
    return level, _ONE_OF_LIKES if level == "one of likes" else 1.0
