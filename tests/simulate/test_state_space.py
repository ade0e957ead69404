"""The state-space form: what the model says, exactly held; and where Euler fails."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from lptn.basics.errors import InputError
from lptn.model.model import Model
from lptn.simulate.dynamics import zero_order_hold
from lptn.simulate.state_space import StateSpace, state_space
from tests.builders import effect, leg, random_inputs, two_nodes, with_every_effect


def _at(model: Model, seed: int = 0) -> tuple[StateSpace, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    x = rng.uniform(15.0, 60.0, len(model.states))
    u = np.array(list(random_inputs(model, rng).values()))
    return state_space(model, x, u), x, u


def _block(capacity: float, resistance: float) -> StateSpace:
    values = {"capacity.a": capacity, "resistance.a~ambient": resistance}
    model = Model(two_nodes([effect("constant_heat", power=25.0)]).with_values(values))
    return state_space(model, np.full(2, 20.0), np.array([20.0]))


def test_the_form_gives_the_models_own_rates() -> None:
    for network in (leg([effect("copper_loss")]), with_every_effect()):
        model = Model(network)
        form, x, u = _at(model)
        rates = model.rhs(x, u, model.values).full().ravel()
        nodes = len(model.nodes)  # the states of effects have an offset of their own where they aren't linear
        np.testing.assert_allclose((form.A @ x + form.B @ form.u)[:nodes], rates[:nodes], rtol=1e-9, atol=1e-12)


def test_of_a_linear_network_it_holds_everywhere() -> None:
    model = Model(leg([effect("copper_loss")]))
    form, x, u = _at(model)
    other = x + np.array([3.0, -8.0, 15.0])
    np.testing.assert_allclose(form.A @ other + form.B @ form.u, model.rhs(other, u, model.values).full().ravel())
    np.testing.assert_array_equal(form.C, np.eye(3))
    assert form.inputs == ("heat.FR_hip", "heat.FR_thigh", "heat.FR_calf", "temperature.ambient")


def test_its_jacobian_is_the_models_at_any_temperature_and_speed() -> None:
    model = Model(with_every_effect())
    form, x, u = _at(model, seed=3)
    for column in range(len(x)):
        e = np.zeros(len(x))
        e[column] = 1e-4
        difference = (model.rhs(x + e, u, model.values) - model.rhs(x - e, u, model.values)).full().ravel() / 2e-4
        np.testing.assert_allclose(form.A[:, column], difference, rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize("ambient", [10.0, None])
def test_signs_are_those_of_heat_that_flows_from_hot_to_cold(ambient: float | None) -> None:
    form, _, _ = _at(Model(leg([effect("copper_loss")], ambient)))
    assert np.sum(form.eigenvalues > -1e-12) == (ambient is None)
    assert np.all(form.eigenvalues <= 1e-12)


def test_exact_steps_are_those_of_an_independent_integration() -> None:
    form, x, _ = _at(Model(leg([effect("copper_loss")])))
    g, h = form.exact(45.0)
    solved = solve_ivp(lambda _, y: form.A @ y + form.B @ form.u, (0, 45.0), x, rtol=1e-10, atol=1e-10)
    np.testing.assert_allclose(g @ x + h @ form.u, solved.y[:, -1], rtol=1e-8)


@pytest.mark.parametrize(
    ("capacity", "resistance", "step", "share"),
    [(57.0, 2.1, 1.0, -0.0042), (24.0, 0.54, 1.0, -0.039), (2.0, 1.0, 1.0, -0.28)],
)
def test_euler_makes_fast_masses_faster(capacity: float, resistance: float, step: float, share: float) -> None:
    tau = capacity * resistance
    seen = -step / np.log(1 - step / tau)  # the time constant that G = I + hA shows
    assert seen / tau - 1 == pytest.approx(share, abs=0.01)
    assert _block(capacity, resistance).time_constants[0] == pytest.approx(tau)


def test_euler_is_refused_where_it_blows_up() -> None:
    form = _block(0.4, 1.0)
    assert form.euler_stable == pytest.approx(0.8)
    with pytest.raises(InputError, match=r"step 1 s: found a step that blows up; expected at most 0.8 s"):
        form.euler(1.0)
    form.euler(0.79)


def test_eulers_error_grows_with_its_step_and_the_admissible_step_is_found() -> None:
    form = _block(300.0, 1.69)
    errors = [form.euler_error(step, 600.0) for step in (1.0, 5.0, 10.0, 60.0)]
    assert errors == sorted(errors)
    assert errors[1] == pytest.approx(5 * errors[0], rel=0.05)
    step = form.euler_step(0.1, 600.0)
    assert form.euler_error(step, 600.0) <= 0.1 < form.euler_error(1.1 * step, 600.0)


@pytest.mark.parametrize("fastest", [1e-6, 0.3, 40.0, 3e4])
def test_the_exact_hold_is_scipys_exponential(fastest: float) -> None:
    rng = np.random.default_rng(3)
    a = rng.uniform(0.0, 1.0, (4, 5, 5))
    a[:, range(5), range(5)] = -a.sum(axis=2) - rng.uniform(0.0, 1.0, (4, 5))  # heat that flows, and is lost
    a[0] = np.diag(np.ones(4), 1) - np.eye(5)  # one rate five times over, with a single eigenvector
    a[1] = 0.0
    a *= fastest / np.abs(a).max()
    transition, integral = zero_order_hold(a, 2.0)
    for k in range(4):
        whole = expm(2.0 * np.block([[a[k], np.eye(5)], [np.zeros((5, 10))]]))
        np.testing.assert_allclose(transition[k], whole[:5, :5], atol=1e-11)
        np.testing.assert_allclose(integral[k], whole[:5, 5:], atol=1e-11)


def test_the_exact_hold_of_rates_that_are_not_finite_is_no_number() -> None:
    assert np.isnan(zero_order_hold(np.full((2, 3, 3), np.inf), 1.0)).all()
