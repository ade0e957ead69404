"""C code of a component by CasADi: rates, steps, outputs and their derivatives."""

from __future__ import annotations

import re
from typing import Any

import casadi as ca

from .component import Component

_NULL_INPUT = re.compile(r"arg\[(\d+)\]\? (arg\[\1\]\[\d+\]) : 0")
_NULL_OUTPUT = re.compile(r"if \(res\[(\d+)\]!=0\) (res\[\1\])")
_HOUSEKEEPING = re.compile(
    r"CASADI_SYMBOL_EXPORT [^{};]*?\b\w+_(?:checkout|release|incref|decref|n_in|n_out|default_in|name_in|name_out"
    r"|sparsity_in|sparsity_out|work|work_bytes|version|size)\([^)]*\)\s*\{"
)


def functions(component: Component) -> list[ca.Function]:
    """The functions that the C core calls, each over (states, inputs, parameters, …), all results dense."""
    x, u, p = component.x, component.u, component.p
    rates, outputs = component.rates, component.outputs
    jacobian = ca.jacobian(rates, x)
    dx, du, dp = (ca.SX.sym(name, size.numel()) for name, size in (("dx", x), ("du", u), ("dp", p)))
    ar, ay = ca.SX.sym("ar", rates.numel()), ca.SX.sym("ay", outputs.numel())
    known, seeds = ca.vertcat(x, u, p), ca.vertcat(dx, du, dp)
    back = ca.jtimes(rates, known, ar, True) + ca.jtimes(outputs, known, ay, True)
    split = [0, x.numel(), x.numel() + u.numel(), known.numel()]
    forward = [x, u, p, dx, du, dp]
    # The limiter completes these three: see c/admissible.c.
    part = "lptn_plain" if component.admissible else "lptn"
    return [
        _function("lptn_rates", [x, u, p], [rates]),
        _function("lptn_rk4", *_rk4(component)),
        _function("lptn_jacobian", [x, u, p], [jacobian]),
        _function("lptn_bound", [x, u, p], [_largest_row(jacobian)]),
        _function(f"{part}_outputs", [x, u, p], [outputs]),
        _function("lptn_rates_forward", forward, [ca.jtimes(rates, known, seeds)]),
        _function(f"{part}_outputs_forward", forward, [ca.jtimes(outputs, known, seeds)]),
        _function(f"{part}_reverse", [x, u, p, ar, ay], ca.vertsplit(back, split)),
    ]


def c_code(component: Component, name: str) -> str:
    """The functions as one C file without null checks and without CasADi's housekeeping.

    Args:
        name: prefix of the few symbols that it defines, so that two FMUs can be linked into one program.
    """
    generator = ca.CodeGenerator(
        f"{name}.c", {"with_header": False, "cpp": False, "main": False, "casadi_int": "int", "verbose": False}
    )
    for function in functions(component):
        generator.add(function)
    text = _without_housekeeping(generator.dump())
    # The core never passes a null pointer; without the checks the compiler keeps numbers in registers.
    text = _NULL_OUTPUT.sub(r"\2", _NULL_INPUT.sub(r"\2", text))
    if component.admissible:  # its functions do pass null pointers
        limiter = component.admissible.c_code(component.p.numel(), component.outputs.numel())
        text += _without_housekeeping(limiter).replace("lptn_limiter_ ## ID", f"{name}_limiter_ ## ID")
    return re.sub(r"^(casadi|limiter)_real \1_", r"static \1_real \1_", text, flags=re.MULTILINE)


def moving_jacobian(component: Component) -> bool:
    """Whether the rates' Jacobian by the states depends on states or inputs."""
    jacobian = ca.jacobian(component.rates, component.x)
    return bool(ca.depends_on(jacobian, ca.vertcat(component.x, component.u)))


def _function(name: str, arguments: list[Any], results: list[Any]) -> ca.Function:
    return ca.Function(name, arguments, ca.cse([ca.densify(result) for result in results]))


def _rk4(component: Component) -> tuple[list[Any], list[Any]]:
    """One step of the classical Runge-Kutta scheme, the inputs going in a straight line from u0 to u1."""
    x, u0, p = component.x, component.u, component.p
    u1, h = ca.SX.sym("u1", u0.numel()), ca.SX.sym("h")
    rates = ca.Function("rates", [x, u0, p], [component.rates])
    middle = 0.5 * (u0 + u1)
    k1 = rates(x, u0, p)
    k2 = rates(x + h / 2 * k1, middle, p)
    k3 = rates(x + h / 2 * k2, middle, p)
    k4 = rates(x + h * k3, u1, p)
    return [x, u0, u1, p, h], [x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)]


def _largest_row(jacobian: Any) -> Any:
    """The largest sum of a row's absolute entries: no eigenvalue lies beyond."""
    sums = ca.vertsplit(ca.sum2(ca.fabs(jacobian)))
    largest = sums[0]
    for row in sums[1:]:
        largest = ca.fmax(largest, row)
    return largest


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
