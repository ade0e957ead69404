"""Machine code gives what CasADi's interpreter gives, and its absence changes nothing but time."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import casadi as ca
import numpy as np
import pytest

from lptn.basics.arrays import FloatArray
from lptn.basics.c_library import compiler
from lptn.model.model import Model
from lptn.model.network import Network
from lptn.simulate import kernel as machine_code
from lptn.simulate.bound_run import BoundRun, bind, default_start
from lptn.simulate.kernel import Kernel, Rates, kernel
from lptn.simulate.simulation import sensitivities, simulate
from tests.builders import effect as declared
from tests.builders import random_run, two_nodes, with_every_effect

needs_compiler = pytest.mark.skipif(compiler() is None, reason="no C compiler on this machine")


@pytest.fixture
def empty_cache(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[Path]:
    """A cache with no libraries in it, before and after."""
    monkeypatch.setattr("platformdirs.user_cache_path", lambda name: tmp_path / name)
    machine_code.library.cache_clear()
    yield tmp_path / "lptn" / "native"
    machine_code.library.cache_clear()


def _case(averaged: bool, network: Network | None = None) -> tuple[Model, BoundRun, FloatArray]:
    stiff = with_every_effect().with_values({"capacity.a": 20.0})  # enough for internal steps
    model = Model(network or stiff)
    bound = bind(model, random_run(model, 90, seed=1, step=4.0, averaged=averaged))
    return model, bound, default_start(model, bound) + np.arange(len(model.states))


@needs_compiler
@pytest.mark.parametrize("averaged", [False, True])
def test_compiled_steps_and_derivatives_are_the_interpreters(averaged: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    model, bound, start = _case(averaged)
    everything = range(len(model.parameters))
    assert kernel(model, len(model.states), everything) is not None
    fast = sensitivities(model, bound, model.values, everything, start)
    stepped = simulate(model, bound, start=start)
    monkeypatch.setattr("lptn.simulate.dynamics.kernel", lambda *_: None)
    slow = sensitivities(model, bound, model.values, everything, start)
    for name in ("readings", "by_parameter", "by_start"):
        expected = getattr(slow, name)
        np.testing.assert_allclose(getattr(fast, name), expected, rtol=1e-9, atol=1e-11 * np.abs(expected).max())
    again = simulate(model, bound, start=start)
    np.testing.assert_allclose(stepped.states, again.states, rtol=1e-12)
    np.testing.assert_allclose(stepped.held, again.held, rtol=1e-12)


def _all_operations(a: ca.SX, b: ca.SX) -> ca.SX:
    """Every operation that CasADi has on one or two numbers, for a between 0 and 1 and any b."""
    on_one: list[Callable[..., ca.SX]] = [ca.exp, ca.log, ca.sqrt, ca.sin, ca.cos, ca.tan, ca.asin, ca.acos, ca.atan]
    on_one += [ca.sinh, ca.cosh, ca.tanh, ca.asinh, ca.atanh, ca.log1p, ca.expm1, ca.erf, ca.floor, ca.ceil]
    on_one += [ca.fabs, ca.sign, ca.logic_not]
    on_two: list[Callable[..., ca.SX]] = [
        ca.fmin,
        ca.fmax,
        ca.fmod,
        ca.remainder,
        ca.atan2,
        ca.copysign,
        ca.hypot,
        ca.power,
    ]
    on_two += [lambda a, b: a + b, lambda a, b: a - b, lambda a, b: a * b, lambda a, b: a / b, lambda a, b: a**2.5]
    on_two += [lambda a, b: a < b, lambda a, b: a <= b, lambda a, b: ca.if_else(a > b, 1 / a, 2 * b), ca.logic_and]
    on_two += [lambda a, b: ca.logic_or(a, 0 * b), lambda a, b: (a == b) + (a != b)]
    pairs = [f(*operands) for f in on_two for operands in ((a, b), (ca.fabs(b), a))]
    others = [ca.acosh(1 + a), ca.copysign(a, -0.0), ca.copysign(a, 0.0), b * b, -b, ca.SX(0.0)]
    return ca.densify(ca.vertcat(*(f(a) for f in on_one), *pairs, *others))


@needs_compiler
def test_every_operation_is_casadis() -> None:
    u, p, unknown = ca.SX.sym("u", 2), ca.SX.sym("p", 2), ca.SX.sym("x", 2)
    count = _all_operations(unknown[0], unknown[1]).numel()
    x = ca.SX.sym("x", count)
    rates = _all_operations(0.3 * ca.tanh(x[0] * p[0] - u[0]) + 0.5, 0.2 * ca.sin(u[0] + x[1]) - 0.5 * p[1])
    library, model = machine_code.library(), SimpleNamespace(symbols=(x, u, p, rates, None))
    assert library is not None
    compiled = Kernel(library, Rates(cast(Model, model), 0, ()))
    rate, h = ca.Function("rates", [x, u, p], [rates]), 0.1
    start, inputs, values = np.linspace(-1, 1, count), np.array([[0.7], [0.1]]), np.array([0.9, 0.4])
    stages = [rate(start, inputs, values)]
    for share in (h / 2, h / 2, h):
        stages.append(rate(start + share * stages[-1], inputs, values))
    expected = start + h / 6 * (stages[0] + 2 * stages[1] + 2 * stages[2] + stages[3]).full().ravel()
    np.testing.assert_allclose(
        compiled.run(start, inputs, values, h, 1, averaged=False).ends[:, 1], expected, rtol=1e-13
    )


@needs_compiler
def test_an_operation_that_is_not_known_is_left_to_the_interpreter(monkeypatch: pytest.MonkeyPatch) -> None:
    model, bound, start = _case(averaged=True)
    before = simulate(model, bound, start=start).states
    monkeypatch.delitem(machine_code.NUMBERS, ca.OP_MUL)
    other = Model(model.network)
    assert kernel(other) is None
    np.testing.assert_allclose(simulate(other, bound, start=start).states, before, rtol=1e-12)


@needs_compiler
def test_one_library_for_all_models(empty_cache: Path) -> None:
    for network in (with_every_effect(), two_nodes([declared("constant_heat")]), two_nodes()):
        model, bound, start = _case(True, network)
        sensitivities(model, bound, model.values, [0], start)
        assert kernel(model, len(model.states), [0]) is not None
    assert len(list(empty_cache.glob("*.so"))) == 1


@pytest.mark.parametrize("program", ["no-such-compiler", "false"])
@pytest.mark.usefixtures("empty_cache")
def test_without_a_working_compiler_the_interpreter_goes_on(monkeypatch: pytest.MonkeyPatch, program: str) -> None:
    monkeypatch.setenv("CC", program)
    model, bound, start = _case(averaged=True)
    assert kernel(model) is None
    assert np.isfinite(sensitivities(model, bound, model.values, [0, 1], start).by_parameter).all()
