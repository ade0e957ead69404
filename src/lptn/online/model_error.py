"""How wrong a model may be: heat that it lacks, air that cools otherwise, inputs that are off."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from lptn.arrays import FloatArray

Sizes = float | Mapping[str, float]


@dataclass(frozen=True)
class ModelError:
    """What an estimator allows for besides the sensors' noise: standard deviations, for all nodes or by node.

    Args:
        heat: heat that the model lacks at a node, wandering [W].
        heat_time: time constant with which that heat wanders [s].
        change: more of it right after a node's heat flow changes, as a share of the change: a winding
            that is warm before its housing, where the model has one mass.
        bias: heat that the model lacks at a node for an hour and more [W]: a mass that it doesn't know.
        air: relative error of all conductances to prescribed temperatures, the same over a run: a draught.
        inputs: for log columns the error that stays the same over a run, in the column's unit:
            `{"temperature.ambient": 1.0}`.

    Raises:
        ValueError: a size that is negative or not finite, or a time constant that is not above 0.
    """

    heat: Sizes = 0.5
    heat_time: float = 300.0
    change: Sizes = 0.0
    bias: Sizes = 0.0
    air: float = 0.0
    inputs: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name in ("heat", "change", "bias", "air", "inputs"):
            sizes = getattr(self, name)
            for size in sizes.values() if isinstance(sizes, Mapping) else (sizes,):
                if not (math.isfinite(size) and size >= 0):
                    raise ValueError(f"{name}: found {size:g}; expected a finite size, 0 or above")
        if not (math.isfinite(self.heat_time) and self.heat_time > 0):
            raise ValueError(f"heat_time: found {self.heat_time:g}; expected a time above 0 s")


def by_node(sizes: Sizes, nodes: Sequence[str]) -> FloatArray:
    """One size a node, shape (nodes,); 0 for a node that a mapping leaves out."""
    if isinstance(sizes, Mapping):
        return np.array([sizes.get(node, 0.0) for node in nodes], dtype=float)
    return np.full(len(nodes), float(sizes))
