"""How far a sensor's readings scatter by themselves: white noise and the steps of a coarse sensor."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lptn.basics.arrays import FloatArray
from lptn.logs.scatter import Scatter, off_their_neighbours, usual, white_noise
from lptn.simulate.bound_run import BoundRun

_MODEL_ERROR = 0.02  # of an excursion, beside the sensor's noise: what simple models of robots leave
LEAST_NOISE = 1e-3
"""K; a noise-free log must not weigh infinitely."""


PLAIN = 2.0
"""Times the mean square that noise leaves: a misfit that single readings show, so that something is missing."""


@dataclass(frozen=True)
class Noise:
    """The scatter of each node's readings, as the runs hold them.

    Args:
        white: standard deviation of white noise [K], shape (nodes,).
        step: step of a quantised sensor [K], 0 where it is fine, shape (nodes,).
        left: what means over several readings have left of that step [K], shape (nodes,); all of it by default.
    """

    white: FloatArray
    step: FloatArray
    left: FloatArray | None = None

    @property
    def floor(self) -> FloatArray:
        """The RMSE that a perfect model would show [K], shape (nodes,)."""
        left = self.step if self.left is None else self.left
        return np.asarray(np.maximum(np.hypot(self.white, left / np.sqrt(12.0)), LEAST_NOISE))


def estimate_noise(bound_runs: Sequence[BoundRun], nodes: Sequence[str]) -> Noise:
    """Noise of each node's sensor from the runs themselves.

    White noise is what readings are off the line between their neighbours, in the runs, or, where that is more, in the
    logs that they are of: read off lines between a log's readings, a run's share their noise, and seem to have less.
    What rounding to a sensor's steps adds, the step over √12, is not part of it. Of means over several readings noise
    and step follow from the readings' own noise and steps: what noise carries over the edges is not rounded any more.
    """
    white = np.zeros(len(nodes))
    step, left = np.zeros(len(nodes)), np.zeros(len(nodes))
    for row, node in enumerate(nodes):
        column, runs = f"temperature.{node}", [bound.run for bound in bound_runs]
        step[row] = max((run.resolution.get(column, 0.0) for run in runs), default=0.0)
        left[row] = step[row]
        if step[row] > 0 and all(run.averaged and column in run.scatter for run in runs):
            # Where the temperature stands, what is left may be more for a while: who asks for minutes has all of it.
            white[row], left[row] = _of_means(bound_runs, row, column)
            continue
        by_step: dict[float, list[FloatArray]] = {}
        for bound, run in zip(bound_runs, runs, strict=True):
            rounded_to = 0.0 if run.averaged else run.resolution.get(column, 0.0)
            by_step.setdefault(rounded_to, []).append(off_their_neighbours(run.time, bound.measured[row]))
        pooled = {rounded_to: np.concatenate(off) for rounded_to, off in by_step.items()}
        of_runs = [Scatter(white_noise(off, size), runs[0].step, off.size) for size, off in pooled.items()]
        of_logs = {run.source: run.scatter[column] for run in runs if column in run.scatter}  # pieces of a log share it
        white[row] = max(usual(scatters, runs[0].step) for scatters in (of_runs, of_logs.values()))
    return Noise(white, step, left)


def _of_means(bound_runs: Sequence[BoundRun], row: int, column: str) -> tuple[float, float]:
    """White noise of means of a coarse sensor's readings, and the step that they still seem to have [K].

    Of several logs what half of all readings have at most, both together.
    """
    parts = []
    for bound in bound_runs:
        run, measured = bound.run, bound.measured[row]
        noise, left = run.scatter[column].of_means(run.step, run.resolution.get(column, 0.0))
        parts.append(
            (float(np.hypot(noise, left / np.sqrt(12.0))), noise, left, np.count_nonzero(np.isfinite(measured)))
        )
    parts.sort()
    counts = np.cumsum([count for *_, count in parts])
    _, noise, left, _ = parts[int(np.searchsorted(counts, 0.5 * counts[-1]))]
    return noise, left


def balanced_sigma(bound_runs: Sequence[BoundRun], noise: Noise) -> FloatArray:
    """Standard deviations that weigh each node [K], shape (nodes,).

    Besides its noise, a node is allowed a model error of a share (`_MODEL_ERROR`) of the geometric mean of its own and
    the largest excursion: a joint that swings by 40 K neither silences one that swings by 5 K, nor the other way round.
    """
    excursion = np.zeros(len(noise.white))
    for row in range(len(excursion)):
        readings = np.concatenate([bound.measured[row][bound.counted[row]] for bound in bound_runs])
        excursion[row] = readings.std() if readings.size else 0.0
    return np.asarray(np.hypot(noise.floor, _MODEL_ERROR * np.sqrt(excursion * excursion.max(initial=0.0))))
