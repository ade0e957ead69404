"""A fitted run in blocks of time, linear about its own trajectory, with heat at each measured node as an input."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import ceil

import numpy as np
from scipy.linalg import expm

from lptn.arrays import FloatArray, IntArray
from lptn.identify import Fit
from lptn.simulate import simulate
from lptn.stepping import stepper

_BLOCK = 10.0  # s; heat that comes and goes faster is not told apart from noise
_MOST_BLOCKS = 1200  # a longer run gets longer blocks, so that 10 h need no more memory than 3 h
_WINDOW = 2048  # steps whose derivatives are held at once
_FAR = 4.0  # times its usual value; a parameter that ends further off was led there
_PHASES, _LASTING = 16, 300.0  # s; what of a rounding error lasts so long can't be told from heat
_LEAST = 1e-3  # K; a noise-free log must not weigh infinitely


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
        residual: measured minus fitted, mean of each block [K], NaN where nothing counts, shape (n, M).
        variance: of these means by the sensors' noise [K²], shape (n, M).
        storage: heat that each measured node takes up in the fitted run [W], shape (n, M).
        conductance: of each measured node to all around it, mean over the run [W/K], shape (M,).
    """

    time: FloatArray
    seconds: float
    rows: IntArray
    top: FloatArray
    by: FloatArray
    residual: FloatArray
    variance: FloatArray
    storage: FloatArray
    conductance: FloatArray


def blocks(fit: Fit, number: int) -> Blocks:
    """One of a fit's runs, from its first reading that counts to its last.

    Args:
        fit: the fitted model.
        number: of the run, in the order of the fit.
    """
    driven, step = fit.problem.drives[number], fit.problem.drives[number].run.step
    counted = np.flatnonzero(driven.counted.any(axis=0))
    first, stop = int(counted[0]), int(counted[-1]) + 1
    size = max(1, round(_BLOCK / step), ceil((stop - first) / _MOST_BLOCKS))
    size = min(size, stop - first)
    count = (stop - first) // size
    rows = np.flatnonzero(driven.counted.any(axis=1))
    window = slice(first, first + count * size)
    values = fit.model.in_run(driven.run.name, fit.point.values)
    path = simulate(fit.model, driven, fit.point.values, fit.point.starts[number]).states
    capacities = values[[fit.model.network.capacities[fit.model.nodes[row]] for row in rows]]
    pieces = [_mean_derivatives(fit, path[:, w], driven.inputs[:, w], values, size) for w in _parts(window, size)]
    a, b, c, e = (np.concatenate(each) for each in zip(*pieces, strict=True))
    top = _exact(a, b, rows, capacities, step * size)
    error = np.where(driven.counted, fit.residuals[number], np.nan)[rows, window]
    counts = np.isfinite(error).reshape(len(rows), count, size).sum(axis=2)
    predicted = fit.model.readings_of(path[:, window], values)[rows]
    ends = path[:, window.start : window.stop + 1 : size][rows]
    return Blocks(
        driven.run.time[first] + step * size * (np.arange(count) + 0.5),
        step * size,
        rows,
        top,
        _by_start(top, c[:, rows], e[:, rows], 0.5 if driven.run.averaged else 0.5 * (size - 1) / size),
        _means(error, size).T,
        _variance(predicted, counts, fit, rows, size).T,
        (capacities[:, None] * np.diff(ends) / (step * size)).T,
        capacities * np.abs(np.einsum("kii->ki", a)[:, rows]).mean(axis=0),
    )


