"""Losses in |current|, |torque| and |torque x speed| follow what is decided, whoever decides: against SciPy.

The truth shares nothing with the model but its numbers: heat by hand, `solve_ivp`, a root by `brentq`.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from lptn.applications.load_sharing.sharing import StandingTemperatures
from lptn.basics.arrays import FloatArray
from lptn.basics.c_library import compiler
from lptn.basics.parameters import Parameter
from lptn.effects import NodeEffect
from lptn.effects.driver_loss import DriverLoss
from lptn.effects.excitation import INPUTS_VARY
from lptn.fmu import Session, export
from lptn.model.model import Model
from lptn.model.network import EffectDeclaration, Network
from lptn.planners import ControlLoop, Limiter, Plan, TorqueMPC
from lptn.planners.export import ThermalConstraint
from lptn.planners.heating import Request
from lptn.planners.mission.gait import gait_from_tables
from lptn.planners.mpc.reference import ReferenceProgram
from lptn.planners.trade import parse_study, solve_study
from tests.builders import AMBIENT, effect, leg, link, node
from tests.planners.test_mpc_emit import answered, built

AIR, LIMIT, WARM = 25.0, 60.0, 40.0
SPEED, CONSTANT = 3.0, 0.8  # rad/s, N*m/A


class PowerLoss(NodeEffect):
    r"""A plug-in's loss with another power of the current.

    .. math:: Q = k \, |I|^{1.5}

    Source: made up.
    """

    key = "power_loss"
    title = "loss with a power of the current"
    needs = ("current_abs",)
    parameters = (Parameter("gain", 0.4, "W/A^1.5", (0.0, 1e3), off=0.0, typical=0.4, title="loss at 1 A"),)
    signature = DriverLoss.signature
    excitation = INPUTS_VARY
    source = "made up"

    def heat(self, temperature: object, inputs: SimpleNamespace, p: SimpleNamespace) -> object:
        return p.gain * abs(inputs.current_abs) ** 1.5


def driver(at: str, quantity: str, voltage: float = 0.5) -> EffectDeclaration:
    told = effect("driver_loss", at, voltage=voltage, torque_constant=CONSTANT)
    return EffectDeclaration(DriverLoss(input=quantity), at, told.parameters)


def copper(at: str, quantity: str) -> EffectDeclaration:
    told = effect("copper_loss", at, resistance=0.15, torque_constant=CONSTANT)
    return EffectDeclaration(type(told.effect)(input=quantity), at, told.parameters)


@dataclass(frozen=True)
class Case:
    """Joints of 300 J/K with 5 K/W to the air, linked by 3 K/W, and what a joint's amount heats it with [W]."""

    losses: Callable[[str], list[EffectDeclaration]]
    heat: Callable[[float], float]
    joints: tuple[str, ...] = ("a",)
    request: Request = "current"

    @property
    def model(self) -> Model:
        links = [link(name, "ambient", 5.0) for name in self.joints]
        links += [link(self.joints[0], self.joints[1], 3.0)] if len(self.joints) > 1 else []
        losses = [loss for name in self.joints for loss in self.losses(name)]
        return Model(Network("joints", (*map(node, self.joints), AMBIENT), tuple(links), tuple(losses)))

    def course(self, amounts: FloatArray, start: FloatArray, seconds: float) -> FloatArray:
        """Temperatures after so long [degC]."""
        heat = np.array([self.heat(abs(amount)) for amount in amounts])
        across = 1 / 3.0 * (len(self.joints) > 1)

        def rates(time: float, x: FloatArray) -> FloatArray:
            return np.asarray(heat - (x - AIR) / 5 + across * (x[::-1] - x)) / 300

        return np.asarray(solve_ivp(rates, (0, seconds), start, method="LSODA", rtol=1e-10, atol=1e-10).y[:, -1])

    def largest(self, others: FloatArray, joint: int, seconds: float) -> float:
        """Amount of one joint with which the hottest node is at the limit after so long, from `WARM`."""

        def over(amount: float) -> float:
            amounts = others.copy()
            amounts[joint] = amount
            return float(self.course(amounts, np.full(len(others), WARM), seconds).max() - LIMIT)

        return float(brentq(over, 0.0, 1e4, xtol=1e-9))


KNOTS = (np.arange(9) / 8) ** 2 * 12.0


def learned(at: str) -> EffectDeclaration:
    told = effect("learned_heat", at, scale=4.0, span=12.0)
    return EffectDeclaration(type(told.effect)(input="torque"), at, told.parameters)


