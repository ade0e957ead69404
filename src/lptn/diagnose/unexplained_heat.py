"""Heat that a fitted model lacks, at each node over time, with a band.

The run is cut into blocks and taken linear about its fitted trajectory, with an unknown heat at each measured node
that wanders at random. Given all readings of the run, a Kalman filter and smoother give that heat and its standard
deviation; how fast it wanders is what makes the readings likeliest. Heat is positive where the model lacks heat, that
is where it predicts too cold (error = predicted − measured < 0).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from math import ceil
from statistics import NormalDist
from typing import NamedTuple

import numpy as np

from lptn.basics.arrays import FloatArray, IntArray
from lptn.basics.processes import one_blas_thread
from lptn.basics.words import short_size
from lptn.diagnose.fit_statistics import BLOCK, noise_of_means
from lptn.identify.fitting import Fit
from lptn.identify.noise import LEAST_NOISE
from lptn.logs.channels import spans
from lptn.logs.resampling import means_of_blocks
from lptn.logs.run import Run
from lptn.simulate.dynamics import stepper, zero_order_hold
from lptn.simulate.readings import readings_of
from lptn.simulate.simulation import WINDOW, simulate


@dataclass(frozen=True, repr=False)
class UnexplainedHeat:
    """Heat that one run of a fit needs in addition to its model.

    Where and when it is large is worth more than how large: the fitted parameters absorb part of it.

    Args:
        run: name of the run.
        time: middle of each block in the log's clock [s], shape (n,).
        nodes: the measured nodes.
        heat: W, shape (nodes, n).
        band: half-width of the 95 % band [W], shape (nodes, n).
        seconds: length of a block.
        origin: time from which figures and sentences count, in the log's clock [s].
    """

    run: str
    time: FloatArray
    nodes: tuple[str, ...]
    heat: FloatArray
    band: FloatArray
    seconds: float
    origin: float = 0.0

    def __repr__(self) -> str:
        most = float(np.abs(self.heat).max(initial=0.0))
        blocks = f"{self.time.size} blocks of {self.seconds:g} s"
        return f"<UnexplainedHeat of {self.run}: {blocks}, up to {most:.3g} W at {', '.join(self.nodes)}>"

    @property
    def sure_band(self) -> FloatArray:
        """Half-width of the band that holds zero everywhere in 95 % of runs without such heat [W], (nodes, n).

        It is the 95 % band widened for all nodes and minutes that are looked at: what decides whether heat is sure.
        """
        apart = max(1.0, self.time.size * self.seconds / BLOCK)  # what lies closer counts as one
        comparisons = len(self.nodes) * apart
        return np.asarray(-NormalDist().inv_cdf(0.025 / comparisons) / WIDE * self.band)

    @property
    def clear(self) -> FloatArray:
        """By how much the heat's size exceeds zero [W] with 95 % confidence over all nodes and minutes, (nodes, n)."""
        return np.asarray(np.maximum(np.abs(self.heat) - self.sure_band, 0.0))


@dataclass(frozen=True)
class HeatPeak:
    """One interval in which heat at one node is significantly unexplained.

    Args:
        run: name of the run.
        node: the node.
        start: in the log's clock [s].
        stop: in the log's clock [s].
        heat: mean from start to stop [W]; negative where the model has too much.
        band: mean half-width of the 95 % band [W].
        clear: by how much the heat exceeds zero with 95 % confidence over all nodes and minutes, at most [W].
        origin: time from which figures and sentences count, in the log's clock [s].
    """

    run: str
    node: str
    start: float
    stop: float
    heat: float
    band: float
    clear: float = 0.0
    origin: float = 0.0

    @property
    def elapsed(self) -> tuple[float, float]:
        """Start and stop, counted from `origin` [s]."""
        return self.start - self.origin, self.stop - self.origin

    def text(self) -> str:
        """Such as `at FR_calf from 1200 to 1500 s, about 6 W (3 to 13 W)`."""
        ends = f"{short_size(self.heat - self.band)} to {short_size(self.heat + self.band)} W"
        return f"{self.place}, about {short_size(self.heat)} W ({ends})"

    @property
    def place(self) -> str:
        """Such as `at FR_calf from 1200 to 1500 s`."""
        start, stop = self.elapsed
        return f"at {self.node} from {start:.0f} to {stop:.0f} s"

    def as_json(self) -> dict[str, object]:
        """The interval as other tools read it; times in s of the log's clock."""
        return {"run": self.run, "node": self.node, "from": self.start, "to": self.stop, "watts": self.heat}


