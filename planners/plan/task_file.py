"""Task files: TOML read as a plain table, and what several kinds of task have in common."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from lptn.basics.arrays import FloatArray
from lptn.basics.errors import InputError
from lptn.basics.places import matching
from lptn.basics.toml import text_of, told_by_line, toml_of
from lptn.model.file import Number
from lptn.model.model import Model

Positive = Annotated[Number, Field(gt=0)]
NotNegative = Annotated[Number, Field(ge=0)]
Celsius = Annotated[Number, Field(gt=-80, lt=500)]
ByPlace = dict[str, Number]
"""Numbers by name or pattern; what stands later wins."""


def load_task(path: Path) -> dict[str, Any]:
    """The whole task file as plain Python values.

    Raises:
        InputError: it can't be read, or is no TOML.
    """
    return toml_of(path, text_of(path, "a task file"))


@contextmanager
def told_in(origin: str) -> Iterator[None]:
    """Turn what pydantic and the readers find into one line with the place in the task file.

    Raises:
        InputError: something in it can't be used.
    """
    path = Path(origin)
    with told_by_line(path, text_of(path, "a task file") if path.is_file() else ""):
        yield


def by_name(
    given: Mapping[str, float], names: tuple[str, ...] | list[str], origin: str, table: str
) -> dict[str, float]:
    """Numbers spread over the names that their patterns match.

    Raises:
        InputError: a pattern that matches nothing.
    """
    found: dict[str, float] = {}
    for pattern, value in given.items():
        chosen = matching(pattern, names)
        if not chosen:
            raise InputError(origin, f'{table}."{pattern}"', "no such place", f"some of {', '.join(names)}")
        found |= dict.fromkeys(chosen, float(value))
    return found


def start_of(given: Mapping[str, float], model: Model, origin: str) -> FloatArray:
    """Temperatures of all states at the start [degC].

    Raises:
        InputError: a node is left out.
    """
    found = by_name(given, model.nodes, origin, "start")
    missing = [node for node in model.nodes if node not in found]
    if missing:
        raise InputError(origin, "start", f"no temperature of {missing[0]}", 'one of each node, such as "*" = 25')
    nodes = np.array([found[node] for node in model.nodes])
    return np.asarray(nodes[np.array(model.owners)])


def conditions_of(given: Mapping[str, float], names: tuple[str, ...], origin: str) -> FloatArray:
    """The model's other inputs in order.

    Raises:
        InputError: one of them is left out.
    """
    found = by_name(given, names, origin, "conditions")
    missing = [name for name in names if name not in found]
    if missing:
        raise InputError(origin, "conditions", f"no {missing[0]}", f"each of {', '.join(names)}; a pattern will do")
    return np.array([found[name] for name in names])
