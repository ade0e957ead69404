"""The thermal constraint in others' optimal control: the same answers as the controller of this project."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from lptn.basics.arrays import FloatArray
from lptn.basics.errors import InputError
from lptn.model.model import Model
from lptn.planners import TorqueMPC
from lptn.planners.export import ThermalConstraint, to_acados, to_do_mpc
from tests.builders import effect, leg

LIMIT, REQUEST, START, AMBIENT = 60.0, np.array([6.0, 10.0, 14.0]), np.array([50.0, 55.0, 58.0]), 25.0
MODEL = Model(leg([effect("copper_loss"), effect("resistance_rise")]))


def slope(_: float, T: FloatArray, torque: FloatArray) -> FloatArray:
    """The leg again, without the model."""
    heat = 0.15 * (1 + 0.0039 * (T - 25)) * (torque / 0.84) ** 2 - (T - AMBIENT) / 10
    heat[:2] += np.array([1, -1]) * (T[1] - T[0]) / 3
    heat[1:] += np.array([1, -1]) * (T[2] - T[1]) / 2
    return np.asarray(heat / 300)


def test_the_functions_are_what_an_integrator_finds() -> None:
    constraint = ThermalConstraint(MODEL, {"*_calf": LIMIT}, request="torque", margin=0.5)
    for torque in (REQUEST, -REQUEST):
        stepped = constraint.step(60.0)(START, torque, AMBIENT).full().ravel()
        integrated = solve_ivp(slope, (0, 60), START, args=(torque,), rtol=1e-9).y[:, -1]
        np.testing.assert_allclose(stepped, integrated, atol=1e-4)
        np.testing.assert_allclose(constraint.rate()(START, torque, AMBIENT).full().ravel(), slope(0, START, torque))
    assert constraint.excess()(START).full().ravel() == pytest.approx(58 - 59.5)
    assert (constraint.unit, constraint.conditions) == ("N*m", ("temperature.ambient",))


def test_opti_with_the_constraint_plans_as_the_controller_does() -> None:
    """A program of one's own on CasADi's Opti: 30 steps of 5 s."""
    constraint, count = ThermalConstraint(MODEL, LIMIT, request="torque"), 30
    step, excess = constraint.step(5.0), constraint.excess()
    opti = ca.Opti()
    x, u = opti.variable(3, count + 1), opti.variable(3, count)
    opti.subject_to(x[:, 0] == START)
    for k in range(count):
        opti.subject_to(x[:, k + 1] == step(x[:, k], u[:, k], AMBIENT))
        opti.subject_to(excess(x[:, k + 1]) <= 0)
    opti.subject_to(opti.bounded(0, ca.vec(u), np.tile(REQUEST, count)))
    opti.minimize(ca.sumsqr(u - ca.repmat(ca.DM(REQUEST), 1, count)))
    opti.set_initial(x, np.tile(START[:, None], count + 1))
    opti.set_initial(u, 0.5 * np.tile(REQUEST[:, None], count))
    opti.solver("ipopt", {"print_time": False, "expand": True}, {"print_level": 0, "sb": "yes"})
    solution = opti.solve()
    mpc = TorqueMPC(MODEL, LIMIT, request="torque", period=5, horizon=150, stages=count, level=0.5)
    plan = mpc.step(START, REQUEST, [AMBIENT])
    assert np.sum((solution.value(u) - REQUEST[:, None]) ** 2) / (count * REQUEST @ REQUEST) == pytest.approx(
        plan.cost, rel=1e-3
    )
    np.testing.assert_allclose(np.asarray(solution.value(u)).T, plan.currents, atol=0.05)


def test_acados_objects_are_filled() -> None:
    """Of the names that acados documents; its own trial is in the planners' page."""
    constraint = ThermalConstraint(MODEL, LIMIT, request="torque")
    ocp = SimpleNamespace(model=SimpleNamespace(), constraints=SimpleNamespace())
    to_acados(constraint, ocp, np.array([AMBIENT]))
    model = ocp.model
    given = [model.x, model.u, model.p]
    explicit = ca.Function("f", given, [model.f_expl_expr])
    np.testing.assert_allclose(explicit(START, REQUEST, AMBIENT).full().ravel(), slope(0, START, REQUEST))
    implicit = ca.Function("f", [*given, model.xdot], [model.f_impl_expr])
    assert not implicit(START, REQUEST, AMBIENT, slope(0, START, REQUEST)).full().round(12).any()
    over = ca.Function("h", [model.x], [model.con_h_expr_e])(START).full().ravel()
    np.testing.assert_allclose(over, START - LIMIT)
    assert ocp.constraints.uh.tolist() == [0, 0, 0]
    assert ocp.constraints.idxsh_e.tolist() == [0, 1, 2]
    assert ocp.parameter_values.tolist() == [AMBIENT]


@pytest.mark.filterwarnings("ignore")  # of what do-mpc asks of CasADi and NumPy
def test_do_mpc_keeps_the_limits() -> None:
    do_mpc = pytest.importorskip("do_mpc")
    constraint = ThermalConstraint(MODEL, LIMIT, request="torque")
    model = do_mpc.model.Model("continuous", "SX")
    limits = to_do_mpc(constraint, model)
    model.setup()
    mpc = do_mpc.controller.MPC(model)
    mpc.settings.n_horizon, mpc.settings.t_step = 20, 5.0
    mpc.settings.supress_ipopt_output()
    cost = ca.sumsqr(model.u["torque"] - ca.DM(REQUEST))
    mpc.set_objective(mterm=ca.SX(0), lterm=cost)
    mpc.set_rterm(torque=1e-6)
    mpc.bounds["lower", "_u", "torque"], mpc.bounds["upper", "_u", "torque"] = np.zeros(3), REQUEST
    for name in limits:
        mpc.set_nl_cons(name, model.aux[name], 0.0, soft_constraint=True, penalty_term_cons=1e3)
    around = mpc.get_tvp_template()
    around["_tvp", :, "conditions"] = AMBIENT
    mpc.set_tvp_fun(lambda now: around)
    mpc.setup()
    mpc.x0 = START
    mpc.set_initial_guess()
    admitted = mpc.make_step(START).ravel()
    plan = TorqueMPC(MODEL, LIMIT, request="torque", horizon=100, stages=20, level=0.5).step(START, REQUEST, [AMBIENT])
    np.testing.assert_allclose(admitted, plan.admitted, atol=0.3)


def test_mistakes_are_said_in_one_line() -> None:
    mistakes: tuple[dict[str, Any], ...] = (
        {"limits": {"FL_calf": 60.0}},
        {"limits": {}},
        {"limits": 60.0, "margin": -1.0},
    )
    for wrong in mistakes:
        with pytest.raises(InputError):
            ThermalConstraint(MODEL, **wrong)
    with pytest.raises(ValueError, match="positive"):
        ThermalConstraint(MODEL, LIMIT).step(0.0)
