"""What is special in a stretch: the inputs that go with the error there as they go with it nowhere else in the run.

The error in the stretch, less what it usually is outside, is a shape. It is slid along each input: where the input's
departure from its mean has that shape, their product is large. How far the product in the stretch stands out from the
products at all other places of the same length, in root mean squares of these, is the input's score. So an input that
is as busy everywhere scores nothing, and neither does one that drifts slowly, whose products are large everywhere.

Temperatures follow heat late, and heat follows torque or speed in different ways. So each input is tried as it is, by
its size, and squared, and each of these at once and smoothed over a minute and over ten, as windings and housings do.

Chance is the same asked of the other places: the score that the best of all inputs, in all these ways, reaches at
one of twenty of them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from scipy.signal import fftconvolve, lfilter

from lptn.basics.arrays import FloatArray
from lptn.basics.errors import InputError
from lptn.logs.resampling import means_of_blocks

_LAGS = {"": 0.0, "over the last minute": 60.0, "over the last ten minutes": 600.0}  # s
_WAYS: dict[str, Callable[[FloatArray], FloatArray]] = {"": np.asarray, "size of ": np.abs, "square of ": np.square}
_CHANCE = 0.95  # share of other places whose best input scores less
_MOST = 4000  # readings that the run is averaged to; the question is one of minutes
_LEAST_INSIDE = 5  # readings: fewer have no shape
_CONSTANT = 1e-9  # share of its size within which an input stands still


@dataclass(frozen=True)
class Companion:
    """An input that goes with the error in a stretch.

    Args:
        column: of the log.
        words: what of it goes with the error.
        score: how far it stands out from other places, in root mean squares.
        inside: its mean in the stretch.
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
    time: FloatArray, error: FloatArray, inputs: Mapping[str, FloatArray], start: float, stop: float
) -> Special:
    """What is special from `start` to `stop` of a run.

    Args:
        time: s, evenly spaced, (n,).
        error: predicted − measured of one node [K], (n,), NaN where nothing was measured.
        inputs: the run's other columns, (n,) each.
        start: s.
        stop: s.

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
        stretch = f"{start:.6g} to {stop:.6g} s"
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
            continue  # the size of an input that was asked already
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

    Each place is judged by others alone, as the stretch is: else chance would seem less than it is.
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
