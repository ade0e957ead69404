"""Where a model fails by operating condition: each node's errors at rest and in motion, by load, air and time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from lptn.basics.arrays import BoolArray, FloatArray
from lptn.identify.comparison import Errors, Prediction
from lptn.logs.run import Run

_STANDS = 0.05  # rad/s and m/s: a turn in two minutes, a leg's length in ten seconds; noise of a speed lies below
_WARMING = (300.0, 1200.0)  # s: windings have warmed by then, housings have
_SAMPLE = 20_000  # readings of a run that are looked at: they give an RMSE to a hundredth
_LOADS = ("torque", "current", "power")


def by_condition(nodes: Sequence[str], predictions: Mapping[str, Prediction]) -> list[dict[str, Any]]:
    """Errors under each condition that some of the runs meet.

    Thirds have equally many readings of a node over all runs. A condition that a node never meets has no errors.

    Args:
        nodes: the model's nodes.
        predictions: by segment.

    Returns:
        For each condition its group, its name, and a tile for each node: errors (predicted − measured) [K], the
        condition's limits in words, and the segment in which they are largest; `None` where nothing was measured.
    """
    errors = {key: _sampled(prediction.error) for key, prediction in predictions.items()}
    conditions: dict[tuple[str, str], list[dict[str, Any] | None]] = {}
    for row, node in enumerate(nodes):
        for group, name, limits, masks in _conditions(
            node, {key: prediction.bound.run for key, prediction in predictions.items()}
        ):
            parts = {key: errors[key][row][mask] for key, mask in masks.items()}
            all_of_it = Errors.of(np.concatenate(list(parts.values())))
            if all_of_it.count:
                squares = {key: float(np.nansum(part**2)) for key, part in parts.items()}
                tile: dict[str, Any] = {"rmse": all_of_it.rmse, "mean": all_of_it.mean, "max": all_of_it.max}
                tile |= {"limits": limits, "segment": max(squares, key=lambda key: squares[key])}
                conditions.setdefault((group, name), [None] * len(nodes))[row] = tile
    return [{"group": group, "name": name, "tiles": tiles} for (group, name), tiles in conditions.items()]


Masks = dict[str, BoolArray]


def _conditions(node: str, runs: Mapping[str, Run]) -> list[tuple[str, str, str, Masks]]:
    """Group, name, limits in words, and for each segment which of its sampled readings meet the condition."""
    conditions: list[tuple[str, str, str, Masks]] = []
    for speed, group, unit in ((f"velocity.{node}", "joint", "rad/s"), ("speed.base", "robot", "m/s")):
        if values := _values(runs, speed):
            size = {key: np.abs(samples) for key, samples in values.items()}
            standing = {key: magnitude < _STANDS for key, magnitude in size.items()}
            conditions.append((group, "stands", f"below {_STANDS} {unit}", standing))
            conditions.append(
                (group, "moves", f"from {_STANDS} {unit}", {key: ~mask for key, mask in standing.items()})
            )
    for kind in _LOADS:
        if values := _values(runs, f"{kind}.{node}"):
            conditions += _thirds("load", f"|{kind}|", {key: np.abs(samples) for key, samples in values.items()})
            break
    conditions += _thirds("air", "°C", _values(runs, "temperature.ambient"))
    since = {key: _sampled(run.time - run.time[0]) for key, run in runs.items()}
    first, later = (f"{seconds / 60:g} min" for seconds in _WARMING)
    conditions.append(
        ("since the start", f"to {first}", "", {key: elapsed < _WARMING[0] for key, elapsed in since.items()})
    )
    between = {key: (elapsed >= _WARMING[0]) & (elapsed < _WARMING[1]) for key, elapsed in since.items()}
    conditions.append(("since the start", f"to {later}", "", between))
    conditions.append(("since the start", "later", "", {key: elapsed >= _WARMING[1] for key, elapsed in since.items()}))
    return conditions


def _thirds(group: str, unit: str, values: Mapping[str, FloatArray]) -> list[tuple[str, str, str, Masks]]:
    """Low, middle and high third, where there are such."""
    if not values:
        return []
    together = np.concatenate(list(values.values()))
    low, high = (float(limit) for limit in np.nanquantile(together, (1 / 3, 2 / 3)))
    if not np.nanmin(together) < low < high:
        return []
    return [
        (group, "low", f"below {low:.3g} {unit}", {key: samples < low for key, samples in values.items()}),
        (
            group,
            "middle",
            f"{low:.3g} to {high:.3g} {unit}",
            {key: (samples >= low) & (samples < high) for key, samples in values.items()},
        ),
        (group, "high", f"from {high:.3g} {unit}", {key: samples >= high for key, samples in values.items()}),
    ]


def _values(runs: Mapping[str, Run], column: str) -> dict[str, FloatArray]:
    """A column of all runs; empty where one of them has none."""
    if not all(run.has(column) for run in runs.values()):
        return {}
    return {key: _sampled(run.columns[column]) for key, run in runs.items()}


def _sampled(values: FloatArray) -> FloatArray:
    return values[..., :: max(1, values.shape[-1] // _SAMPLE)]
