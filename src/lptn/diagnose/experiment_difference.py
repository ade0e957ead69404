"""How two rivals differ in a proposed run: by how much, where, when, and whether that decides."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from lptn.arrays import FloatArray
from lptn.diagnose.experiment_power import Apart
from lptn.diagnose.experiment_programs import STEP
from lptn.diagnose.experiment_search import CLEAR

Key = tuple[str, str]
"""Effect and place."""


class Difference(NamedTuple):
    """How two rivals differ in the proposed run.

    Args:
        pair: the rivals, effect and place each.
        kelvin: the largest difference that no change of parameters takes away, mean of a minute [K].
        as_fitted: the largest difference of the predictions as the old data leave them [K].
        deviations: of all readings together, in standard deviations.
        decisive: the same, less where few stretches of the run hold all the evidence.
        node: where it is largest.
        minute: when.
    """

    pair: tuple[Key, Key]
    kelvin: float
    as_fitted: float
    deviations: float
    decisive: float
    node: str
    minute: float

    @property
    def clear(self) -> bool:
        """Whether the run decides between the two in four cases of five."""
        return self.decisive >= CLEAR


def difference(pair: tuple[Key, Key], apart: Apart, fitted: FloatArray, nodes: Sequence[str]) -> Difference:
    """Where and when the two differ most.

    Args:
        pair: the rivals.
        apart: how far their predictions lie apart.
        fitted: difference of the predictions as the old data leave them [K], shape (nodes, n).
        nodes: names of its rows.
    """
    per_minute = round(60 / STEP)
    minutes = apart.left.shape[1] // per_minute
    means = np.abs(apart.left[:, : minutes * per_minute].reshape(len(nodes), minutes, per_minute).mean(axis=2))
    row, column = np.unravel_index(int(np.argmax(means)), means.shape)
    kelvin, minute = float(means[row, column]), float(column + 1)
    return Difference(
        pair, kelvin, float(np.abs(fitted).max()), apart.deviations, apart.decisive, nodes[int(row)], minute
    )
