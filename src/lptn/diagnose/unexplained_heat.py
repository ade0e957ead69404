"""Heat that a fitted model lacks, at each node over time, with a band: where and when the misfit arises."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import norm

from lptn.arrays import FloatArray
from lptn.diagnose.unexplained_heat_blocks import Blocks, blocks
from lptn.diagnose.unexplained_heat_smoother import Prior, likelihood, smoothed
from lptn.identify import Fit
from lptn.threads import one_blas_thread

_GRID = (0.001, 0.003, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0)  # of the heat scale, wandered in a minute
_START, _HIDDEN_START = 1.5, 5.0  # K; how far a measured node, or any other state, may start from the fit
_PARAMETER = 0.7  # of a logarithm, a factor of two: how far lacking heat may have led the fitted parameters astray
_WIDE = 1.96  # standard deviations on either side of a 95 % band
_APART = 60.0  # s; estimates that lie closer are as good as one
_HALF = 0.5  # a stretch reaches as far as the heat stays above so much of its peak


@dataclass(frozen=True)
class UnexplainedHeat:
    """Heat that one run of a fit asks for beyond its model.

    Where and when it is large is worth more than how large: the fitted parameters absorb part of it.

    Args:
        run: name of the run.
        time: middle of each block in the log's clock [s], shape (n,).
        nodes: the measured nodes.
        heat: W, shape (nodes, n).
        band: half-width of the 95 % band [W], shape (nodes, n).
        seconds: length of a block.
    """

    run: str
    time: FloatArray
    nodes: tuple[str, ...]
    heat: FloatArray
    band: FloatArray
    seconds: float

    @property
    def clear(self) -> FloatArray:
        """By how much the heat's size surely exceeds zero [W], all nodes and minutes at once, shape (nodes, n)."""
        asked = len(self.nodes) * max(1.0, self.time.size * self.seconds / _APART)
        sure = float(norm.isf(0.025 / asked)) / _WIDE
        return np.asarray(np.maximum(np.abs(self.heat) - sure * self.band, 0.0))


@dataclass(frozen=True)
class Stretch:
    """Where and when unexplained heat is largest.

    Args:
        run: name of the run.
        node: the node.
        start: of the stretch in the log's clock [s].
        stop: its end [s].
        heat: mean over the stretch [W]; negative where the model has too much.
        band: mean half-width of the 95 % band [W].
    """

    run: str
    node: str
    start: float
    stop: float
    heat: float
    band: float

    def text(self) -> str:
        """Such as `at FR_calf from 1200 to 1500 s, about 6 W (3 to 13 W)`."""
        ends = f"{_rounded(self.heat - self.band)} to {_rounded(self.heat + self.band)} W"
        return f"{self.place}, about {_rounded(self.heat)} W ({ends})"

    @property
    def place(self) -> str:
        """Such as `at FR_calf from 1200 to 1500 s`."""
        return f"at {self.node} from {self.start:.0f} to {self.stop:.0f} s"


@one_blas_thread
def unexplained_heat(fit: Fit) -> list[UnexplainedHeat]:
    """The heat that each fitted run asks for beyond the model, at every measured node.

    The heat wanders at random, as fast at each node as makes the readings of all runs likeliest; states and free
    parameters may lie off the fit. Given all readings of a run this is a linear smoothing problem, since the model is
    taken linear about its own fitted trajectory. Time grows with the length of the run, memory is bounded.

    Args:
        fit: the fitted model, with the readings that count.
    """
    runs = [blocks(fit, number) for number in range(len(fit.problem.drives))]
    scale = _heat_scale(runs)
    walk = max(
        (share * scale / np.sqrt(60.0) for share in _GRID),
        key=lambda walk: sum(likelihood(run, _prior(fit, run, scale, walk)) for run in runs),
    )
    found = []
    for run, driven in zip(runs, fit.problem.drives, strict=True):
        heat, spread = smoothed(run, _prior(fit, run, scale, walk))
        nodes = tuple(fit.model.nodes[row] for row in run.rows)
        found.append(UnexplainedHeat(driven.run.name, run.time, nodes, heat, _WIDE * spread, run.seconds))
    return found


def largest(found: Sequence[UnexplainedHeat]) -> Stretch | None:
    """Where and when the heat exceeds zero most surely; `None` where none is beyond its band, all asked at once."""
    best = max(found, key=lambda each: float(each.clear.max(initial=0.0)), default=None)
    if best is None or not best.clear.any():
        return None
    row, peak = (int(place) for place in np.unravel_index(int(best.clear.argmax()), best.clear.shape))
    heat = best.heat[row] * np.sign(best.heat[row, peak])
    above = heat >= _HALF * heat[peak]
    first = peak - int(np.argmin(np.append(above[: peak + 1][::-1], False))) + 1
    stop = peak + int(np.argmin(np.append(above[peak:], False)))
    half = best.seconds / 2
    return Stretch(
        best.run,
        best.nodes[row],
        float(best.time[first] - half),
        float(best.time[stop - 1] + half),
        float(best.heat[row, first:stop].mean()),
        float(best.band[row, first:stop].mean()),
    )


def _heat_scale(runs: Sequence[Blocks]) -> float:
    """What heat is large [W]: that which the nodes take up as they warm, or that would hold the residual."""
    stored = np.concatenate([run.storage.ravel() for run in runs])
    holding = np.concatenate([(run.residual * run.conductance).ravel() for run in runs])
    return float(np.sqrt(np.mean(stored**2) + np.nanmean(holding**2)))


def _prior(fit: Fit, run: Blocks, scale: float, walk: float) -> Prior:
    states, nodes = len(fit.model.states), len(run.rows)
    deviations = np.full(run.top.shape[2], _PARAMETER)
    deviations[:states] = _HIDDEN_START
    deviations[run.rows] = _START
    deviations[states : states + nodes] = scale
    return Prior(deviations, walk)


def _rounded(value: float) -> str:
    return f"{value:.2g}" if abs(value) < 10 else f"{value:.0f}"
