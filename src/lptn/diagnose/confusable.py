"""Which candidates leave the same trace on the data, so that these data can't tell them apart."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse.csgraph import connected_components

from lptn.arrays import FloatArray
from lptn.diagnose.score import Scores

ALIKE = 0.95
"""Correlation of traces from which two candidates are called alike."""


@dataclass(frozen=True)
class Confusability:
    """How alike the traces of some candidates are once the fitted parameters have imitated what they can.

    Args:
        keys: effect and place of each candidate, the best first, shape (n,).
        matrix: size of the correlation of their traces, 1 for the same trace, shape (n, n).
    """

    keys: tuple[tuple[str, str], ...]
    matrix: FloatArray

    def alike(self, least: float = ALIKE) -> list[tuple[tuple[str, str], tuple[str, str], float]]:
        """Pairs of candidates whose traces correlate by at least `least`, the most alike first."""
        rows, columns = np.triu_indices(len(self.keys), 1)
        pairs = [
            (self.keys[row], self.keys[column], float(self.matrix[row, column]))
            for row, column in zip(rows, columns, strict=True)
            if self.matrix[row, column] >= least
        ]
        return sorted(pairs, key=lambda pair: -pair[2])

    def groups(self, least: float = ALIKE) -> list[tuple[tuple[str, str], ...]]:
        """Candidates that pairs of that likeness link, two or more to a group, the best first."""
        count, labels = connected_components(self.matrix >= least, directed=False) if self.keys else (0, np.zeros(0))
        members = [tuple(self.keys[row] for row in np.flatnonzero(labels == label)) for label in range(count)]
        return [group for group in members if len(group) > 1]


def confusability(scores: Scores, most: int = 12) -> Confusability:
    """The best candidates against each other.

    Args:
        scores: of a diagnosis.
        most: how many candidates to compare at most; those that score nothing leave no trace to compare.
    """
    chosen = [each for each in scores.ranked if each.gain > 0 and each.direction.any()][:most]
    keys = tuple(each.candidate.key for each in chosen)
    if not chosen:
        return Confusability(keys, np.zeros((0, 0)))
    traces = np.array([each.direction / np.linalg.norm(each.direction) for each in chosen])
    return Confusability(keys, np.asarray(np.minimum(np.abs(traces @ traces.T), 1.0)))