def curve(value: float) -> float:
    """The learned heat by hand: eight rises of 0.8 W, round at the corners, the last without end."""

    def pieces(x: float) -> FloatArray:
        left, width = KNOTS[:-1], np.diff(KNOTS)
        above, below = (x - left) / width, (x - left) / width - 1.0
        ends = np.where(np.arange(8) < 7, 1.0 - np.hypot(below, 0.1), above)
        return np.asarray(0.5 * (np.hypot(above, 0.1) + ends))

    return float(0.8 * np.sum(pieces(abs(value)) - pieces(0.0)))


CASES = {
    "drive by current": Case(lambda at: [copper(at, "current"), driver(at, "current_abs")],
                             lambda i: 0.15 * i**2 + 0.5 * i),
    "drive alone": Case(lambda at: [driver(at, "current_abs")], lambda i: 0.5 * i),
    "drive by torque": Case(lambda at: [copper(at, "torque"), driver(at, "torque_abs")],
                            lambda t: 0.15 * (t / CONSTANT) ** 2 + 0.5 * t / CONSTANT, request="torque"),
    "current asked, torque logged": Case(lambda at: [copper(at, "torque"), driver(at, "torque_abs")],
                                         lambda i: 0.15 * i**2 + 0.5 * i),
    "torque asked, drive by current": Case(lambda at: [copper(at, "torque"), driver(at, "current_abs")],
                                           lambda t: 0.15 * (t / CONSTANT) ** 2 + 0.5 * t / CONSTANT, request="torque"),
    "gear of a moving joint": Case(lambda at: [copper(at, "torque"), effect("gear_loss", at, fraction=0.2)],
                                   lambda t: 0.15 * (t / CONSTANT) ** 2 + 0.2 * t * SPEED, request="torque"),
    "another power": Case(lambda at: [copper(at, "current"), EffectDeclaration(PowerLoss(), at)],
                          lambda i: 0.15 * i**2 + 0.4 * i**1.5),
    "learned over torque": Case(lambda at: [copper(at, "torque"), learned(at)],
                                lambda t: 0.15 * (t / CONSTANT) ** 2 + curve(t), request="torque"),
    "two joints": Case(lambda at: [copper(at, "current"), driver(at, "current_abs")],
                       lambda i: 0.15 * i**2 + 0.5 * i, ("a", "b")),
    "two gears": Case(lambda at: [copper(at, "torque"), effect("gear_loss", at, fraction=0.2)],
                      lambda t: 0.15 * (t / CONSTANT) ** 2 + 0.2 * t * SPEED, ("a", "b"), "torque"),
    "squares alone": Case(lambda at: [copper(at, "current")], lambda i: 0.15 * i**2),
}  # fmt: skip
each_case = pytest.mark.parametrize("case", CASES.values(), ids=CASES)


def around(planner: Limiter | TorqueMPC) -> dict[str, float]:
    """Conditions by name."""
    return {column: AIR if column == "temperature.ambient" else -SPEED for column in planner.conditions}


@each_case
def test_the_limiter_admits_what_scipy_finds(case: Case) -> None:
    horizons = (10.0, 60.0, 300.0, np.inf)
    limiter = Limiter(case.model, LIMIT, request=case.request, horizons=horizons)
    count = len(case.joints)
    for load in (np.zeros(count), np.arange(1.0, 1 + count), np.full(count, 4.0)):
        admitted = limiter.admissible([WARM] * count, load, around(limiter))
        for joint in range(count):
            expected = [case.largest(load, joint, min(seconds, 1e5)) for seconds in horizons]
            assert admitted[joint] == pytest.approx(expected, rel=1e-4), load
        assert np.all(admitted[:, -1] <= [case.largest(load, joint, 1e5) * (1 + 1e-9) for joint in range(count)])
    both = np.arange(1.0, 1 + count)
    factor = limiter.largest_scale([WARM] * count, both, np.inf, around(limiter))
    assert case.course(factor * both, np.full(count, WARM), 1e5).max() == pytest.approx(LIMIT, abs=1e-3)


@each_case
def test_what_is_decided_may_be_given_and_changes_nothing(case: Case) -> None:
    limiter = Limiter(case.model, LIMIT, request=case.request)
    mpc = TorqueMPC(case.model, LIMIT, request=case.request)
    load = np.full(len(case.joints), 2.0)
    given = {"temperature.ambient": AIR}
    for column in limiter.heating.decided:
        given[column] = 2.0 * SPEED if column.startswith("mechanical_power") else 17.0
    start = [WARM] * len(load)
    assert np.array_equal(limiter.admissible(start, load, given), limiter.admissible(start, load, around(limiter)))
    plans = [mpc.step(start, load, given), (mpc.reset(), mpc.step(start, load, around(mpc)))[1]]
    assert np.array_equal(plans[0].temperatures, plans[1].temperatures)


