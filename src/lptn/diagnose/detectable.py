"""What these data could have shown at all: the smallest size of each effect that would have been noticed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lptn.diagnose.score import Scores

_POWER = 0.84  # standard deviations above the threshold at which four of five logs would show it


@dataclass(frozen=True)
class Detectable:
    """The smallest size of one effect at one place that these data would reveal, four times out of five.

    Args:
        effect: its key.
        at: its place.
        amplitude: the size, in the amplitude's unit.
        unit: of the amplitude.
        share: the size as a share of the typical one.
    """

    effect: str
    at: str
    amplitude: float
    unit: str
    share: float

    def as_json(self) -> dict[str, object]:
        """The size as other tools read it."""
        return {
            "effect": self.effect,
            "at": self.at,
            "smallest": self.amplitude,
            "unit": self.unit,
            "share_of_typical": self.share,
        }


def smallest(scores: Scores) -> list[Detectable]:
    """For each candidate that was scored the size that would have been noticed, the easiest to see first.

    To first order, at the place's best shape: a size larger than the threshold by what noise takes off in one log
    of five. What the fitted parameters imitate wholly is not listed, since no size of it would show.
    """
    needed = float(np.sqrt(scores.threshold)) + _POWER * float(np.sqrt(np.median(scores.chance)))
    found = []
    for score in scores.ranked:
        amplitude = score.candidate.effect.amplitude()
        if amplitude is not None and score.per_unit > 0:
            effect, at = score.candidate.key
            size = needed / score.per_unit
            found.append(Detectable(effect, at, size, amplitude.unit, size / abs(amplitude.typical)))
    return sorted(found, key=lambda each: each.share)
