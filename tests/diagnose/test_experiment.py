"""The proposed experiment on a leg of two joints: does it separate the rivals, and is it the known good kind?

The truth is integrated by SciPy with equations written out here.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from lptn.basics.arrays import FloatArray
from lptn.diagnose.answers import Step
from lptn.diagnose.candidates import candidates
from lptn.diagnose.experiment import Experiment, Move, Rivals, Stage, propose
from lptn.diagnose.fit_statistics import criterion_difference
from lptn.diagnose.refits import refit
from lptn.identify.data import split_data
from lptn.identify.fitting import finished, fit
from lptn.identify.validation import fit_segments
from lptn.logs.run import Run
from lptn.model.file import parse_model
from lptn.model.model import Model
from lptn.simulate.bound_run import bind
from lptn.simulate.simulation import Sensitivities

JOINTS = ("L_knee", "R_knee")
CAPACITY, TO_AIR, LINK, COPPER = 300.0, 6.0, 3.0, 0.15 / 0.84**2
STEP, NOISE, AIR = 10.0, 0.1, 22.0
SIGMA, KELVIN = 5.67e-8, 273.15
TIE = 10.0  # of information criteria; closer ones decide nothing

MODEL = """
[model]
name = "two knees"
joints = ["L_knee", "R_knee"]
ambient = "temperature.ambient"
[nodes."*"]
capacity = { value = 250, unit = "J/K", bounds = [20, 3000] }
[[links]]
between = ["*", "ambient"]
resistance = { value = 8, unit = "K/W", bounds = [0.5, 200] }
[[links]]
between = ["L_knee", "R_knee"]
resistance = { value = 4, unit = "K/W", bounds = [0.05, 200] }
[[effects]]
kind = "copper_loss"
at = "*"
resistance = 0.15
torque_constant = 0.84
"""
ONE_BY_CURRENT = """
[[effects]]
kind = "copper_loss"
at = "R_knee"
input = "current"
resistance = 0.15
"""


@dataclass(frozen=True)
class Truth:
    """What the knees really have beyond the model, in SI units, heat and offset at the left one; the sensors' step."""

    area: float = 0.0
    beta: float = 0.0
    coulomb: float = 0.0
    viscous: float = 0.0
    heat: float = 0.0
    offset: float = 0.0
    coarse: float = 0.0

    def measured(self, columns: dict[str, FloatArray], start: FloatArray, rng: np.random.Generator) -> FloatArray:
        """Readings [degC], shape (2, n): means over steps, with noise."""
        torque, speed = (np.array([columns[f"{name}.{joint}"] for joint in JOINTS]) for name in ("torque", "velocity"))
        rms, air = np.array([columns[f"velocity_rms.{joint}"] for joint in JOINTS]), columns["temperature.ambient"]
        heat = COPPER * torque**2 + self.coulomb * speed + self.viscous * rms**2 + np.array([[self.heat], [0.0]])

        def rates(step: int) -> Callable[[float, FloatArray], FloatArray]:
            def rate(_: float, x: FloatArray) -> FloatArray:
                lost = (x - air[step]) / TO_AIR * np.exp(self.beta * (x - air[step]))
                lost = lost + SIGMA * self.area * ((x + KELVIN) ** 4 - (air[step] + KELVIN) ** 4)
                return np.asarray((heat[:, step] - lost + (x[::-1] - x) / LINK) / CAPACITY)

            return rate

        means, state = np.empty(torque.shape), start
        for step in range(torque.shape[1]):
            done = solve_ivp(rates(step), (0.0, STEP), state, rtol=1e-7, atol=1e-7)
            means[:, step], state = 0.5 * (state + done.y[:, -1]), done.y[:, -1]
        seen = means + np.array([[self.offset], [0.0]]) + rng.normal(0.0, NOISE, means.shape)
        return np.asarray(np.round(seen / self.coarse) * self.coarse if self.coarse else seen)


def _run(name: str, columns: dict[str, FloatArray], readings: FloatArray, coarse: float = 0.0) -> Run:
    whole = columns | {f"temperature.{joint}": row for joint, row in zip(JOINTS, readings, strict=True)}
    n = readings.shape[1]
    steps = {f"temperature.{joint}": coarse for joint in JOINTS if coarse}
    return Run(name, STEP, np.arange(n, dtype=np.float64) * STEP, whole, True, f"{name}.csv", "", resolution=steps)