def held(case: Case, planner: TorqueMPC | ControlLoop, asked: float) -> tuple[FloatArray, FloatArray, Plan | None]:
    """What is admitted in the last quarter hour of two, a row a period, the temperatures then, and the last plan."""
    mpc = planner if isinstance(planner, TorqueMPC) else planner.mpc
    count, given = len(case.joints), around(mpc)
    x, rows, plan = np.full(count, 55.0), [], None
    for _ in range(1440):
        if isinstance(planner, TorqueMPC):
            step = planner.step(x, np.full(count, asked), given)
            admitted, plan = step.admitted, step
        else:
            admitted, plan = planner.update(np.full(count, asked), x, given) * asked, planner.plan
        heat = np.array([case.heat(amount) for amount in admitted])
        across = 1 / 3.0 * (count > 1)
        for _ in range(10):
            x = x + 0.5 / 300 * (heat - (x - AIR) / 5 + across * (x[::-1] - x))
        rows.append([*admitted, *x])
    table = np.array(rows[-180:])
    return table[:, :count], table[:, count:], plan


@each_case
@pytest.mark.parametrize("face", ["mpc", "loop"])
def test_the_controller_holds_the_limit_with_all_that_it_admits(case: Case, face: str) -> None:
    mpc = TorqueMPC(case.model, LIMIT, request=case.request, margin=0.0, level=0.5, model_error=0.0)
    planner = mpc if face == "mpc" else ControlLoop(mpc, tick=5.0)
    admitted, warm, plan = held(case, planner, 30.0)
    best = brentq(lambda amount: case.heat(amount) - 7.0, 0.0, 1e3)
    assert admitted.mean() == pytest.approx(best, rel=3e-3)
    assert warm.max() <= LIMIT + 0.05
    assert plan is not None
    assert plan.converged


@each_case
def test_the_estimator_learns_nothing_from_a_model_that_is_right(case: Case) -> None:
    mpc = TorqueMPC(case.model, LIMIT, request=case.request)
    held(case, mpc, 30.0)
    assert list(mpc.parameters.values()) == pytest.approx(case.model.values.tolist(), rel=3e-3)
    assert np.array(list(mpc.bias.values())) * 300 == pytest.approx([0.0] * len(case.joints), abs=0.02)  # W


@each_case
def test_the_constraint_for_other_programs_has_the_same_rates(case: Case) -> None:
    constraint = ThermalConstraint(case.model, LIMIT, request=case.request)
    conditions = [AIR if column == "temperature.ambient" else -SPEED for column in constraint.conditions]
    amounts = np.linspace(-7.0, 5.0, 2)[: len(case.joints)]
    rates = constraint.rate()(np.full(len(amounts), AIR), amounts, conditions).full().ravel()
    assert rates * 300 == pytest.approx([case.heat(abs(amount)) for amount in amounts], rel=1e-5)


@pytest.mark.skipif(compiler() is None, reason="no C compiler")
@pytest.mark.parametrize("name", ["drive by current", "gear of a moving joint", "another power"])
def test_the_emitted_limiter_says_the_same(name: str, tmp_path: Path) -> None:
    case = CASES[name]
    limiter = Limiter(case.model, LIMIT, request=case.request)
    load, conditions = np.array([1.0]), np.array(list(around(limiter).values()))
    limiter.emit(tmp_path, np.array([WARM]), load, conditions)
    printed = answered(built(tmp_path, "admissible.c"), np.array([[WARM, *load, *conditions]]))
    assert printed.ravel() == pytest.approx(limiter.admissible([WARM], load, conditions).ravel(), rel=1e-9)


@pytest.mark.skipif(compiler() is None, reason="no C compiler")
@pytest.mark.parametrize(("name", "given"), [
    pytest.param("drive by current", {"a.current": 1.0}, marks=pytest.mark.slow),
    ("drive by torque", {"a.torque": 1.0, "a.torque_abs": 9.0}),
    pytest.param("gear of a moving joint", {"a.torque": 2.0, "a.velocity": -SPEED}, marks=pytest.mark.slow),
    pytest.param(
        "gear of a moving joint", {"a.torque": 2.0, "a.mechanical_power": 2.0 * SPEED}, marks=pytest.mark.slow
    ),
])  # fmt: skip
def test_the_fmu_admits_what_its_limit_bears(name: str, given: dict[str, float], tmp_path: Path) -> None:
    case = CASES[name]
    export(case.model, tmp_path / "joint.fmu", limits=LIMIT, admissible=True, current_limits=40.0)
    kind = "current" if "a.current" in given else "torque"
    names = [f"a.admissible_{kind}_{horizon}" for horizon in ("300s", "continuous")]
    values = {"a.temperature": WARM + 273.15, "ambient.temperature": AIR + 273.15, **given}
    with Session(tmp_path / "joint.fmu", outputs=names, values=values) as session:
        admitted = session.read(names)
    expected = [case.largest(np.zeros(1), 0, seconds) for seconds in (300.0, 1e5)]
    assert admitted == pytest.approx(expected, rel=2e-4)
    shutil.rmtree(tmp_path)


