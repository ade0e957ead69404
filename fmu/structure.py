"""What depends on what: the dependencies that `ModelStructure` lists, parameters too."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from .component import Component
from .variables import Kind, Variable


@dataclass(frozen=True)
class Unknown:
    """An entry of `ModelStructure`.

    Args:
        variable: the output or rate.
        dependencies: value references that it depends on, in order.
        kinds: for each of them `constant` factor, factor of `tunable` parameters, or `dependent` on states and inputs.
    """

    variable: Variable
    dependencies: tuple[int, ...]
    kinds: tuple[str, ...]


@dataclass(frozen=True)
class Structure:
    """The lists of `ModelStructure`: outputs, rates, and what initialisation leaves to be calculated."""

    outputs: tuple[Unknown, ...]
    rates: tuple[Unknown, ...]
    initial: tuple[Unknown, ...]


def structure(component: Component) -> Structure:
    """The dependencies of a component.

    Without the parameters among them an importer that differentiates by colours gets wrong Jacobians.
    """
    states = [Unknown(state, (state.reference,), ("constant",)) for state in component.of("state") if not state.hidden]
    rates = _unknowns(component, component.of("rate"), component.rates)
    calculated = _unknowns(component, component.of("output"), component.outputs)
    calculated += _admissible(component)
    forecasts = _forecasts(component)
    initial = sorted((*rates, *calculated, *forecasts), key=_by_reference)
    return Structure((*states, *calculated, *forecasts), tuple(rates), tuple(initial))


def _by_reference(unknown: Unknown) -> int:
    return unknown.variable.reference


def _unknowns(component: Component, variables: Sequence[Variable], expressions: Any) -> list[Unknown]:
    moving, known = ca.vertcat(component.x, component.u), ca.vertcat(component.x, component.u, component.p)
    references = _known_references(component)
    jacobian = ca.jacobian(expressions, known)
    rows, columns = jacobian.sparsity().get_triplet()
    entries = ca.vertcat(*jacobian.nonzeros())
    curved, tuned = _touched(entries, moving), _touched(entries, component.p)
    found: list[list[tuple[int, str]]] = [[] for _ in variables]
    for row, column, bent, held in zip(rows, columns, curved, tuned, strict=True):
        found[row].append((references[column], "dependent" if bent else "tunable" if held else "constant"))
    return [
        Unknown(variable, tuple(reference for reference, _ in pairs), tuple(kind for _, kind in pairs))
        for variable, pairs in zip(variables, (sorted(pairs) for pairs in found), strict=True)
    ]


def _known_references(component: Component) -> list[int]:
    """The value reference of each entry of states, inputs and parameters joined."""
    kinds: tuple[Kind, ...] = ("state", "input", "parameter")
    return [variable.reference for kind in kinds for variable in component.of(kind)]


def _touched(entries: Any, by: Any) -> np.ndarray[Any, np.dtype[np.bool_]]:
    """For each entry whether it depends on any of some symbols."""
    pattern = ca.jacobian_sparsity(entries, by) if by.numel() else ca.Sparsity(entries.numel(), 0)
    rows, _ = pattern.get_triplet()
    touched = np.zeros(entries.numel(), dtype=bool)
    touched[list(rows)] = True
    return touched


def _admissible(component: Component) -> list[Unknown]:
    """An admissible torque runs the whole model against all limits."""
    parameters = component.of("parameter")[: len(component.model.unknowns) + len(component.limited)]
    references = tuple(variable.reference for variable in (*component.of("state", "input"), *parameters))
    return [Unknown(each, references, ("dependent",) * len(references)) for each in component.of("admissible")]


def _forecasts(component: Component) -> list[Unknown]:
    """A forecast runs the whole model: it depends on all of it, on its own limit and on the horizon."""
    parameters = component.of("parameter")
    own = [v.reference for v in parameters[: len(component.model.unknowns)]]
    common = [v.reference for v in component.of("state", "input")] + own
    horizon = parameters[-1].reference
    found = []
    for row, variable in enumerate(component.of("forecast")):
        references = sorted([*common, parameters[component.limited[row]].reference, horizon])
        found.append(Unknown(variable, tuple(references), ("dependent",) * len(references)))
    return found