def _log(truth: Truth, torque: float, speed: float, minutes: int) -> Run:
    """A log in which both knees carry load and move together, with a pause; already warm at its beginning."""
    n, rng = 6 * minutes, np.random.default_rng(5)
    busy = np.where((np.arange(n) // 90) % 4 == 2, 0.0, 1.0)
    columns = {"temperature.ambient": np.full(n, AIR)}
    for joint, share in zip(JOINTS, (1.0, 0.7), strict=True):
        wander = 1 + 0.05 * np.sin(np.arange(n) / 25 * share)
        columns |= {
            f"torque.{joint}": torque * share * busy * wander,
            f"velocity.{joint}": speed * busy,
            f"velocity_rms.{joint}": 1.11 * speed * busy,
        }
    return _run("walk", columns, truth.measured(columns, np.array([41.0, 35.0]), rng), truth.coarse)


@cache
def _model(text: str = MODEL) -> Model:
    return Model(parse_model(text, Path("knees.toml")).network)


def _refits(runs: tuple[Run, ...], keys: tuple[tuple[str, str], ...], model: str = MODEL) -> list[Step]:
    """Both rivals refitted, the one that explains more first."""
    base = fit_segments(_model(model), split_data(runs).fit)
    rivals = [candidate for candidate in candidates(_model(model).network, runs[0].columns) if candidate.key in keys]
    steps = [Step(finished(refit(base, one)), one) for one in (rival.declaration() for rival in rivals)]
    return sorted(steps, key=lambda step: step.fit.cost)


def _are_told_apart(better: Step, worse: Step) -> bool:
    return criterion_difference(worse.fit, better.fit) > TIE


@dataclass(frozen=True)
class Case:
    """A truth, its name, its rival's name, and the log: torque [N*m], speed [rad/s], minutes."""

    truth: Truth
    name: tuple[str, str]
    rival: tuple[str, str]
    torque: float
    speed: float
    minutes: int = 60

    def before(self) -> tuple[Run, list[Step]]:
        """The log, and the rivals on it."""
        return _before(self)

    def after(self, experiment: Experiment) -> list[Step]:
        """The rivals on the log and on the proposed run, as the truth would have it."""
        log, _ = self.before()
        inputs = {
            name: np.asarray(experiment.run.columns[name]) if name in experiment.run.columns else zero
            for name, zero in ((name, np.zeros(len(experiment.run))) for name in log.columns)
            if not name.startswith("temperature.") or name == "temperature.ambient"
        }
        start = np.full(2, experiment.program.ambient)
        done = _run("proposed", inputs, self.truth.measured(inputs, start, np.random.default_rng(6)), self.truth.coarse)
        return _refits((log, done), (self.name, self.rival))


@cache
def _before(case: Case) -> tuple[Run, list[Step]]:
    log = _log(case.truth, case.torque, case.speed, case.minutes)
    return log, _refits((log,), (case.name, case.rival))


FRICTION = Case(Truth(viscous=0.1), ("viscous_friction", "*"), ("coulomb_friction", "*"), 6.0, 5.0)
AIR_LAWS = Case(Truth(area=0.02), ("radiation", "*"), ("natural_convection", "*"), 9.0, 0.0)
SENSOR = Case(Truth(offset=2.0, coarse=1.0), ("sensor_offset", "L_knee"), ("constant_heat", "L_knee"), 8.0, 0.0)
CASES = pytest.mark.parametrize("case", [FRICTION, AIR_LAWS, SENSOR], ids=["friction", "air", "sensor"])


@pytest.mark.long
@CASES
def test_the_proposed_run_separates_what_the_log_could_not(case: Case) -> None:
    _, rivals = case.before()
    assert not _are_told_apart(*rivals)
    experiment = propose(rivals)
    assert experiment is not None
    assert experiment.separates
    first, second = case.after(experiment)
    assert first.key == case.name
    assert _are_told_apart(first, second)


@CASES
def test_it_stays_within_time_limit_and_what_the_log_has_shown(case: Case) -> None:
    log, rivals = case.before()
    experiment = propose(rivals, minutes=15.0)
    assert experiment is not None
    assert len(experiment.run) * experiment.run.step == 15 * 60
    hottest = max(log.temperature(joint).max() for joint in JOINTS)
    assert experiment.limit == pytest.approx(hottest + 10.0)
    assert max(readings.max() for readings in experiment.predictions.values()) <= experiment.limit
    for name, values in experiment.run.columns.items():
        if not name.startswith("temperature."):
            assert values.max() <= log.columns[name].max()


def test_friction_laws_are_told_apart_at_another_speed_than_the_log_s() -> None:
    experiment = propose(FRICTION.before()[1], ambients=())
    assert experiment is not None
    assert any(0.0 < move.speed < 1.0 for move, _ in experiment.program.phases)
    assert "rad/s" in experiment.text()


def test_laws_of_the_air_are_told_apart_in_other_air() -> None:
    experiment = propose(AIR_LAWS.before()[1])
    assert experiment is not None
    assert experiment.program.ambient != pytest.approx(AIR)
    assert "not the temperature of the logs" in experiment.text()


def test_a_wrong_sensor_is_told_from_heat_by_leaving_the_joint_alone() -> None:
    experiment = propose(SENSOR.before()[1])
    assert experiment is not None
    assert "unpowered" in experiment.text()


def test_joints_that_log_torque_and_joints_that_log_current_have_both_in_one_proposal() -> None:
    log, _ = FRICTION.before()
    amperes = {"current.R_knee": log.columns["torque.R_knee"] / 0.84}
    columns = {name: values for name, values in log.columns.items() if name != "torque.R_knee"} | amperes
    by_current = MODEL.replace('at = "*"', 'at = "L_knee"') + ONE_BY_CURRENT
    rivals = _refits((replace(log, columns=columns),), (FRICTION.name, FRICTION.rival), by_current)
    experiment = propose(rivals, allowed=[Move("*", JOINTS, 0.5, speed) for speed in (0.2, 0.8)])
    assert experiment is not None
    assert "N*m and A" in [phase["load_unit"] for phase in experiment.stage.as_json(experiment.program)]
    assert re.search(r"all joints at [14] rad/s on average with 3\.\d N\*m and 2\.\d A for", experiment.text())


def test_a_limit_below_every_run_leaves_nothing_to_propose() -> None:
    assert propose(SENSOR.before()[1], limit=10.0, ambients=()) is None
    assert propose(SENSOR.before()[1][:1]) is None


def test_moves_that_a_robot_can_not_make_are_not_proposed() -> None:
    rivals = FRICTION.before()[1]
    loaded = [move for move in Stage(rivals).moves() if move.speed == 0.0]
    experiment = propose(rivals, allowed=loaded, ambients=())
    assert experiment is not None
    assert all(move in loaded for move, _ in experiment.program.phases if move.joints)
    assert not experiment.separates  # friction needs speed
    assert experiment.text().startswith("No run of 20 min")


def test_what_is_written_for_other_tools_says_the_same() -> None:
    experiment = propose(FRICTION.before()[1])
    assert experiment is not None
    written = json.loads(json.dumps(experiment.as_json()))
    assert written["text"] == experiment.text()
    assert sum(move["minutes"] for move in written["moves"]) == pytest.approx(20.0)
    assert written["differences"][0]["clear"]
    assert all(readings.shape == (2, len(experiment.run)) for readings in experiment.predictions.values())


@pytest.mark.long
def test_three_rivals_two_of_them_the_same_formula_leave_that_pair_undecided() -> None:
    _, rivals = FRICTION.before()
    experiment = propose([*rivals, rivals[0]])
    assert experiment is not None
    assert experiment.separates
    twice = rivals[0].key
    assert [one.pair for one in experiment.differences if not one.clear] == [(twice, twice)]
    assert "does not separate" in experiment.text()


def test_no_run_is_proposed_for_two_names_of_one_formula() -> None:
    _, rivals = FRICTION.before()
    experiment = propose([rivals[0], rivals[0]])
    assert experiment is not None
    assert not experiment.separates
    assert "standard deviations" not in experiment.text()
    assert experiment.text().startswith("No run of 20 min")


@pytest.mark.long
def test_the_stated_deviations_are_what_an_exact_refit_shows() -> None:
    """Noise-free readings of one rival: by so much the other's misfit rises when it is fitted to old and new."""
    _, (first, second) = FRICTION.before()
    experiment = propose([first, second])
    assert experiment is not None
    (old,) = first.fit.problem.bound_runs
    sigma = np.sqrt(Rivals([first, second]).density / STEP)
    rises = []
    for true, wrong in ((first, second), (second, first)):
        readings = experiment.predictions[true.key]
        inputs = {name: np.asarray(values) for name, values in experiment.run.columns.items()}
        new = bind(wrong.fit.model, _run("proposed", inputs, readings))
        alone, both = (
            fit(wrong.fit.model, runs, sigma=sigma, guess=wrong.fit.model.values) for runs in ([old], [old, new])
        )
        rises.append(2 * (both.cost - alone.cost))
    assert np.sqrt(min(rises)) == pytest.approx(experiment.weakest.deviations, rel=0.2)


@pytest.mark.parametrize(("seen", "size"), [("L_knee", 1.0), ("R_knee", 2.0)])
def test_a_difference_is_told_where_there_is_a_sensor_to_see_it(seen: str, size: float) -> None:
    log, _ = SENSOR.before()
    blind = {
        name: values
        for name, values in log.columns.items()
        if name not in {f"temperature.{joint}" for joint in JOINTS} - {f"temperature.{seen}"}
    }
    rivals = Rivals(_refits((replace(log, columns=blind),), (("constant_heat", seen), ("sensor_offset", seen))))
    sizes = np.where(np.array(JOINTS) == seen, -size, 5.0)
    one, other = (
        Sensitivities(
            share * np.repeat(sizes[:, None], 12, axis=1), np.zeros((2, 12, len(own.free) + 2)), len(own.free)
        )
        for share, own in zip((1.0, 0.0), rivals.fits, strict=True)
    )
    (told,) = rivals.apart([one, other], replace(log, time=log.time[:12]))
    assert told.node == seen
    assert (told.kelvin, told.kelvin_as_fitted) == pytest.approx((size, size))
    assert told.pair == (rivals.keys[1], rivals.keys[0])  # the warmer one first: the first is colder there
