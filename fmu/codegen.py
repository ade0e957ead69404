"""What CasADi derives from a component: C code, dependencies, and the inner step that its time constants allow."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import reduce
from itertools import repeat
from typing import Any, Literal, get_args

import casadi as ca
import numpy as np

from lptn.basics.arrays import BoolArray
from lptn.basics.errors import InputError
from lptn.model.model import rk4

from .component import Component
from .variables import Kind, Variable

# --- C code: rates, steps, outputs and their derivatives -------------------------------------------

_NULL_INPUT = re.compile(r"arg\[(\d+)\]\? (arg\[\1\]\[\d+\]) : 0")
_NULL_OUTPUT = re.compile(r"if \(res\[(\d+)\]!=0\) (res\[\1\])")
_HOUSEKEEPING = re.compile(
    r"CASADI_SYMBOL_EXPORT [^{};]*?\b\w+_(?:checkout|release|incref|decref|n_in|n_out|default_in|name_in|name_out"
    r"|sparsity_in|sparsity_out|work|work_bytes|version|size)\([^)]*\)\s*\{"
)


def c_code(component: Component, name: str) -> str:
    """The functions that the C core calls, as one C file without null checks and without CasADi's housekeeping.

    Args:
        name: prefix of the few symbols that it defines, so that two FMUs can be linked into one program.
    """
    generator = ca.CodeGenerator(
        f"{name}.c", {"with_header": False, "cpp": False, "main": False, "casadi_int": "int", "verbose": False}
    )
    for function in _functions(component):
        generator.add(function)
    text = _without_housekeeping(generator.dump())
    # The core never passes a null pointer; without the checks the compiler keeps numbers in registers.
    text = _NULL_OUTPUT.sub(r"\2", _NULL_INPUT.sub(r"\2", text))
    if component.admissible:  # its functions do pass null pointers
        limiter = component.admissible.c_code(component.p.numel(), component.outputs.numel())
        text += _without_housekeeping(limiter).replace("lptn_limiter_ ## ID", f"{name}_limiter_ ## ID")
    return re.sub(r"^(casadi|limiter)_real \1_", r"static \1_real \1_", text, flags=re.MULTILINE)


def jacobian_moves(component: Component) -> bool:
    """Whether the rates' Jacobian by the states depends on states or inputs."""
    jacobian = ca.jacobian(component.rates, component.x)
    return bool(ca.depends_on(jacobian, ca.vertcat(component.x, component.u)))


def _functions(component: Component) -> list[ca.Function]:
    """Functions over (states, inputs, parameters, …), all results dense."""
    x, u, p = component.x, component.u, component.p
    rates, outputs = component.rates, component.outputs
    jacobian = ca.jacobian(rates, x)
    bound = reduce(ca.fmax, ca.vertsplit(ca.sum2(ca.fabs(jacobian))))  # a row's sum: no eigenvalue lies beyond
    dx, du, dp = (ca.SX.sym(name, size.numel()) for name, size in (("dx", x), ("du", u), ("dp", p)))
    ar, ay = ca.SX.sym("ar", rates.numel()), ca.SX.sym("ay", outputs.numel())
    arguments, seeds = ca.vertcat(x, u, p), ca.vertcat(dx, du, dp)
    gradient = ca.jtimes(rates, arguments, ar, True) + ca.jtimes(outputs, arguments, ay, True)
    split = [0, x.numel(), x.numel() + u.numel(), arguments.numel()]
    forward = [x, u, p, dx, du, dp]
    # The limiter completes three of these: see c/admissible.c.
    prefix = "lptn_plain" if component.admissible else "lptn"
    return [
        _function("lptn_rates", [x, u, p], [rates]),
        _function("lptn_rk4", *_rk4(component)),
        _function("lptn_jacobian", [x, u, p], [jacobian]),
        _function("lptn_bound", [x, u, p], [bound]),
        _function(f"{prefix}_outputs", [x, u, p], [outputs]),
        _function("lptn_rates_forward", forward, [ca.jtimes(rates, arguments, seeds)]),
        _function(f"{prefix}_outputs_forward", forward, [ca.jtimes(outputs, arguments, seeds)]),
        _function(f"{prefix}_reverse", [x, u, p, ar, ay], ca.vertsplit(gradient, split)),
    ]


