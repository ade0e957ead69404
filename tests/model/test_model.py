"""The assembled model: steps, runs, copies at other values."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from scipy.linalg import expm

from lptn.basics.arrays import FloatArray
from lptn.basics.parameters import Parameter
from lptn.model.model import Method, Model
from lptn.model.network import Network, NodeDeclaration
from tests.builders import AMBIENT, effect, leg, link, node, random_inputs, with_every_effect

TEN_WATTS = [effect("constant_heat", "FR_calf", power=10.0), effect("second_mass", "FR_hip")]
START = np.array([40.0, 25.0, 31.0, 22.0])
AIR = np.array([20.0])


@pytest.fixture(scope="module")
def model() -> Model:
    return Model(leg(TEN_WATTS))


def _exact(model: Model, x: FloatArray, h: float) -> FloatArray:
    """x(h) of dx/dt = A x + b by the matrix exponential of the augmented system."""
    n = len(x)
    augmented = np.zeros((n + 1, n + 1))
    augmented[:n, :n] = model.state_jacobian(x, AIR, model.values).full()
    augmented[:n, n] = model.rhs(x, AIR, model.values).full().ravel() - augmented[:n, :n] @ x
    moved: FloatArray = (expm(h * augmented) @ np.append(x, 1.0))[:n]
    return moved


@pytest.mark.parametrize("h", [1.0, 300.0, 3000.0, 100_000.0])
def test_zero_order_hold_equals_the_matrix_exponential(model: Model, h: float) -> None:
    following = model.step("zoh")(START, AIR, model.values, h).full().ravel()
    np.testing.assert_allclose(following, _exact(model, START, h), rtol=1e-12)


def test_zero_order_hold_needs_no_way_out() -> None:
    """Without ambient the matrix is singular; a formula with its inverse would fail."""
    closed = Model(leg([effect("constant_heat", "FR_calf", power=9.0)], ambient=None))
    end = closed.step("zoh")([30.0, 30.0, 30.0], [], closed.values, 1000.0).full()
    assert end.sum() == pytest.approx(90.0 + 9.0 * 1000.0 / 300.0, rel=1e-12)


def test_euler_is_x_plus_h_times_f(model: Model) -> None:
    expected = START + 7.0 * model.rhs(START, AIR, model.values).full().ravel()
    np.testing.assert_allclose(model.step("euler")(START, AIR, model.values, 7.0).full().ravel(), expected, rtol=1e-15)


@pytest.mark.parametrize(("share", "grows"), [(0.95, False), (1.05, True)])
def test_euler_is_stable_below_two_over_the_fastest_rate(model: Model, share: float, grows: bool) -> None:
    rates, modes = np.linalg.eig(model.state_jacobian(START, AIR, model.values).full())
    fastest = int(np.argmax(np.abs(rates)))
    rest = np.linalg.solve(
        model.state_jacobian(START, AIR, model.values).full(),
        -model.rhs(np.zeros(4), AIR, model.values).full().ravel(),
    )
    h = share * 2.0 / abs(rates[fastest])
    x = rest + modes[:, fastest].real
    end = model.run(40, "euler")(x, np.full((1, 40), 20.0), model.values, h).full()[:, -1]
    away, before = float(np.linalg.norm(end - rest)), float(np.linalg.norm(x - rest))
    assert away > 5.0 * before if grows else away < 0.2 * before


def test_rk4_is_of_fourth_order(model: Model) -> None:
    def error(h: float) -> float:
        return float(np.abs(model.step()(START, AIR, model.values, h).full().ravel() - _exact(model, START, h)).max())

    assert error(20.0) / error(10.0) == pytest.approx(32.0, rel=0.2)


@pytest.mark.parametrize("method", ["rk4", "euler", "zoh"])
def test_a_run_is_that_many_steps(model: Model, method: Method) -> None:
    inputs = np.random.default_rng(1).uniform(15.0, 30.0, (1, 9))
    path = model.run(9, method)(START, inputs, model.values, 2.0).full()
    x = START
    for k in range(9):
        x = model.step(method)(x, inputs[:, k], model.values, 2.0).full().ravel()
        np.testing.assert_array_equal(path[:, k], x)


def test_linear_and_nonlinear_models_are_told_apart(model: Model) -> None:
    assert model.is_linear
    assert Model(leg([effect("copper_loss"), effect("resistance_rise")])).is_linear
    assert Model(leg([effect("forced_convection")])).is_linear
    assert not Model(leg([effect("natural_convection")])).is_linear
    assert not Model(leg([effect("radiation")])).is_linear
    assert not Model(leg([effect("copper_loss"), effect("torque_constant_drop")])).is_linear


def test_zero_order_hold_of_a_nonlinear_model_is_refused_in_one_line() -> None:
    with pytest.raises(ValueError, match="leg: not linear") as caught:
        Model(leg([effect("radiation")])).step("zoh")
    assert "\n" not in str(caught.value)


def test_other_values_share_the_functions(model: Model) -> None:
    other = model.with_values(model.values * 1.01)
    assert other.rhs is model.rhs
    assert other.step() is model.step()


def test_other_values_leave_the_model_alone(model: Model) -> None:
    before = model.values.copy()
    other = model.with_values(before * 1.01)
    np.testing.assert_allclose(other.values, before * 1.01, rtol=1e-15)
    np.testing.assert_array_equal(model.values, before)
    assert [parameter.value for parameter in other.network.parameters] == other.values.tolist()


def test_a_model_travels_to_another_process_as_it_is(model: Model) -> None:
    other = pickle.loads(pickle.dumps(model.with_values(model.values * 1.01)))
    x = model.rhs(START, AIR, model.values * 1.01)
    np.testing.assert_array_equal(other.rhs(START, AIR, other.values).full(), x.full())
    assert other.states == model.states


def test_states_know_the_node_they_belong_to() -> None:
    model = Model(leg([effect("second_mass", "FR_calf"), effect("sensor_lag", "FR_hip")]))
    assert model.states[3:] == ["second_mass.FR_calf", "sensor_lag.FR_hip"]
    assert model.owners == [0, 1, 2, 2, 0]


def test_inputs_are_log_columns_named_once() -> None:
    model = Model(leg([effect("viscous_friction"), effect("iron_loss"), effect("forced_convection")]))
    assert sorted(model.inputs) == sorted(
        ["temperature.ambient", "speed.base", *(f"velocity_rms.{name}" for name in model.nodes)]
    )


def test_an_ambient_taken_from_the_start_is_an_input_without_a_column() -> None:
    network = Network("n", (node("a"), NodeDeclaration("air", temperature="start")), (link("a", "air"),))
    model = Model(network)
    assert model.inputs == model.started == ["temperature.air"]


def test_a_free_ambient_temperature_is_a_parameter() -> None:
    air = NodeDeclaration("air", temperature=Parameter("temperature", 18.0, "degC", (-40.0, 60.0)))
    model = Model(Network("n", (node("a", 100.0), air), (link("a", "air", 2.0),)))
    assert model.inputs == []
    assert model.parameters[-2].name == "temperature.air"
    assert float(model.rhs([28.0], [], model.values)) == pytest.approx(-10.0 / 2.0 / 100.0)


def test_parameter_jacobian_equals_finite_differences() -> None:
    model, rng = Model(with_every_effect()), np.random.default_rng(2)
    x = rng.uniform(20.0, 80.0, len(model.states))
    u = list(random_inputs(model, rng).values())
    p = model.values
    exact = model.parameter_jacobian(x, u, p).full()
    for column, value in enumerate(p):
        e = np.zeros_like(p)
        e[column] = 1e-5 * (abs(value) or 1.0)
        slope = (model.rhs(x, u, p + e) - model.rhs(x, u, p - e)).full().ravel() / (2 * e[column])
        rounding = 1e-15 * float(abs(model.rhs(x, u, p).full()).max()) / e[column]
        atol = 1e-7 * np.abs(slope).max() + 1e-12 + rounding
        np.testing.assert_allclose(exact[:, column], slope, rtol=1e-6, atol=atol)


def test_two_links_from_one_node_add_up() -> None:
    coolant = NodeDeclaration("coolant", temperature="temperature.coolant")
    network = Network("n", (node("a", 100.0), AMBIENT, coolant), (link("a", "ambient", 2.0), link("a", "coolant", 5.0)))
    model = Model(network)
    inputs = {"temperature.ambient": 20.0, "temperature.coolant": 10.0}
    rate = float(model.rhs([60.0], [inputs[c] for c in model.inputs], model.values))
    assert rate == pytest.approx(-(40.0 / 2.0 + 50.0 / 5.0) / 100.0, rel=1e-14)