WIDE = NormalDist().inv_cdf(0.975)  # standard deviations on either side of a 95 % band


def unexplained_heat(fit: Fit) -> list[UnexplainedHeat]:
    """The heat that each fitted run asks for beyond the model, at every measured node."""
    return WanderingHeat(fit).unexplained


class WanderingHeat:
    """A fitted model, linear about its own trajectories, and heat at every measured node that wanders at random.

    It wanders as fast as makes the readings of all runs likeliest; states and free parameters may lie off the fit.
    Given all readings of a run this is a linear smoothing problem. Time grows with the run, memory is bounded.

    Args:
        fit: the fitted model, with the readings that count.
        rates: shares of the heat scale that heat may wander in a minute, of which the readings choose: from next to
            none to all.
    """

    @one_blas_thread
    def __init__(
        self, fit: Fit, rates: Sequence[float] = (0.001, 0.003, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0)
    ) -> None:
        self._rates = rates
        self.fit, self.runs = fit, [blocks(fit, number) for number in range(len(fit.problem.bound_runs))]
        self.scale = float(np.sqrt(np.mean([run.scale**2 for run in self.runs])))
        """What heat is large [W], as in each run."""

    @cached_property
    @one_blas_thread
    def walks(self) -> list[float]:
        """How fast the heat may wander, standard deviation after one second [W]: slower ones, the likeliest last."""

        @cache
        def density(number: int) -> float:
            return sum(forward(run, self.prior(run), walks[number])[0] for run in self.runs)

        # It has one peak, which is climbed to from the third, near which most have it.
        walks, top = [share * self.scale / np.sqrt(60.0) for share in self._rates], 2
        while (best := max((k for k in (top, top - 1, top + 1) if 0 <= k < len(walks)), key=density)) != top:
            top = best
        return walks[: top + 1]

    @cached_property
    @one_blas_thread
    def unexplained(self) -> list[UnexplainedHeat]:
        """The heat of each run."""
        told = []
        for run, bound in zip(self.runs, self.fit.problem.bound_runs, strict=True):
            heat, spread, *_ = smoothed(run, self.prior(run), self.walks[-1])
            nodes = tuple(self.fit.model.nodes[row] for row in run.rows)
            about = WIDE * spread, run.seconds, bound.run.origin
            told.append(UnexplainedHeat(bound.run.name, run.time, nodes, heat, *about))
        return told

    def prior(
        self,
        run: Blocks,
        *,
        open_parameters: bool = False,
        start: float = 5.0,
        biased: float = 3.0,
        farthest: float = 3.0,
    ) -> FloatArray:
        """Covariance of the states, the heats, and the parameters, which are off together as their standard errors say.

        The errors grow with what the model lacks. Were each parameter free to move for itself, a steady heat that
        nobody needs could be balanced by resistances and capacitances far from the fitted ones. With `open_parameters`
        it may: beside a curve that stands for the heat they go to where they belong.

        Of the hidden bursts of `tests/diagnose/hidden_heat.py` the bands hold zero in 80 to 86 % of the quiet time if
        parameters are `biased` by 1 standard error, above 93 % with 3 and 5; in 84 % at worst if `farthest` is 1.5,
        94 % with 2, all of it with 3 to 5.

        Args:
            run: the linear model of a run.
            open_parameters: whether each parameter is free to move for itself.
            start: K, one standard deviation: how far a state may start from the fit. It is for hidden ones; readings
                hold a measured node, of which no band changed by a thousandth with 1.5 K.
            biased: standard errors by which missing heat may have biased the fitted parameters.
            farthest: of a logarithm, a factor of twenty: how far off parameters may be of which together the readings
                tell nothing.
        """
        fit, states, nodes = self.fit, len(self.fit.model.states), len(run.rows)
        deviations = np.full(states + nodes, start)
        deviations[states:] = self.scale
        known = slice(len(deviations), run.top.shape[2])
        covariance = np.zeros((known.stop, known.stop))
        covariance[: known.start, : known.start] = np.diag(deviations**2)
        sizes, directions = np.linalg.eigh(biased**2 * fit.uncertainty.covariance)
        sizes = np.clip(np.inf if open_parameters else sizes, 0.0, farthest**2)
        covariance[known, known] = (directions * sizes) @ directions.T
        return covariance