def _function(name: str, arguments: list[Any], results: list[Any]) -> ca.Function:
    return ca.Function(name, arguments, ca.cse([ca.densify(result) for result in results]))


def _rk4(component: Component) -> tuple[list[Any], list[Any]]:
    """One step of the classical Runge-Kutta scheme, the inputs going in a straight line from u0 to u1."""
    x, u0, p = component.x, component.u, component.p
    u1, h = ca.SX.sym("u1", u0.numel()), ca.SX.sym("h")
    rates = ca.Function("rates", [x, u0, p], [component.rates])
    middle = 0.5 * (u0 + u1)
    inputs = iter((u0, middle, middle, u1))  # at the four stages
    return [x, u0, u1, p, h], [rk4(lambda state: rates(state, next(inputs), p), x, h)]


def _without_housekeeping(text: str) -> str:
    kept, position = [], 0
    for match in _HOUSEKEEPING.finditer(text):
        if match.start() < position:
            continue
        kept.append(text[position : match.start()])
        depth, end = 1, match.end()
        while depth:
            depth += {"{": 1, "}": -1}.get(text[end], 0)
            end += 1
        position = end
    return re.sub(r"\n{3,}", "\n\n", "".join([*kept, text[position:]]))


# --- what depends on what: the lists of `ModelStructure` --------------------------------------------


