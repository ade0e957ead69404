"""Machine code gives what CasADi's interpreter gives, and its absence changes nothing but time."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from lptn.basics.c_library import compiler
from lptn.model.model import Model
from lptn.simulate.bound_run import BoundRun, bind, default_start
from lptn.simulate.dynamics import Stepper, stepper
from lptn.simulate.simulation import sensitivities, simulate
from tests.builders import effect as declared
from tests.builders import random_run, two_nodes, with_every_effect

needs_compiler = pytest.mark.skipif(compiler() is None, reason="no C compiler on this machine")


@pytest.fixture(autouse=True)
def _empty_cache(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr("platformdirs.user_cache_path", lambda name: tmp_path / name)


def _case(averaged: bool) -> tuple[Model, BoundRun, Stepper]:
    model = Model(with_every_effect().with_values({"capacity.a": 20.0}))  # stiff enough for internal steps
    bound = bind(model, random_run(model, 90, seed=1, step=4.0, averaged=averaged))
    return model, bound, stepper(model, len(model.states), range(len(model.parameters)))


@needs_compiler
@pytest.mark.parametrize("averaged", [False, True])
def test_compiled_steps_and_derivatives_are_the_interpreters(averaged: bool) -> None:
    model, bound, steps = _case(averaged)
    start = default_start(model, bound) + np.arange(len(model.states))
    everything = range(len(model.parameters))
    slow = sensitivities(model, bound, model.values, everything, start)
    plain = simulate(model, bound, start=start)
    assert steps.compile()
    fast = sensitivities(model, bound, model.values, everything, start)
    for name in ("readings", "by_parameter", "by_start"):
        expected = getattr(slow, name)
        np.testing.assert_allclose(getattr(fast, name), expected, rtol=1e-9, atol=1e-11 * np.abs(expected).max())
    np.testing.assert_allclose(simulate(model, bound, start=start).states, plain.states, rtol=1e-12)


@needs_compiler
def test_a_model_stepped_often_is_compiled_on_the_way(monkeypatch: pytest.MonkeyPatch) -> None:
    model = Model(two_nodes([declared("constant_heat")]))
    bound = bind(model, random_run(model, 300))
    monkeypatch.setattr("lptn.simulate.dynamics._WORTH", 500)
    sensitivities(model, bound, model.values, [0])
    assert "any kernel" not in model.made
    sensitivities(model, bound, model.values, [0])
    assert "any kernel" in model.made
    assert model.with_values(model.values * 1.1).made is model.made


@needs_compiler
def test_a_library_is_built_once_and_found_again(tmp_path: Path) -> None:
    _, _, first = _case(averaged=True)
    _, _, second = _case(averaged=True)
    assert first.compile()
    (library,) = (tmp_path / "lptn" / "native").glob("*.so")
    built = library.stat().st_mtime_ns
    assert second.compile()
    assert library.stat().st_mtime_ns == built


@pytest.mark.parametrize("program", ["no-such-compiler", "false"])
def test_without_a_working_compiler_the_interpreter_goes_on(monkeypatch: pytest.MonkeyPatch, program: str) -> None:
    monkeypatch.setenv("CC", program)
    compiler.cache_clear()
    try:
        model, bound, steps = _case(averaged=True)
        before = sensitivities(model, bound, model.values, range(len(model.parameters)))
        assert not steps.compile()
        after = sensitivities(model, bound, model.values, range(len(model.parameters)))
        np.testing.assert_array_equal(after.by_parameter, before.by_parameter)
    finally:
        compiler.cache_clear()