def stretches(runs: Sequence[UnexplainedHeat]) -> list[HeatPeak]:
    """All intervals in which a node's heat leaves its band, somewhere significantly; the most significant first."""
    found = []
    for run in runs:
        for row, node in enumerate(run.nodes):
            heat, band, clear = run.heat[row], run.band[row], run.clear[row]
            for first, stop in [*spans(heat > band), *spans(-heat > band)]:
                if (most := float(clear[first:stop].max())) > 0:
                    start, end = float(run.time[first]), float(run.time[stop - 1])
                    ends, means = (start - run.seconds / 2, end + run.seconds / 2), (heat[first:stop], band[first:stop])
                    mean, width = (float(values.mean()) for values in means)
                    found.append(HeatPeak(run.run, node, *ends, mean, width, most, run.origin))
    return sorted(found, key=lambda peak: -peak.clear)


def largest(runs: Sequence[UnexplainedHeat]) -> HeatPeak | None:
    """Where and when the heat exceeds zero most surely; `None` where none is beyond its band."""
    return next(iter(stretches(runs)), None)


# --- The linear model: a fitted run in blocks of time, with heat at each measured node as an input --


@dataclass(frozen=True)
class Blocks:
    """Deviations d from a fitted run: of the S states [K], the heat that M nodes lack [W], and F free parameters.

    Over a block the states' part becomes `top @ d`; the heat wanders, the parameters stay. D = S + M + F.

    Args:
        time: the middle of each block in the log's clock [s], shape (n,).
        seconds: length of a block.
        rows: the model's nodes that are measured, shape (M,).
        top: shape (n, S, D).
        by: derivative of each measured node's mean reading in a block by d at its start, shape (n, M, D).
        error: predicted − measured, mean of each block [K], NaN where nothing counts, shape (n, M).
        variance: of these means by the sensors' noise [K²], shape (n, M).
        scale: what heat is large [W]: that which the nodes take up as they warm, or that would hold the residual.
    """

    time: FloatArray
    seconds: float
    rows: IntArray
    top: FloatArray
    by: FloatArray
    error: FloatArray
    variance: FloatArray
    scale: float