@dataclass(frozen=True)
class Dependent:
    """An entry of `ModelStructure`, what FMI calls an unknown.

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
    """The lists of `ModelStructure`: outputs, rates, what initialisation leaves to be calculated, event indicators."""

    outputs: tuple[Dependent, ...]
    rates: tuple[Dependent, ...]
    initial: tuple[Dependent, ...]
    indicators: tuple[Dependent, ...] = ()


def structure(component: Component) -> Structure:
    """The dependencies of a component, parameters among them.

    Without the parameters an importer that differentiates by colours gets wrong Jacobians.
    """
    states, parameters = component.of("state"), component.of("parameter")
    limits = [parameters[index].reference for index in component.limited]
    whole = [variable.reference for variable in (*states, *component.of("input"), *parameters[: component.limited[0]])]
    # States of effects come last and have no limit.
    crossings = [(state.reference, limit) for state, limit in zip(states, limits, strict=False)]
    every = sorted(reference for pair in crossings for reference in pair)

    def each(kind: Kind, references: Iterable[Sequence[int]], how: str = "dependent") -> list[Dependent]:
        """The variables of a kind with what each depends on, in one way."""
        pairs = zip(component.of(kind), references, strict=False)
        return [Dependent(variable, tuple(those), (how,) * len(those)) for variable, those in pairs]

    unknown = [
        *_dependents(component, component.of("output"), component.outputs),
        # Admissible torques run the model against all limits; a forecast against its own limit, up to the horizon.
        *each("admissible", repeat([*whole, *limits])),
        *each("forecast", ([*whole, limit, parameters[-1].reference] for limit in limits)),
        *each("crossed", crossings),
        *(entry for entry in each("clock", repeat(every)) if not entry.variable.entrance),
    ]
    rates = _dependents(component, component.of("rate"), component.rates)
    shown = [entry for entry in each("state", ([state.reference] for state in states), "constant")
             if not entry.variable.hidden]  # fmt: skip
    initial = sorted((*rates, *unknown), key=lambda entry: entry.variable.reference)
    indicators = each("indicator", crossings, "constant")
    return Structure((*shown, *unknown), tuple(rates), tuple(initial), tuple(indicators))


def _dependents(component: Component, variables: Sequence[Variable], expressions: Any) -> list[Dependent]:
    moving, arguments = ca.vertcat(component.x, component.u), ca.vertcat(component.x, component.u, component.p)
    references = [variable.reference for variable in component.of("state", "input", "parameter")]
    jacobian = ca.jacobian(expressions, arguments)
    rows, columns = jacobian.sparsity().get_triplet()
    entries = ca.vertcat(*jacobian.nonzeros())  # type: ignore[call-overload]
    pairs: list[list[tuple[int, str]]] = [[] for _ in variables]
    for row, column, by_motion, by_parameter in zip(
        rows, columns, _depends(entries, moving), _depends(entries, component.p), strict=True
    ):
        pairs[row].append((references[column], "dependent" if by_motion else "tunable" if by_parameter else "constant"))
    return [
        Dependent(variable, tuple(reference for reference, _ in row), tuple(kind for _, kind in row))
        for variable, row in zip(variables, map(sorted, pairs), strict=True)
    ]


def _depends(entries: Any, symbols: Any) -> BoolArray:
    """For each entry whether it depends on any of some symbols."""
    pattern = ca.jacobian_sparsity(entries, symbols) if symbols.numel() else ca.Sparsity(entries.numel(), 0)
    rows, _ = pattern.get_triplet()
    depends = np.zeros(entries.numel(), dtype=bool)
    depends[list(rows)] = True
    return depends


# --- the inner step of Co-Simulation, checked against the fastest time constant ----------------------

Solver = Literal["rk4", "ros2"]


@dataclass(frozen=True)
class Integration:
    """How Co-Simulation integrates.

    Args:
        solver: `rk4` or `ros2`.
        step: longest inner step [s].
        fastest: fastest time constant at the start values [s].
        notes: what was changed or should be known, a sentence each.
    """

    solver: Solver
    step: float
    fastest: float
    notes: tuple[str, ...] = ()


def integration(component: Component, solver: str, step: float | None) -> Integration:
    """The inner step: as asked, divided where the fastest time constant needs it, or a fitting one.

    Args:
        solver: `rk4`, order 4 and explicit, or `ros2`, order 2 and L-stable, for stiff networks.
        step: longest inner step [s]; by default a fitting one.

    Raises:
        InputError: an unknown solver, a step that is no positive number, or one that RK4 would need 1000 parts of.
    """
    origin = component.model.network.origin
    if solver not in get_args(Solver):
        raise InputError(origin, "solver", f"'{solver}'", " or ".join(get_args(Solver)))
    if step is not None and not (step > 0 and math.isfinite(step)):
        raise InputError(origin, "step", f"{step!r}", "a positive number of seconds")
    fastest = 1 / _fastest_rate(component)
    ros2_step = 0.1  # s; of second order, so no longer than this where no step is given
    if solver == "ros2":
        return Integration("ros2", step or ros2_step, fastest)
    exact = 0.05  # step over fastest time constant at which RK4 is off by 5e-8 of a mode
    longest = 1.0  # s; no robot's load keeps still for longer
    if step is None:  # the next smaller number of the row 1, 2, 5, 10
        most = min(longest, exact * fastest)
        power = 10.0 ** math.floor(math.log10(most) + 1e-12)
        round_step = max(factor for factor in (1, 2, 5) if factor * power <= most * (1 + 1e-9)) * power
        return Integration("rk4", float(f"{round_step:.6g}"), fastest)
    reach = 0.5  # longest step over fastest time constant that is left to RK4
    parts = math.ceil(step / (reach * fastest) - 1e-9)
    if parts <= 1:
        return Integration("rk4", step, fastest)
    asked = f"a step of {step:g} s with a fastest time constant of {fastest:.3g} s"
    most_parts = 1000  # a finer division means a stiff network: that is what ROS2 is for
    if parts > most_parts:
        raise InputError(origin, "step", asked, "solver ros2, or a shorter step")
    note = f"{asked}: divided into {parts} inner steps of {step / parts:.3g} s"
    return Integration("rk4", step / parts, fastest, (note,))


def _fastest_rate(component: Component) -> float:
    """The largest eigenvalue at the start values, with each input at rest and at a usual size [1/s]."""
    arguments = [component.x, component.u, component.p]
    jacobian = ca.Function("jacobian", arguments, [ca.densify(ca.jacobian(component.rates, component.x))])
    x, u, p = component.starts("state"), component.starts("input"), component.starts("parameter")
    hot = np.array([variable.celsius for variable in component.of("input")], dtype=bool)
    rates = []
    for size in (0.0, 1.0, 3.0):
        inputs = np.where(hot, u, size) if u.size else u
        eigenvalues = np.linalg.eigvals(jacobian(x + 10 * size, inputs, p).full())
        rates.append(float(np.abs(eigenvalues).max()))
    return max(*rates, 1e-12)
