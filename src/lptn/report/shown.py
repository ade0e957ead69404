"""Data of figures of comparisons, diagnoses and unexplained heat, independent of what draws them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from math import sqrt
from typing import TYPE_CHECKING

import numpy as np

from lptn.basics.arrays import FloatArray
from lptn.basics.errors import InputError
from lptn.diagnose.answers import Step
from lptn.diagnose.unexplained_heat import UnexplainedHeat, means_in_blocks
from lptn.identify.comparison import Comparison, Prediction
from lptn.identify.fitting import Fit
from lptn.logs.resampling import means_of_blocks

if TYPE_CHECKING:
    from lptn.diagnose.advice import Detectable
    from lptn.diagnose.improvement import History

# --- temperatures and errors in time ----------------------------------------------------------------------

NOISE_BAND = 2.0
"""Half-width of the band of noise, in multiples of the RMSE that noise alone would leave."""

ONE_SIDED = 0.5
"""Share of an RMSE from which on its mean error says to which side a model is off."""

MOST = 6
"""Panels in one figure."""

View = tuple[int, str]
"""The number of a run and the name of a node."""


def initialisation_end(prediction: Prediction) -> float | None:
    """Where the initialisation window ends [s, counted from the run's origin], `None` where its errors count, too."""
    segment = prediction.segment
    if segment.initialisation == segment.evaluation:
        return None
    return min(segment.initialisation[1], float(segment.run.time[-1])) - segment.run.origin


def views(comparison: Comparison) -> list[View]:
    """Every node measured in a run, run by run."""
    return [
        (number, node)
        for number, prediction in enumerate(comparison.predictions)
        for row, node in enumerate(comparison.model.nodes)
        if prediction.bound.counted[row].any()
    ]


def worst_views(comparison: Comparison, most: int = MOST) -> list[View]:
    """The views with the largest RMSE, in the order of runs and nodes."""
    every = views(comparison)
    chosen = sorted(every, key=lambda view: -rmse_of(comparison, view))[:most]
    return [view for view in every if view in chosen]


def worst_view(comparison: Comparison, node: str | None = None, run: int | None = None) -> View:
    """The view with the largest RMSE, of one node or one run if they are given.

    Raises:
        InputError: there is none.
    """
    every = views(comparison)
    fitting = [view for view in every if run in (None, view[0]) and node in (None, view[1])]
    if not fitting:
        measured = ", ".join(dict.fromkeys(name for number, name in every if run in (None, number)))
        raise InputError("plot", "node", repr(node), f"a node that is measured: {measured}")
    return max(fitting, key=lambda view: rmse_of(comparison, view))


def rmse_of(comparison: Comparison, view: View) -> float:
    return comparison.node(view[1], comparison.predictions[view[0]]).rmse


# --- maps of nodes by time ------------------------------------------------------------------------------------

MOST_RUNS = 4
"""Runs in one figure."""
MOST_INPUTS = 3
"""Inputs drawn below the heat."""
_COLUMNS = 150  # blocks of time in one map


@dataclass(frozen=True)
class Field:
    """One run's values at each node over time.

    Args:
        run: its name.
        start: of the first block in the log's clock [s].
        seconds: length of a block.
        nodes: the rows.
        values: shape (nodes, blocks), NaN where unknown.
    """

    run: str
    start: float
    seconds: float
    nodes: tuple[str, ...]
    values: FloatArray


def error_fields(comparison: Comparison) -> list[Field]:
    """Predicted − measured [K] of each run where it counts, means over blocks of time."""
    fields = []
    for prediction in comparison.predictions:
        error, run = prediction.error, prediction.segment.run
        rows = np.flatnonzero(np.isfinite(error).any(axis=1))
        counted = np.flatnonzero(np.isfinite(error).any(axis=0))
        first, length = int(counted[0]), int(counted[-1] - counted[0]) + 1
        size = max(1, length // _COLUMNS)
        means = means_of_blocks(error[rows, first : first + length], size)
        nodes = tuple(comparison.model.nodes[row] for row in rows)
        fields.append(Field(run.name, float(run.elapsed[first]), size * run.step, nodes, means))
    return fields


def heat_fields(runs: Sequence[UnexplainedHeat]) -> list[Field]:
    """Unexplained heat [W] of each run, 0 where zero lies within its band."""
    return [
        Field(
            estimate.run,
            float(estimate.time[0] - estimate.seconds / 2) - estimate.origin,
            estimate.seconds,
            estimate.nodes,
            np.where(np.abs(estimate.heat) > estimate.sure_band, estimate.heat, 0.0),
        )
        for estimate in runs
    ]


@dataclass(frozen=True)
class InputLink:
    """How closely one node's unexplained heat follows one input.

    Args:
        column: the log's column.
        squared: whether the column's square is meant.
        correlation: Pearson's, from -1 to 1, over all blocks of all runs.
    """

    column: str
    squared: bool
    correlation: float

    @property
    def what(self) -> str:
        """The column, with a square where that is meant."""
        return f"{self.column}²" if self.squared else self.column


def input_links(fit: Fit, heat: Sequence[UnexplainedHeat], node: str) -> list[InputLink]:
    """Correlation of a node's unexplained heat with each input column, or its square where that is closer.

    A correlation suggests a cause but does not prove it: inputs correlate with each other, and slow series correlate
    by chance.

    Args:
        fit: the fitted model that lacks the heat.
        heat: of its runs.
        node: a measured one.

    Returns:
        The closest first, for columns that all runs have and that vary.
    """
    runs = [bound.run for bound in fit.problem.bound_runs]
    columns = set.intersection(*(set(run.columns) for run in runs)) - {
        f"temperature.{name}" for name in fit.model.nodes
    }
    measured = [(run, own) for run, own in zip(runs, heat, strict=True) if node in own.nodes]
    its, links = np.concatenate([own.heat[own.nodes.index(node)] for _, own in measured]), []
    for column, squared in product(sorted(columns), (False, True)):
        series = [(run.columns[column] ** (2 if squared else 1), run, own) for run, own in measured]
        values = np.concatenate([means_in_blocks(x, run, own.time, own.seconds) for x, run, own in series])
        varies = np.ptp(values) > 1e-6 * np.abs(values).max(initial=0.0)  # not where a mean is missing
        if varies and np.ptp(its) > 0 and its.size > 2:  # two points always correlate
            links.append(InputLink(column, squared, float(np.corrcoef(its, values)[0, 1])))
    links.sort(key=lambda link: -abs(link.correlation))
    closer: dict[str, InputLink] = {}
    for link in links:
        closer.setdefault(link.column, link)
    return list(closer.values())


def worst_runs(fields: Sequence[Field]) -> list[int]:
    """Numbers of the runs with the largest values, in the order of the runs."""
    order = sorted(range(len(fields)), key=lambda place: -float(np.nanmean(fields[place].values ** 2)))
    return sorted(order[:MOST_RUNS])


# --- a diagnosis --------------------------------------------------------------------------------------------------


def noise_alone(fit: Fit) -> float:
    """The RMSE that the noise of the measured nodes' sensors alone would leave [K]."""
    return sqrt(float(np.mean(fit.noise.floor[fit.problem.measured] ** 2)))


def effects_shown(history: History) -> tuple[Step, ...]:
    """What was added, or is the answer where nothing was yet."""
    return history.steps[1:] or history.first.steps


@dataclass(frozen=True)
class Reach:
    """The places where an effect is easiest and hardest to detect."""

    easiest: Detectable
    hardest: Detectable


def reaches(sizes: Sequence[Detectable]) -> list[Reach]:
    """One for each effect, the easiest to see first."""
    effects: dict[str, list[Detectable]] = {}
    for size in sizes:
        effects.setdefault(size.effect, []).append(size)
    by_share = (sorted(places, key=lambda size: size.share_of_typical) for places in effects.values())
    return sorted(
        (Reach(places[0], places[-1]) for places in by_share), key=lambda reach: reach.easiest.share_of_typical
    )
