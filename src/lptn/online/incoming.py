"""What comes to an estimator from outside: checked, and put in the model's order."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from lptn.arrays import FloatArray
from lptn.errors import InputError
from lptn.model import Model


def inputs_of(model: Model, inputs: Mapping[str, float]) -> FloatArray:
    """Values of the model's inputs, shape (inputs,); NaN for one that stands for the resting temperature.

    Raises:
        InputError: one is missing or not finite.
    """
    values = np.empty(len(model.inputs))
    for place, column in enumerate(model.inputs):
        if column not in inputs:
            if column not in model.started:
                raise InputError(model.network.origin, f"input {column}", "no such input", f"a value for {column}")
            values[place] = math.nan
            continue
        values[place] = inputs[column]
        if not math.isfinite(values[place]):
            raise InputError(model.network.origin, f"input {column}", f"{values[place]:g}", "a finite number")
    return values


def readings_of(model: Model, readings: Mapping[str, float | None], what: str = "readings") -> FloatArray:
    """Readings of the model's nodes [degC], shape (nodes,), NaN where missing.

    Raises:
        InputError: a reading of no node, or an infinite one.
    """
    refuse_unknown(readings, model.nodes, model, what)
    given = (readings.get(node) for node in model.nodes)
    values = np.array([math.nan if reading is None else reading for reading in given], dtype=float)
    if np.isinf(values).any():
        node = model.nodes[int(np.isinf(values).argmax())]
        raise InputError(model.network.origin, f"{what} of {node}", "an infinite value", "a number, or NaN for none")
    return values


def refuse_unknown(names: Mapping[str, object], known: Sequence[str], model: Model, what: str) -> None:
    """Refuse a name that the model doesn't have: it is a slip of the pen.

    Raises:
        InputError: with the known names.
    """
    for name in names:
        if name not in known:
            raise InputError(model.network.origin, what, f"'{name}'", f"one of {', '.join(known)}")


def refuse_negative(sizes: Mapping[str, float]) -> None:
    """Refuse a size that is negative or not finite.

    Raises:
        ValueError: with its name.
    """
    for name, size in sizes.items():
        if not (math.isfinite(size) and size >= 0):
            raise ValueError(f"{name}: found {size:g}; expected a finite size, 0 or above")


def sizes_of(model: Model, sizes: float | Mapping[str, float], what: str) -> FloatArray:
    """One size a node, shape (nodes,); 0 for a node that a mapping leaves out.

    Raises:
        InputError: a node that the model doesn't have.
        ValueError: a size that is negative or not finite.
    """
    given = sizes if isinstance(sizes, Mapping) else dict.fromkeys(model.nodes, sizes)
    refuse_unknown(given, model.nodes, model, what)
    refuse_negative({f"{what} of {node}": size for node, size in given.items()})
    return np.array([given.get(node, 0.0) for node in model.nodes], dtype=float)
