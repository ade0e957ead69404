"""What is special in an interval: the inputs that correlate with the error there, and nowhere else in the run.

The error in the interval, less its mean outside, is a pattern. It is correlated with each input at all places of the
run. An input's score is its correlation in the interval, in root mean squares of its correlations at all other places.
So an input that varies as much everywhere has a low score, and so has one that drifts slowly.

Temperatures follow heat with a delay, and heat depends on torque or speed in different ways. So each input is tested as
logged, by magnitude and squared, each without a filter and smoothed over one and ten minutes, as by windings and
housings.

The score reached by chance is the 95 % quantile, over the other places, of the best score of all inputs and filters.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from scipy.signal import fftconvolve, lfilter

from lptn.basics.arrays import FloatArray
from lptn.basics.errors import InputError
from lptn.logs.clock import stretch_in_words
from lptn.logs.resampling import means_of_blocks

_LAGS = {"": 0.0, "over the last minute": 60.0, "over the last ten minutes": 600.0}  # s
_WAYS: dict[str, Callable[[FloatArray], FloatArray]] = {"": np.asarray, "size of ": np.abs, "square of ": np.square}
_CHANCE = 0.95  # share of other places whose best input scores less
_MOST = 4000  # readings that the run is averaged to; only changes over minutes matter
_LEAST_INSIDE = 5  # readings: fewer have no shape
_CONSTANT = 1e-9  # share of its size within which an input is constant


@dataclass(frozen=True)
class Companion:
    """An input that correlates with the error in an interval.

    Args:
        column: of the log.
        words: which function of it correlates with the error.
        score: its correlation there, in root mean squares of those elsewhere.
        inside: its mean in the interval.
        outside: its mean elsewhere in the run.
    """

    column: str
    words: str
    score: float
    inside: float
    outside: float


@dataclass(frozen=True)
class Special:
    """What is special in a stretch.

    Args:
        companions: an entry for each input that changes, the highest score first.
        chance: the score that the best of all inputs reaches at one of twenty other places.
    """

    companions: tuple[Companion, ...]
    chance: float


def special(
    time: FloatArray,
    error: FloatArray,
    inputs: Mapping[str, FloatArray],
    start: float,
    stop: float,
    origin: float = 0.0,
) -> Special:
    """What is special from `start` to `stop` of a run.

    Args:
        time: s, evenly spaced, (n,).
        error: predicted − measured of one node [K], (n,), NaN where nothing was measured.
        inputs: the run's other columns, (n,) each.
        start: s.
        stop: s.
        origin: of the log's clock [s]; messages count from there.

    Raises:
        InputError: too little was measured in the stretch, or outside it, to compare the two.
    """
    block = max(1, time.size // _MOST)
    step = float(time[1] - time[0]) * block
    moments, deviation = means_of_blocks(time, block), means_of_blocks(error, block)
    inside = (moments >= start) & (moments < stop)
    finite = np.isfinite(deviation)
    length = int(inside.sum())
    if (inside & finite).sum() < _LEAST_INSIDE or (~inside & finite).sum() < 2 * length:
        stretch = stretch_in_words(start, stop, origin)
        raise InputError("plot", "stretch", stretch, "a third of the run or less, with readings in it and outside")
    shape = np.where(finite, deviation - np.mean(deviation[~inside & finite]), 0.0)[inside]
    first = int(np.argmax(inside))
    sizes: list[FloatArray] = []
    companions, everywhere = [], np.zeros(moments.size - length + 1)
    for name, values in inputs.items():
        column = means_of_blocks(values, block)
        if not np.isfinite(column).all() or np.ptp(column) <= _CONSTANT * np.abs(column).max():
            continue
        if any(np.allclose(np.abs(column), size) for size in sizes):
            continue  # the magnitude of an input that was tested already
        sizes.append(np.abs(column))
        scores = {words: _standing_out(form, shape) for words, form in _forms(column, name, step).items()}
        words = max(scores, key=lambda label: abs(scores[label][first]))
        everywhere = np.maximum(everywhere, np.max([np.abs(score) for score in scores.values()], axis=0))
        means = float(column[inside].mean()), float(column[~inside].mean())
        companions.append(Companion(name, words, abs(float(scores[words][first])), *means))
    elsewhere = np.abs(np.arange(everywhere.size) - first) >= length
    chance = float(np.quantile(everywhere[elsewhere], _CHANCE)) if companions else 0.0
    return Special(tuple(sorted(companions, key=lambda companion: -companion.score)), chance)


def _standing_out(values: FloatArray, shape: FloatArray) -> FloatArray:
    """The product of a shape with what an input is at each place, in root mean squares of those that share no reading.

    Each place is compared with the others alone, as the interval is; otherwise chance would be underestimated.
    """
    products = fftconvolve(values - values.mean(), shape[::-1], mode="valid")
    places = np.arange(products.size)
    summed = np.append(0.0, np.cumsum(products**2))
    low, high = np.maximum(places - shape.size + 1, 0), np.minimum(places + shape.size, places.size)
    others = np.maximum(places.size - (high - low), 1)
    mean = (summed[-1] - (summed[high] - summed[low])) / others
    return np.asarray(products / np.sqrt(np.maximum(mean, 1e-300)))


def _forms(column: FloatArray, name: str, step: float) -> dict[str, FloatArray]:
    """An input in the ways in which heat may follow it, by their words; what only repeats another way is left out."""
    one_sided = column.min() >= 0
    forms = {}
    for prefix, of in _WAYS.items():
        if one_sided and prefix == "size of ":
            continue
        for lag, seconds in _LAGS.items():
            if seconds and seconds <= 2 * step:
                continue
            values = of(column)
            if seconds:
                kept = float(np.exp(-step / seconds))
                values = lfilter([1 - kept], [1, -kept], values, zi=[kept * values[0]])[0]
            forms[f"{prefix}{name} {lag}".strip()] = values
    return forms