def _parts(window: slice, size: int) -> Iterator[slice]:
    """A window cut where blocks end, in pieces whose derivatives memory can hold."""
    long = max(1, _WINDOW // size) * size
    for start in range(window.start, window.stop, long):
        yield slice(start, min(start + long, window.stop))


def _mean_derivatives(
    fit: Fit, x: FloatArray, u: FloatArray, values: FloatArray, size: int
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Derivatives of rates and of readings, by states and by the search's coordinates, means over each block."""
    jacobians = stepper(fit.model, len(fit.model.states), fit.problem.free).jacobians
    slope = _slopes(fit)
    rates_by, rates_moved = jacobians.rates(x, u, values)
    read_by, read_moved = jacobians.readings(x, values)
    found = (rates_by, rates_moved * slope, read_by, read_moved * slope)
    a, b, c, e = (each.reshape(-1, size, *each.shape[1:]).mean(axis=1) for each in found)
    return a, b, c, e


def _slopes(fit: Fit) -> FloatArray:
    """What a factor of e changes of each free parameter, of one far from its usual value a share of that, (F,).

    Hidden heat may drive a fitted resistance to infinity, where no factor on it moves any temperature. Heat flows
    by its inverse, so there that is what changes.
    """
    values, found = fit.point.values, fit.problem.slope(fit.point.values)
    for place, index in enumerate(fit.problem.free):
        declared = fit.model.unknowns[index].declared
        usual = abs(declared.typical)
        if declared.unit.endswith("K/W") and declared.off is None and usual > 0:
            found[place] = max(found[place], values[index] ** 2 / (_FAR * usual))
        else:
            found[place] = max(found[place], usual / _FAR)
    return found


def _exact(a: FloatArray, b: FloatArray, rows: IntArray, capacities: FloatArray, seconds: float) -> FloatArray:
    """States after a block by states, heats and parameters before it: the exact hold, shape (n, S, S + M + F)."""
    n, states = a.shape[0], a.shape[1]
    heated = np.zeros((states, len(rows)))
    heated[rows, np.arange(len(rows))] = 1.0 / capacities
    whole = np.zeros((n, 2 * states, 2 * states))
    whole[:, :states, :states] = a * seconds
    whole[:, :states, states:] = np.eye(states) * seconds
    moved = expm(whole)[:, :states]
    held = moved[:, :, states:]
    return np.concatenate([moved[:, :, :states], held @ heated, held @ b], axis=2)


def _by_start(top: FloatArray, c: FloatArray, e: FloatArray, late: float) -> FloatArray:
    """Derivative of a block's mean readings by the deviations at its start.

    Args:
        late: how far into the block its mean reading lies, as a share of the block.
    """
    within = late * top
    states = top.shape[1]
    within[:, :, :states] += (1.0 - late) * np.eye(states)
    by = c @ within
    if e.shape[2]:
        by[:, :, -e.shape[2] :] += e
    return np.asarray(by)


def _means(error: FloatArray, size: int) -> FloatArray:
    """Mean of each block, NaN without any reading, along the last axis."""
    split = error.reshape(*error.shape[:-1], -1, size)
    known = np.isfinite(split).sum(axis=-1)
    total = np.where(np.isfinite(split), split, 0.0).sum(axis=-1)
    return np.asarray(np.where(known > 0, total / np.maximum(known, 1), np.nan))


def _variance(predicted: FloatArray, counts: FloatArray, fit: Fit, rows: IntArray, size: int) -> FloatArray:
    """Variance of each block's mean reading by the sensors' noise [K²], shape (M, n).

    Args:
        predicted: readings of the fitted model, shape (M, steps).
        counts: readings that each block has, shape (M, n).
    """
    white, step = fit.noise.white[rows], fit.noise.step[rows]
    found = np.where(step > 0, white, fit.noise.floor[rows])[:, None] ** 2 / np.maximum(counts, 1)
    for row in np.flatnonzero(step > 0):
        found[row] += _rounding(predicted[row], float(white[row]), float(step[row]), size)
    return np.asarray(np.maximum(found, _LEAST**2))


def _rounding(predicted: FloatArray, white: float, step: float, size: int) -> float:
    """Variance of independent errors of blocks that hide a slow heat as well as rounding does [K²].

    A coarse sensor errs the same way until the temperature has crossed a step, so errors of neighbouring blocks
    are one error. How much of it lasts for minutes is found by rounding the model's own readings, at many
    phases of the sensor's steps.
    """
    rng = np.random.default_rng(0)
    phases = step * (np.arange(_PHASES)[:, None] + 0.5) / _PHASES
    true = predicted + phases
    errors = _means(np.round((true + rng.normal(0.0, white, true.shape)) / step) * step - true, size)
    group = max(1, min(round(_LASTING / _BLOCK), errors.shape[1] // 4))
    lasting = _means(errors[:, : errors.shape[1] // group * group], group)
    return float(max(np.var(errors), group * np.var(lasting)))
