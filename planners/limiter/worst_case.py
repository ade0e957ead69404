"""The hottest that a drive's simple limiter lets a motor become, in closed form.

A limiter sees one number y = k * v of the history of the heat inputs v, between 0 and V, and keeps y below a level: the
accumulator of i²t, where k = exp(-t/τ)/τ and v = i², or the reading of one thermistor. How far can a place rise,
x = g * v, for any history that it admits? That is a linear program, and each measure μ ≥ 0 of its dual gives a bound,

    x ≤ level ∫ dμ + V ∫ max(0, g − k * μ) dt.

For i²t, k * μ is any function m ≥ 0 for which m exp(t/τ) never falls, and ∫ dμ = ∫ m dt. Without a peak current the
least m that is nowhere below g is the best, m(t) = max over s ≤ t of g(s) exp((s − t)/τ), and the bound is reached.
With one, g may stay above m for the first seconds, in which a burst can't heat more than V allows. For a thermistor
a multiple of Dirac's delta is taken for μ, so that the bound is one on the difference of two temperatures.

The network is the model made linear where it is hottest, with rates that are nowhere less: copper's resistance is
that at the limit, convection and radiation are tangents, and what still lies above them adds to the heat.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import expm
from scipy.optimize import linprog
from scipy.stats import qmc

from lptn.basics.arrays import FloatArray
from lptn.basics.errors import InputError

from ..heating import Heating

_FIRST, _LAST = 0.05, 40.0  # of the fastest and of the slowest time constant: the responses' first and last instants
_PARTS = 24  # steps each time that the time doubles; trapezoids are then too large by 1e-4 at most
_SKIPS, _CONSTANTS = 24, 40  # that are tried of bursts and of τ
SHARES = np.geomspace(0.2, 5, 15)
"""Multiples of a reading that are tried in a bound."""
_POINTS = 256  # between cold and hot at which the linear rates are compared with the model's
_STEEP = 50.0  # exp of more is as good as infinite


@dataclass(frozen=True)
class Responses:
    """A linear network whose rates are nowhere less than the model's, up to the temperatures where it touches them.

    Args:
        t: instants [s], from 0 on, shape (n,).
        rest: temperatures of the states without current [degC].
        heated: rise of the states after an impulse of each joint's squared current [K/(A² s)], (n, states, joints).
        missing: fall after an impulse of what the model's rates lack of the network's at most [K/s], (n, states, k).
    """

    t: FloatArray
    rest: FloatArray
    heated: FloatArray
    missing: FloatArray


def responses(heat: Heating, p: FloatArray, d: FloatArray, hot: FloatArray, squares: FloatArray) -> Responses:
    """The network that touches a model at its hottest.

    Args:
        heat: the model, of requested currents.
        p: parameters.
        d: conditions.
        hot: states [degC] that are not exceeded.
        squares: of the joints' currents [A²], about those held for long.

    Raises:
        InputError: a node without any way for its heat to the surroundings.
    """
    rates, at, model = heat.rate_function(), heat.function(), heat.model
    kept = np.flatnonzero(model.rises == 0)  # a clock, as of a drift, stands still: it is as warm as its node
    spread = (np.where(model.rises == 0, np.arange(len(hot)), model.owners)[:, None] == kept).astype(float)
    hot = spread @ hot[kept]
    slope = np.asarray(at(hot, np.zeros_like(squares), d, p)[1].full()).T[kept] @ spread
    gain = np.asarray(at(hot, squares, d, p)[2].full()).T[kept]
    level = np.asarray(rates(hot, squares, d, p).full()).ravel()[kept] - gain @ squares
    speeds = -np.linalg.eigvals(slope).real
    if speeds.min() < 1e-9 * speeds.max():
        raise InputError(
            model.network.origin, "links", "heat that never leaves at the limits", "links to the surroundings"
        )
    air = [value for name, value in zip(heat.conditions, d, strict=True) if name.startswith("temperature.")]
    cool = np.minimum(min(air, default=25.0), hot[kept])
    x = cool + (hot[kept] - cool) * qmc.Sobol(len(kept), seed=1).random(_POINTS)
    given = (np.tile(each[:, None], _POINTS) for each in (np.zeros_like(squares), d, p))
    seen = np.asarray(rates.map(_POINTS)(spread @ x.T, *given).full())[kept].T
    below = level + (x - hot[kept]) @ slope.T - seen
    above = np.maximum(0.0, -below.min(axis=0))
    lacking = np.maximum(0.0, below.max(axis=0)) + above
    rest = spread @ (hot[kept] - np.linalg.solve(slope, level + above))
    causes = np.hstack([gain, -np.diag(lacking)[:, lacking > 1e-9]])
    t, course = [0.0], [causes]
    span = _FIRST / speeds.max()
    while t[-1] < _LAST / speeds.min():
        over = expm(slope * span / _PARTS)
        for _ in range(_PARTS):
            t.append(t[-1] + span / _PARTS)
            course.append(over @ course[-1])
        span = t[-1]
    both = spread @ np.array(course)
    return Responses(np.array(t), rest, both[..., : len(squares)], both[..., len(squares) :])


def accumulated(t: FloatArray, g: FloatArray, constants: FloatArray) -> tuple[FloatArray, FloatArray]:
    """P and Q of the bounds x ≤ θ P + V Q while i²t stays below θ, one for each of some bursts.

    Args:
        t: instants [s], shape (n,).
        g: impulse responses, shape (n, ...).
        constants: of the accumulators [s], of a shape that broadcasts with (...).

    Returns:
        Both of shape (bursts, ...); the first burst has Q = 0.
    """
    skips = np.unique(np.linspace(0, 0.8 * len(t), _SKIPS).astype(int))
    ahead = (t[skips, None] - t).reshape(len(skips), len(t), *[1] * max(g.ndim - 1, constants.ndim))
    m = g[skips][:, None] * np.exp(np.minimum(ahead / constants, _STEEP))
    for k in range(1, len(t)):
        behind = skips < k
        m[behind, k] = np.maximum(g[k], m[behind, k - 1] * np.exp((t[k - 1] - t[k]) / constants))
    return np.trapezoid(m, t, axis=1), np.trapezoid(np.maximum(g - m, 0), t, axis=1)


def time_constant(
    t: FloatArray, g: FloatArray, room: FloatArray, most: float, given: float | None
) -> tuple[float, float]:
    """τ of i²t for one joint alone, by default that which at its worst duration keeps most, and θ for it.

    Compared is the constant current that is admitted from rest for a time, over all times, with that which the network
    would bear.

    Args:
        t: instants [s], shape (n,).
        g: impulse responses of the limited places [K/(A² s)], shape (n, places).
        room: how far they may rise [K].
        most: squared peak current [A²].
        given: τ, where the drive's is fixed [s].

    Returns:
        τ [s] and θ [A²].
    """
    constants = np.geomspace(t[_PARTS] / 2, t[-1] / _LAST, _CONSTANTS) if given is None else np.array([given])
    p, q = accumulated(t, g[:, None], constants[:, None])
    thresholds = np.minimum(((room - most * q) / np.maximum(p, 1e-30)).max(axis=0).min(axis=1), most)
    admitted = np.minimum(most, thresholds / -np.expm1(-t[1:, None] / constants))
    kept = (admitted / constant_squares(t, g[..., None], 0, np.zeros(1), room, most)[:, None]).min(axis=0)
    best = int(np.argmax(kept))
    return float(constants[best]), float(thresholds[best])


def constant_squares(
    t: FloatArray, g: FloatArray, joint: int, others: FloatArray, room: FloatArray, most: float
) -> FloatArray:
    """Squared constant current [A²] that the network bears of a joint from rest until each instant after the first.

    Args:
        t: instants [s], shape (n,).
        g: impulse responses of the limited places to the joints, shape (n, places, joints).
        joint: which.
        others: squared currents of the joints beside it [A²], 0 for itself.
        room: how far the places may rise [K].
        most: squared peak current [A²].
    """
    rise = np.cumsum(np.diff(t)[:, None, None] * (g[1:] + g[:-1]) / 2, axis=0)
    left = np.maximum(room - rise @ others, 0.0)
    return np.asarray(np.minimum(most, (left / np.maximum(rise[..., joint], 1e-30)).min(axis=1)))


def shared_thresholds(
    p: FloatArray, q: FloatArray, room: FloatArray, alone: FloatArray, most: FloatArray
) -> FloatArray:
    """Thresholds [A²] of joints that heat each other: the least share of what each could have alone is the largest.

    Args:
        p, q: of the bounds, shape (places, joints).
        room: shape (places,).
        alone: thresholds of each joint alone, shape (joints,).
        most: at most so much of each [A²].
    """
    few = 1e-3  # of the sum of all beside the least: what one doesn't use another may have
    count = len(alone)
    left = np.hstack([p * alone / room[:, None], np.zeros((len(p), 1))])  # in shares, the last the least of them
    least = np.hstack([-np.eye(count), np.ones((count, 1))])
    limits = np.concatenate([1 - q.sum(axis=1) / room, np.zeros(count)])
    ends = [*((0, each) for each in most / alone), (0, 1)]
    answer = linprog(-np.append(np.full(count, few), 1.0), np.vstack([left, least]), limits, bounds=ends)
    return np.zeros(count) if answer.x is None else np.asarray(answer.x[:-1] * alone)


def excess(t: FloatArray, g: FloatArray, k: FloatArray) -> FloatArray:
    """How far a place rises above each of `SHARES` times the largest rise of a reading [K], shape (shares,).

    Args:
        t: instants [s], shape (n,).
        g, k: impulse responses of the place and of the reading, times the largest input, shape (n, inputs).
    """
    weights = (np.diff(t, prepend=0.0) + np.diff(t, append=t[-1])) / 2
    return np.array([weights @ np.maximum(g - share * k, 0).sum(axis=1) for share in SHARES])


def delayed(t: FloatArray, k: FloatArray, seconds: float) -> FloatArray:
    """Impulse responses as they were some seconds ago, shape (n, inputs)."""
    return np.array([np.interp(t - seconds, t, each, left=0.0) for each in k.T]).T
