"""Which of the log's inputs the unexplained heat goes with."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lptn.arrays import FloatArray
from lptn.diagnose.unexplained_heat import UnexplainedHeat
from lptn.identify import Fit
from lptn.logs import Run

_STILL = 1e-6  # of its size; an input that varies by less does not vary
_SHORT = 3  # blocks; fewer correlate by themselves


@dataclass(frozen=True)
class InputLink:
    """How closely one node's unexplained heat follows one input.

    Args:
        node: the node.
        column: the log's column.
        squared: whether the column's square is meant.
        correlation: from -1 to 1, over all blocks of all runs.
    """

    node: str
    column: str
    squared: bool
    correlation: float

    @property
    def what(self) -> str:
        """The column, with a square where that is meant."""
        return f"{self.column}²" if self.squared else self.column


def input_links(fit: Fit, found: Sequence[UnexplainedHeat]) -> list[InputLink]:
    """Correlation of each node's unexplained heat with each input column, or its square where that is closer.

    What the heat goes with suggests a cause and proves none: inputs go with each other, and slow series go with
    each other by chance.

    Args:
        fit: the fitted model that `found` was made from.
        found: the heat of its runs.

    Returns:
        The closest first, for columns that all runs have and that vary.
    """
    runs = [driven.run for driven in fit.problem.drives]
    columns = sorted(set.intersection(*(set(run.columns) for run in runs)))
    outputs = {f"temperature.{node}" for node in fit.model.nodes}
    links = []
    for column in columns:
        if column not in outputs:
            plain, squared = (
                np.concatenate([block_means(run, each, column, square) for run, each in zip(runs, found, strict=True)])
                for square in (False, True)
            )
            links += _links(found, column, plain, squared)
    return sorted(links, key=lambda link: -abs(link.correlation))


def block_means(run: Run, found: UnexplainedHeat, column: str, squared: bool = False) -> FloatArray:
    """Means of a column, or of its square, over the blocks of the unexplained heat, shape (n,)."""
    size = round(found.seconds / run.step)
    first = int(np.argmin(np.abs(run.time - (found.time[0] - found.seconds / 2))))
    values = run.columns[column][first : first + size * found.time.size].reshape(-1, size)
    return np.asarray((values**2 if squared else values).mean(axis=1))


def _links(found: Sequence[UnexplainedHeat], column: str, plain: FloatArray, squared: FloatArray) -> list[InputLink]:
    links = []
    for node in dict.fromkeys(node for each in found for node in each.nodes):
        heat = np.concatenate([_of_node(each, node) for each in found])
        known = np.isfinite(heat)
        both = [_correlation(heat[known], values[known]) for values in (plain, squared)]
        square, closest = max(enumerate(both), key=lambda pair: abs(pair[1]))
        if closest:
            links.append(InputLink(node, column, bool(square), closest))
    return links


def _of_node(found: UnexplainedHeat, node: str) -> FloatArray:
    """A node's heat, NaN in a run that does not measure it."""
    return found.heat[found.nodes.index(node)] if node in found.nodes else np.full(found.time.size, np.nan)


def _correlation(one: FloatArray, other: FloatArray) -> float:
    """Pearson's, 0 where either stands still or is not known throughout."""
    if one.size < _SHORT or not np.isfinite(other).all():
        return 0.0
    if np.ptp(one) == 0 or np.ptp(other) <= _STILL * np.abs(other).max():
        return 0.0
    return float(np.corrcoef(one, other)[0, 1])
