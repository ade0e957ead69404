"""A ladder in the making: a model with some effects added, fitted on coarse data, and its held-out error."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from lptn.compare import Errors, Prediction, predict
from lptn.diagnose import Finding
from lptn.evidence import Evidence
from lptn.identify import Fit

WORTH = 0.01
"""Share by which a rung must lower the held-out error."""


@dataclass(frozen=True)
class Climb:
    """A ladder in the making.

    Args:
        fit: of the model with the effects added so far.
        steps: the effects, in the order in which they were added.
        data: the evidence, in the steps of the search.
    """

    fit: Fit
    steps: tuple[Finding, ...]
    data: Evidence

    @property
    def effects(self) -> frozenset[tuple[str, str]]:
        """Effect and place of all steps."""
        return frozenset(step.key for step in self.steps)

    @cached_property
    def predictions(self) -> list[Prediction]:
        """Of the held-out runs."""
        return [predict(self.fit.model, part, self.fit.problem.sigma) for part in self.data.holdout]

    @cached_property
    def holdout(self) -> Errors | None:
        """Errors on the held-out runs, `None` without any."""
        if not self.data.holdout:
            return None
        return Errors.of(np.concatenate([prediction.error.ravel() for prediction in self.predictions]))

    @property
    def rank(self) -> float:
        """What orders ladders: the held-out error where there is one, else the misfit."""
        return self.holdout.rmse if self.holdout else self.fit.cost
