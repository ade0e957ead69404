"""The written functions are the model: against CasADi, closed forms and numbers worked by hand."""

from __future__ import annotations

import ctypes
import sys
from math import log
from pathlib import Path
from types import ModuleType
from typing import Any

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lptn.basics.arrays import FloatArray
from lptn.basics.c_library import compiler, shared_library
from lptn.basics.errors import InputError
from lptn.basics.parameters import Parameter
from lptn.batch import export, functions
from lptn.effects import NodeEffect
from lptn.model.model import Model
from lptn.model.network import EffectDeclaration
from tests.batch.cases import CASES, EVERY, FILES, Points, model_of
from tests.builders import effect, two_nodes
from tests.docs.pages import ROOT, Page
from tests.hardening.test_network_properties import Drawn, drawn

DAY = 86400  # s, a day
every_case = pytest.mark.parametrize("case", CASES)
needs_compiler = pytest.mark.skipif(compiler() is None, reason="no C compiler")


def _jax() -> Any:
    jax = pytest.importorskip("jax", reason="JAX is not installed: pip install 'lptn[jax]'")
    jax.config.update("jax_enable_x64", True)
    return jax


def _torch() -> Any:
    return pytest.importorskip("torch", reason="PyTorch is not installed: pip install 'lptn[torch]'")


def _close(found: Any, expected: FloatArray, relative: float = 1e-12) -> None:
    np.testing.assert_allclose(
        np.asarray(found), expected, rtol=relative, atol=relative * np.abs(expected).max(initial=0.0)
    )


def _check(points: Points, heat: ModuleType, array: Any) -> None:
    state = heat.State(array(points.x), array(np.zeros_like(points.x)))
    after = heat.step(state, array(points.u), array(points.p), points.seconds, 1)
    moved = points.step() - points.x
    _close(after.temperature, points.x + moved)
    _close(np.asarray(after.temperature) - points.x, moved, 1e-9)  # 90 degC hide what a step of seconds adds
    _close(heat.outputs(state, array(points.u), array(points.p))["readings"], points.readings())


@every_case
def test_a_step_of_arrays_is_casadis(case: str) -> None:
    heat = functions(model_of(case))
    _check(Points(model_of(case), heat.LONGEST_STEP / 4), heat, np.asarray)


@every_case
def test_a_step_of_pytorch_and_its_gradients_are_casadis(case: str) -> None:
    torch, model = _torch(), model_of(case)
    heat = functions(model, "torch")
    points = Points(model, heat.LONGEST_STEP / 4)
    _check(points, heat, torch.tensor)
    weights = np.linspace(0.5, 1.5, len(model.states))
    x, u, p = (torch.tensor(array, requires_grad=True) for array in (points.x, points.u, points.p))
    after = heat.step(heat.State(x, torch.zeros_like(x)), u, p, points.seconds, 1)
    (after.temperature * torch.tensor(weights)).sum().backward()
    for found, expected in zip((x, u, p), points.gradients(weights), strict=True):
        _close(torch.zeros_like(found) if found.grad is None else found.grad, expected, 1e-9)


@pytest.mark.long
@pytest.mark.parametrize("case", [EVERY, *FILES])
def test_a_compiled_step_of_jax_and_its_gradients_are_casadis(case: str) -> None:
    jax, model = _jax(), model_of(case)
    heat = functions(model, "jax")
    points = Points(model, heat.LONGEST_STEP / 4)
    weights = np.linspace(0.5, 1.5, len(model.states))

    def after(x: Any, u: Any, p: Any) -> Any:
        return heat.step(heat.State(x, 0 * x), u, p, points.seconds, 1).temperature

    def total(x: Any, u: Any, p: Any) -> Any:
        end = after(x, u, p)
        return (end * weights).sum(), end

    gradients, end = jax.jit(jax.grad(total, (0, 1, 2), has_aux=True))(points.x, points.u, points.p)
    _close(end, points.step())
    for found, expected in zip(gradients, points.gradients(weights), strict=True):
        _close(found, expected, 1e-9)
    if case == FILES[0]:
        _close(jax.vmap(after)(points.x, points.u, points.p), points.step())