def blocks(fit: Fit, number: int, seconds: float = 10.0, most: int = 1200) -> Blocks:
    """One of a fit's runs, from its first reading that counts to its last.

    Args:
        fit: the fitted model.
        number: of the run, in the order of the fit.
        seconds: of a block; faster changes of heat can't be distinguished from noise, since a joint takes minutes to
            warm.
        most: blocks; a longer run gets longer ones, so that 10 h need no more memory than 3 h.
    """
    bound, step = fit.problem.bound_runs[number], fit.problem.bound_runs[number].run.step
    counted = np.flatnonzero(bound.counted.any(axis=0))
    first, stop = int(counted[0]), int(counted[-1]) + 1
    size = max(1, round(seconds / step), ceil((stop - first) / most))
    size = min(size, stop - first)
    count = (stop - first) // size
    rows = np.flatnonzero(bound.counted.any(axis=1))
    window = slice(first, first + count * size)
    values = fit.model.in_run(bound.run.name, fit.point.values)
    path = simulate(fit.model, bound, fit.point.values, fit.point.starts[number]).states
    capacities = values[[fit.model.network.capacities[fit.model.nodes[row]] for row in rows]]
    states, slope = len(fit.model.states), fit.problem.slope(fit.point.values)
    linearisation = stepper(fit.model, states, fit.problem.free).linearisation
    long, pieces = max(1, WINDOW // size) * size, []
    for at in range(window.start, window.stop, long):  # window by window, to save memory
        x, u = (series[:, at : min(at + long, window.stop)] for series in (path, bound.inputs))
        of_rates, of_readings = linearisation.rates(x, u, values), linearisation.readings(x, values)
        both = of_rates[:, :, :states], of_rates[:, :, states:], of_readings[:, :, :states], of_readings[:, :, states:]
        pieces.append([one.reshape(-1, size, *one.shape[1:]).mean(axis=1) for one in both])
    a, b, c, e = (np.concatenate(derivatives) for derivatives in zip(*pieces, strict=True))
    b, e = b * slope, e * slope
    heated = np.zeros((a.shape[1], len(rows)))
    heated[rows, np.arange(len(rows))] = 1.0 / capacities
    transition, integral = zero_order_hold(a, step * size)
    top = np.concatenate([transition, integral @ heated, integral @ b], axis=2)
    # The mean reading of a block lies in its middle; of the readings at steps' starts half a step earlier.
    late = 0.5 if bound.run.averaged else 0.5 * (size - 1) / size
    within = late * top
    within[:, :, : a.shape[1]] += (1.0 - late) * np.eye(a.shape[1])
    by = c[:, rows] @ within
    by[:, :, top.shape[2] - b.shape[2] :] += e[:, rows]
    error = fit.predictions[number].error[rows, window]
    counts = np.isfinite(error).reshape(len(rows), count, size).sum(axis=2)
    predicted = readings_of(fit.model, path[:, window], values)[rows]
    stored = capacities[:, None] * np.diff(path[:, window.start : window.stop + 1 : size][rows]) / (step * size)
    conductance = capacities * np.abs(np.einsum("kii->ki", a)[:, rows]).mean(axis=0)
    means = means_of_blocks(error, size).T
    return Blocks(
        bound.run.time[first] + step * size * (np.arange(count) + 0.5),
        step * size,
        rows,
        top,
        by,
        means,
        _variance(predicted, counts, fit, rows, size).T,
        float(np.sqrt(np.mean(stored**2) + np.nanmean((means * conductance) ** 2))),
    )


def means_in_blocks(values: FloatArray, run: Run, time: FloatArray, seconds: float) -> FloatArray:
    """Means of a run's series, shape (..., steps), over its blocks of so many seconds with these middles, (..., n)."""
    size, first = round(seconds / run.step), int(np.argmin(np.abs(run.time - (time[0] - seconds / 2))))
    return means_of_blocks(values[..., first : first + size * len(time)], size)


def _variance(
    predicted: FloatArray, counts: FloatArray, fit: Fit, rows: IntArray, size: int, slow: int = 30
) -> FloatArray:
    """Variance of independent errors of each block's mean reading that hide a slow heat as well as a sensor does [K²].

    A coarse sensor is off to one side until the temperature crosses a step, so errors of neighbouring blocks are one
    error. How much of it stays for minutes is worked out by rounding the model's own readings.

    Args:
        predicted: readings of the fitted model, shape (M, steps).
        counts: readings that each block has, shape (M, n).
        fit: has the sensors' noise.
        rows: of the measured nodes, shape (M,).
        size: readings of a whole block.
        slow: blocks; the share of a rounding error that lasts so long can't be distinguished from heat.

    Returns:
        Shape (M, n).
    """
    variance = np.empty(counts.shape)
    for row, number in enumerate(rows):
        errors = noise_of_means(predicted[row], fit.noise.white[number], fit.noise.step[number], size, logs=20)
        group = max(1, min(slow, errors.shape[1] // 4))
        least = max(np.var(errors), group * np.var(means_of_blocks(errors, group)), LEAST_NOISE**2)
        variance[row] = least * size / np.maximum(counts[row], 1)
    return variance


# --- Fixed-interval smoothing: forward filter, backward adjoint, and the likelihood ----------------


class Smoothed(NamedTuple):
    """Each node's heat given all readings, and how it changes once K other heats are known.

    Args:
        heat: W, shape (M, n).
        spread: its standard deviation [W], shape (M, n).
        taken: what is to be taken off the heat where the known heats are there [W], shape (M, n, K).
        white: errors of the prediction from block to block, measured − predicted and whitened, the readings' first and
            then what each known heat takes off them, shape (readings, 1 + K).
        density: logarithm of the readings' probability density, as `forward` gives it.
    """

    heat: FloatArray
    spread: FloatArray
    taken: FloatArray
    white: FloatArray
    density: float


def smoothed(run: Blocks, prior: FloatArray, walk: float, known: FloatArray | None = None) -> Smoothed:
    """The heat that a run asks for.

    Source: [Rauch1965], in the form of [Bierman1973], which inverts no covariance of the states: parameters that
    stay the same make that singular.

    Args:
        run: the linear model of a run.
        prior: covariance, before the first reading, of states [K], heats [W] and parameters' coordinates, shape (D, D).
        walk: by how much each heat wanders, standard deviation after one second [W], grows with √time.
        known: heat into each measured node in each block [W], K of them one beside the other, shape (n, M, K).
    """
    steps: list[tuple[FloatArray, ...]] = []
    density, white = forward(run, prior, walk, known, steps)
    states, nodes = run.top.shape[1], len(run.rows)
    size, count = run.top.shape[2], white.shape[1]
    heat, spread = np.empty((nodes, len(steps), count)), np.empty((nodes, len(steps)))
    back, curve = np.zeros((size, count)), np.zeros((size, size))
    heats = slice(states, states + nodes)
    for k in range(len(steps) - 1, -1, -1):
        transition = np.eye(size)
        transition[:states] = run.top[k]
        back, curve = transition.T @ back, transition.T @ curve @ transition
        filtered, covariance, by, gain, precision, innovation = steps[k]
        rest, weighed = np.eye(size) - gain @ by, by.T @ precision
        back = rest.T @ back - weighed @ innovation
        curve = rest.T @ curve @ rest + weighed @ by
        heat[:, k] = filtered - covariance @ back
        less = np.einsum("ij,jk,ik->i", covariance, curve, covariance)
        spread[:, k] = np.sqrt(np.maximum(np.diag(covariance[:, heats]) - less, 0.0))
    return Smoothed(heat[:, :, 0], spread, -heat[:, :, 1:], white, density)


def forward(
    run: Blocks,
    prior: FloatArray,
    walk: float,
    known: FloatArray | None = None,
    steps: list[tuple[FloatArray, ...]] | None = None,
) -> tuple[float, FloatArray]:
    """Logarithm of the readings' probability density, by prediction errors ([Kristensen2004]), and these, whitened.

    Arguments and errors as for `smoothed`. Where a list `steps` is given it keeps of each block, before its readings
    are taken in, what smoothing needs: the heats (M, 1 + K), their rows of the covariance (M, D), and of the nodes that
    are read the derivative (seen, D), gain (D, seen), precision of the innovation (seen, seen) and innovation
    (seen, 1 + K). Its first column is of the readings, each other one of a known heat without readings: what it does is
    linear.
    """
    known = np.zeros((len(run.time), len(run.rows), 0)) if known is None else known
    states, nodes = run.top.shape[1], len(run.rows)
    heats = slice(states, states + nodes)
    d, p, density = np.zeros((run.top.shape[2], 1 + known.shape[2])), prior.copy(), 0.0
    gained, white = walk**2 * run.seconds, []
    for k in range(len(run.time)):
        seen = np.isfinite(run.error[k])
        by = run.by[k][seen]
        crossed = p @ by.T
        root = np.linalg.cholesky(by @ crossed + np.diag(run.variance[k][seen]))
        inverse = np.linalg.inv(root)
        precision = inverse.T @ inverse
        driven = d.copy()
        driven[heats, 1:] += known[k]
        innovation = -by @ driven  # measured − predicted, as filters have it
        innovation[:, 0] -= run.error[k][seen]
        gain = crossed @ precision
        if steps is not None:
            steps.append((d[heats].copy(), p[heats].copy(), by, gain, precision, innovation))
        white.append(inverse @ innovation)
        density -= 0.5 * float(np.sum(white[-1][:, 0] ** 2)) + float(np.log(np.diag(root)).sum())
        d, driven = d + gain @ innovation, driven + gain @ innovation
        p = p - gain @ crossed.T
        mixed = run.top[k] @ p  # heats and parameters stay
        p = 0.5 * (p + p.T)
        p[:states], p[:, :states] = mixed, mixed.T
        p[:states, :states] = mixed @ run.top[k].T
        d[:states] = run.top[k] @ driven
        np.einsum("ii->i", p)[heats] += gained
    return density, np.concatenate(white)