@pytest.mark.parametrize("name", ["drive by torque", "two joints"])
def test_a_robot_that_stands_warms_by_the_losses_of_its_torques(name: str) -> None:
    case = CASES[name]
    constant = None if case.request == "torque" else 1.0
    standing = StandingTemperatures(case.model, case.joints, ambient=AIR, torque_constant=constant)
    torques = np.array([4.0, 6.0])[: len(case.joints)]
    warm, _ = standing.at(np.full(len(torques), WARM), torques, 600.0)
    assert warm == pytest.approx(case.course(torques, np.full(len(torques), WARM), 600.0), abs=1e-3)


@pytest.mark.parametrize("extra", ["driver_loss", "gear_loss"])
@pytest.mark.parametrize("start", [45.0, 57.0, 62.0])
def test_the_plan_is_the_optimum_of_the_whole_program(extra: str, start: float) -> None:
    losses = [effect("copper_loss"), effect("resistance_rise"), effect(extra)]
    mpc = TorqueMPC(Model(leg(losses)), LIMIT, horizon=150, stages=30, model_error=0.0, level=0.5)
    asked = np.array([6.0, 10.0, 14.0])
    plan = mpc.step(np.full(3, start), asked, around(mpc))
    given = np.array(list(around(mpc).values()))
    reference = ReferenceProgram(mpc.heating, mpc.settings)
    best = reference.solve(np.full(3, start), np.tile(asked, (30, 1)), np.tile(given, (30, 1)))
    assert plan.converged
    assert best.converged
    assert plan.cost == pytest.approx(best.cost, rel=3e-4)
    np.testing.assert_allclose(plan.temperatures, best.temperatures, atol=0.03)


def test_a_trade_study_holds_what_the_drive_leaves(tmp_path: Path) -> None:
    losses = '[[effects]]\nkind = "{}"\nat = "winding"\n{}\n'
    model = '[model]\nambient = "temperature.ambient"\n[nodes.winding]\ncapacity = 300\n[[links]]\n'
    model += 'between = ["winding", "ambient"]\nresistance = 5\n'
    model += losses.format("copper_loss", 'input = "current"\nresistance = 0.15')
    model += losses.format("driver_loss", 'input = "current_abs"\nvoltage = 0.5')
    model += losses.format("gear_loss", "fraction = 0.1")
    (tmp_path / "motor.toml").write_text(model, encoding="utf-8")
    text = f"""[study]
goal = "held_torque"
cooling = ["none"]
[task]
speed = 20
ambient = {AIR}
duration = 80000
[limits]
winding = {LIMIT}
[[motors]]
name = "mine"
model = "motor.toml"
mass = 0.2
volume = 1e-4
magnet = "winding"
torque_constant = 0.1
"""
    (design,) = solve_study(parse_study(text, tmp_path / "study.toml")).designs
    constant = 0.1 * (1 - 0.0012 * (LIMIT - 25.0))
    current = brentq(lambda i: 0.15 * i**2 + 0.5 * i + 0.1 * constant * i * 20 - 7.0, 0.0, 100.0)
    assert design.value == pytest.approx(current * constant, rel=2e-4)


def test_a_gait_has_what_follows_from_its_torques_and_currents() -> None:
    for name in ("drive by current", "drive by torque", "gear of a moving joint"):
        model = Model(CASES[name].model.network.with_effects([effect("viscous_friction", "a")]))
        kind = "current" if "current.a" in model.inputs else "torque"
        given = {kind: {"a": 6.0}, "velocity_rms": {"a": SPEED}}
        gait = gait_from_tables("stand", [0.0], [0.0], given, model, "task.toml")
        inputs = dict(zip(model.inputs, gait.at(0.0, 0.0), strict=True))
        expected = {f"{kind}_abs.a": 6.0, "mechanical_power.a": 6.0 * SPEED}
        assert all(inputs[column] == expected[column] for column in expected if column in inputs)