@given(robot=drawn(), seed=st.integers(0, 99))
@settings(max_examples=40, deadline=None)
def test_a_step_of_any_network_is_casadis(robot: Drawn, seed: int) -> None:
    model = Model(robot.network())
    heat = functions(model)
    _check(Points(model, min(heat.LONGEST_STEP / 4, 100.0), robots=2, seed=seed), heat, np.asarray)


# --- a day in single precision ----------------------------------------------------------------------------------------


def _day(model: Model, robots: int, seed: int = 1) -> tuple[FloatArray, FloatArray]:
    """Inputs of each half hour of a day, shape (48, robots, inputs), and parameters, shape (robots, parameters)."""
    rng = np.random.default_rng(seed)
    air = np.array([column.startswith("temperature.") for column in model.inputs], dtype=bool)
    shape = (48, robots, len(model.inputs))
    inputs = np.where(air, rng.uniform(15.0, 30.0, shape), rng.uniform(0.0, 2.0, shape))
    return inputs, np.tile(model.values, (robots, 1))


@needs_compiler
@pytest.mark.long
@every_case
def test_a_day_in_single_precision_is_that_in_double(case: str, tmp_path: Path) -> None:
    model = model_of(case)
    export(model, tmp_path / "heat.c", "c")
    text, ends = (tmp_path / "heat.c").read_text(), []
    inputs, parameters = _day(model, 1)
    for kind, name, real in ((np.float64, "double", ctypes.c_double), (np.float32, "float", ctypes.c_float)):
        # Of floats nothing may become double: a microcontroller calculates with floats alone.
        flags = ("-O2", "-std=c99", "-Wall", "-Wextra", "-Wdouble-promotion", "-Werror", f"-DHEAT_REAL={name}")
        library = ctypes.CDLL(str(shared_library({"heat.c": text}, "heat.c", flags)))
        state, rest = np.empty(len(model.states), kind), np.empty(len(model.states), kind)
        p, us = parameters[0].astype(kind), inputs[:, 0].astype(kind)
        library.heat_initial(*_pointers(state, rest, p), real(22.0))
        if kind is np.float64:  # the start and a step are CasADi's, too
            expected = model.step()(state, us[0], p, 0.5).full().ravel()
            one, other = state.copy(), rest.copy()
            library.heat_step(*_pointers(one, other, us[0], p), real(0.5))
            _close(one, expected)
        for u in us:
            arguments = _pointers(state, rest, u, p)
            for _ in range(DAY // 48):
                library.heat_step(*arguments, real(1.0))
        ends.append(state.astype(float))
    assert np.isfinite(ends[0]).all()
    # A clock that runs for a day at 1 K/s is the one state of other size.
    np.testing.assert_allclose(ends[1], ends[0], rtol=1e-7, atol=1e-3)


def _pointers(*arrays: Any) -> list[ctypes.c_void_p]:
    return [ctypes.c_void_p(array.ctypes.data) for array in arrays]


@pytest.mark.long
def test_a_day_of_jax_in_single_precision_is_that_in_double() -> None:
    jax, model, seconds = _jax(), model_of("src/lptn/robots/single-motor.full.toml"), 0.02
    heat = functions(model, "jax")
    inputs, parameters = _day(model, 3)
    ends = {}
    for kind, kept in ((np.float64, 1.0), (np.float32, 1.0), (np.float32, 0.0)):
        p = jax.numpy.asarray(parameters, kind)

        def hold(state: Any, u: Any, p: Any = p, kept: float = kept) -> Any:
            def one(state: Any, _: Any) -> Any:
                after = heat.step(state, u, p, seconds, 1)
                return heat.State(after.temperature, kept * after.rest), None

            return jax.lax.scan(one, state, None, length=round(DAY / 48 / seconds))[0], None

        start = heat.initial(p, 22.0)
        end, _ = jax.jit(lambda state, us, hold=hold: jax.lax.scan(hold, state, us))(start, inputs.astype(kind))
        ends[kind, kept] = np.asarray(end.temperature, dtype=float)
    np.testing.assert_allclose(ends[np.float32, 1.0], ends[np.float64, 1.0], rtol=0, atol=1e-3)
    lost = np.abs(ends[np.float32, 0.0] - ends[np.float64, 1.0]).max()
    assert lost > 1e-3  # without the compensated sum


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::DeprecationWarning")  # PyTorch's compiler warns of itself
def test_what_pytorch_compiles_keeps_the_rest_of_each_sum() -> None:
    torch, model = _torch(), model_of("src/lptn/robots/single-motor.full.toml")
    heat = functions(model, "torch")
    inputs, parameters = (torch.tensor(array) for array in _day(model, 3))

    def half_a_minute(dtype: Any, step: Any) -> Any:
        p, u = parameters.to(dtype), inputs[0].to(dtype)
        state = heat.initial(p, 22.0)
        for _ in range(15000):
            state = step(state, u, p)
        return state.temperature.double()

    def step(state: Any, u: Any, p: Any) -> Any:
        return heat.step(state, u, p, 0.002)

    compiled = torch.compile(step, dynamic=False)
    exact = half_a_minute(torch.float64, compiled)
    kept = half_a_minute(torch.float32, compiled)
    lost = half_a_minute(torch.float32, lambda state, u, p: step(heat.State(state.temperature, 0 * state.rest), u, p))
    assert (kept - exact).abs().max() < 1e-5
    assert (lost - exact).abs().max() > 1e-4


# --- what else the functions say --------------------------------------------------------------------------------------


def _motor() -> Model:
    """Two nodes, with a torque at one of them."""
    return Model(two_nodes([effect("copper_loss", "a", resistance=0.5, torque_constant=0.5)], linked=False))


def test_axes_of_robots_broadcast() -> None:
    heat = functions(_motor(), limits={"a": 60.0})
    params = np.asarray(heat.VALUES)
    state = heat.initial(params, 20.0)
    assert state.temperature.shape == (2,)
    inputs = np.zeros((3, 1, len(heat.INPUTS)))
    inputs[..., heat.INPUTS.index("torque.a")] = np.arange(3.0)[:, None]
    after = heat.step(state, inputs, np.tile(params, (4, 1)), 5.0)
    assert after.temperature.shape == after.rest.shape == (3, 4, 2)
    one = heat.step(state, inputs[2, 0], params, 5.0)
    np.testing.assert_array_equal(after.temperature[2, 1], one.temperature)
    assert heat.outputs(state, inputs, params)["margins"].shape == (3, 1, 1)


def test_a_long_step_is_divided() -> None:
    heat = functions(_motor())
    params, inputs = np.asarray(heat.VALUES), np.array([20.0, 3.0])
    start, dt = heat.initial(params, 20.0), 5.5 * heat.LONGEST_STEP
    whole = heat.step(start, inputs, params, dt)
    for _ in range(6):
        start = heat.step(start, inputs, params, dt / 6)
    np.testing.assert_allclose(whole.temperature, start.temperature, rtol=1e-14)


def test_margins_torque_scale_and_time_to_limit_are_those_of_one_node_in_closed_form() -> None:
    heat = functions(_motor(), limits={"a": 60.0})
    assert (heat.LIMITED, heat.JOINTS) == (("a",), ("a",))
    params, inputs = np.asarray(heat.VALUES), np.array([20.0, 2.5])
    power, resistance, capacity = 0.5 * (2.5 / 0.5) ** 2, 4.0, 120.0
    state = heat.State(np.array([[20.0, 20.0], [54.0, 20.0], [60.0, 20.0]]), np.zeros((3, 2)))
    said = heat.outputs(state, inputs, params, horizon=1000.0)
    np.testing.assert_allclose(said["margins"][:, 0], [40.0, 6.0, 0.0])
    np.testing.assert_allclose(said["torque_scale"][:, 0], [1.0, 0.6, 0.0])
    settles, tau = 20.0 + power * resistance, resistance * capacity
    expected = [tau * log((settles - start) / (settles - 60.0)) for start in (20.0, 54.0)]
    np.testing.assert_allclose(said["time_to_limit"][:, 0], [*expected, 0.0], rtol=1e-3)
    never = heat.outputs(state, np.array([20.0, 1.0]), params, horizon=1000.0)
    assert never["time_to_limit"][0, 0] == 1000.0
    warmer = heat.outputs(state, inputs, params, limits=np.array([70.0]))
    np.testing.assert_allclose(warmer["margins"][:, 0], [50.0, 16.0, 10.0])


def test_robots_scatter_by_the_standard_errors() -> None:
    network = _motor().network
    names = [parameter.name for parameter in network.parameters]
    errors = {"capacity.a": 12.0, "resistance.a~ambient": 0.2}
    model = Model(network, {name: error for name, error in errors.items() if name in names})
    assert len(model.standard_errors) == 2
    heat = functions(model)
    nominal = np.asarray(heat.VALUES)
    robots = heat.randomized(np.random.default_rng(0), np.tile(nominal, (20000, 1)), 2.0)
    for k, name in enumerate(heat.PARAMETERS):
        scatter = np.log(robots[:, k] / nominal[k]).std() if name in errors else np.ptp(robots[:, k])
        assert scatter == pytest.approx(2.0 * errors.get(name, 0.0) / nominal[k], rel=0.03)
    with pytest.raises(ValueError, match="model: found no standard errors of a fit; expected some"):
        functions(_motor()).randomized(np.random.default_rng(0), nominal)


def test_the_start_is_as_warm_as_what_the_model_prescribes() -> None:
    model = model_of("examples/heated_block/one_node.toml")
    heat = functions(model)
    state = heat.initial(np.asarray(heat.VALUES), np.array([20.0, 30.0]))
    np.testing.assert_array_equal(state.temperature, [[20.0], [30.0]])


class _Odd(NodeEffect):
    """A plug-in's heat with operations that no effect of the catalogue has."""

    key = "odd"
    parameters = (Parameter("size", 1.0, "W", off=0.0),)

    def heat(self, temperature: Any, inputs: Any, p: Any) -> Any:
        warm = temperature / 50
        picked = ca.if_else(ca.logic_and(warm > 0.4, ca.logic_not(warm > 0.9)), ca.atan2(warm, 2.0), ca.tanh(warm))
        bounded = ca.fmin(ca.fmax(warm, 0.3), 0.8) + ca.hypot(warm, 0.5) + ca.erf(warm) + ca.sign(warm - 1)
        return p.size * (picked + bounded + ca.remainder(warm, 0.7) + ca.fmod(warm, 0.6) + ca.log1p(ca.fabs(warm)))


@pytest.mark.parametrize("to", ["numpy", "torch", "jax"])
def test_operations_of_a_plug_in_are_casadis(to: Any) -> None:
    array = np.asarray if to == "numpy" else _torch().tensor if to == "torch" else _jax().numpy.asarray
    model = Model(two_nodes([EffectDeclaration(_Odd(), "*", _Odd.parameters)], linked=True))
    _check(Points(model, 5.0, robots=40), functions(model, to), array)


def test_what_is_not_there_is_said_in_one_line(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="found 'numba'; expected one of jax, torch, numpy, c"):
        functions(_motor(), "numba")  # type: ignore[arg-type]
    with pytest.raises(InputError, match=r'limits\."knee": found no such place'):
        export(_motor(), tmp_path / "heat.py", limits={"knee": 60.0})
    assert not list(tmp_path.iterdir())
    monkeypatch.setitem(sys.modules, "torch", None)
    with pytest.raises(InputError, match=r"torch: found not installed; expected pip install 'lptn\[torch\]'"):
        functions(_motor(), "torch", limits=99.0)


def test_the_page_runs_as_it_stands(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    plain, with_jax = Page("", (ROOT / "src/site/pages/how_to/learning.md").read_text(encoding="utf-8")).blocks(
        "python"
    )
    monkeypatch.chdir(ROOT)
    exec(plain, {})
    _jax()
    export(_motor(), tmp_path / "heat.py", limits=60.0)
    monkeypatch.syspath_prepend(tmp_path)
    exec(with_jax, {})
