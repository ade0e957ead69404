"""Which model inputs arise from which raw quantities, and how samples are reduced with no integral lost."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lptn.arrays import FloatArray


def _same(values: FloatArray) -> FloatArray:
    return values


def _magnitude(values: FloatArray) -> FloatArray:
    return np.abs(values)


@dataclass(frozen=True)
class Reduction:
    """A generalised mean: `after(mean(before(x)))`. The mean of `before(x)` is what a block preserves."""

    before: Callable[[FloatArray], FloatArray]
    after: Callable[[FloatArray], FloatArray]


MEAN = Reduction(_same, _same)
MEAN_ABS = Reduction(_magnitude, _same)
RMS = Reduction(np.square, np.sqrt)


@dataclass(frozen=True)
class Feature:
    """A model input: the raw quantities whose product it is formed from, and how a block of it is reduced."""

    needs: tuple[str, ...]
    reduction: Reduction


# Copper loss goes with the square of torque or current, so these keep their RMS; a drive's loss goes with |current|.
# Friction goes with |speed| and with its square, so velocity gives two features. Any quantity that is not listed keeps
# its plain mean.
FEATURES: Mapping[str, Feature] = {
    "temperature": Feature(("temperature",), MEAN),
    "torque": Feature(("torque",), RMS),
    "torque_abs": Feature(("torque",), MEAN_ABS),
    "current": Feature(("current",), RMS),
    "current_abs": Feature(("current",), MEAN_ABS),
    "velocity": Feature(("velocity",), MEAN_ABS),
    "velocity_rms": Feature(("velocity",), RMS),
    "mechanical_power": Feature(("torque", "velocity"), MEAN_ABS),
    "speed": Feature(("speed",), MEAN_ABS),
}


# Of no use to a model, which has no sense of direction; who looks for a gait asks for it by name.
_ON_REQUEST: Mapping[str, Feature] = {"signed_velocity": Feature(("velocity",), MEAN)}


def feature(column: str) -> Feature:
    """The rule for a column `<feature>.<place>`."""
    quantity = column.partition(".")[0]
    return FEATURES.get(quantity) or _ON_REQUEST.get(quantity) or Feature((quantity,), MEAN)


def raw_keys(column: str, available: Iterable[str] = ()) -> tuple[str, ...]:
    """The raw columns that `column` is formed from.

    A log that already holds the feature itself (an earlier run, written to a file) gives it as it is.
    """
    if column in available:
        return (column,)
    place = column.partition(".")[2]
    return tuple(f"{quantity}.{place}" for quantity in feature(column).needs)


def features_of(raw: Iterable[str]) -> tuple[str, ...]:
    """Every feature that a log with the raw columns `raw` gives, raw ones first."""
    present = dict.fromkeys(raw)
    places = dict.fromkeys(key.partition(".")[2] for key in present)
    derived = (f"{quantity}.{place}" for place in places for quantity in FEATURES)
    return tuple(present) + tuple(
        column for column in derived if column not in present and all(k in present for k in raw_keys(column))
    )


def sample_values(column: str, raw: Mapping[str, FloatArray]) -> FloatArray:
    """The feature at each raw sample, (n,), before any reduction; products keep their sign."""
    first, *rest = (raw[key] for key in raw_keys(column, raw))
    for values in rest:
        first = first * values
    return first


def reduce_blocks(column: str, values: FloatArray, factor: int) -> FloatArray:
    """Reduce each full block of `factor` equally long samples to one; a rest at the end is dropped.

    NaN is left out of a block; a block of nothing but NaN gives NaN.

    Args:
        column: `<feature>.<place>`, which names the rule.
        values: (n,) samples.
        factor: samples a block, at least 1.

    Returns:
        (n // factor,) block values.
    """
    rule = feature(column).reduction
    blocks = rule.before(values[: values.size // factor * factor].reshape(-1, factor))
    return rule.after(ratio(np.nansum(blocks, axis=1), np.sum(~np.isnan(blocks), axis=1)))


def ratio(total: FloatArray, count: npt.NDArray[np.integer]) -> FloatArray:
    """`total / count`, (n,), NaN where the count is 0."""
    # Written out because numpy's own nanmean warns about an empty block.
    result: FloatArray = np.full(total.shape, np.nan)
    np.divide(total, count, out=result, where=count > 0)
    return result
