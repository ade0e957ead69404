"""Sensors that are not alive, found reading by reading; truth by scipy alone."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from lptn.basics.arrays import FloatArray
from lptn.basics.errors import InputError
from lptn.logs.run import Run
from lptn.model.file import parse_model
from lptn.model.model import Model
from lptn.online.augmented_model import ModelError
from lptn.online.estimator import Estimate, Estimator
from lptn.online.forecasting import forecast
from lptn.online.living_sensors import LivingSensor
from lptn.online.present import ModelUncertainty, not_alive
from lptn.simulate.bound_run import bind
from tests.builders import make_run
from tests.hardening.plants import AIR, ROBOTS, Plant, Robot, windings
from tests.identify.truth import TRUTH, network, truth_run

NOISE, SINCE = 0.15, 600


@pytest.fixture(scope="module")
def model() -> Model:
    """The true two nodes."""
    return Model(network().with_values(TRUTH))


def judged(readings: FloatArray, predicted: FloatArray, step: float, noise: float = NOISE) -> LivingSensor:
    """What is known of one sensor after readings once a second, the filter being right to 0.05 K."""
    sensor = LivingSensor(noise**2, step)
    for reading, expected in zip(readings.tolist(), predicted.tolist(), strict=True):
        sensor.clock, sensor.deviation, sensor.settles = sensor.clock + 1.0, 0.05, 1000.05
        sensor.judge(1.0, reading, expected, 0.05**2, expected)
    return sensor


def rounded(true: FloatArray, step: float, seed: int = 0) -> FloatArray:
    """What a sensor reads."""
    return np.asarray(np.round((true + NOISE * np.random.default_rng(seed).standard_normal(true.size)) / step) * step)


def test_a_coarse_sensor_stands_for_an_hour_with_its_temperature() -> None:
    true = np.concatenate([np.linspace(20, 24.02, 600), np.full(3600, 24.02)])
    readings = rounded(true, 1.0)
    assert np.mean(readings[-3600:] == 24) > 0.99
    assert not judged(readings, true, 1.0).stands
    assert not judged(readings, true, 0.0).stands  # nobody said its steps


def test_the_same_reading_is_dead_where_the_temperature_has_moved_on() -> None:
    true = np.concatenate([np.linspace(20, 24.02, 600), np.linspace(24.02, 27, 300)])
    readings = rounded(true, 1.0)
    readings[600:] = 24.0
    assert judged(readings, true, 1.0).why_not.startswith("has read 24 degC, bit for bit, for ")


def test_a_fine_sensor_that_stands_is_called_in_a_minute() -> None:
    readings = rounded(np.full(700, 30.0), 0.1)
    readings[600:] = readings[600]
    assert not judged(readings[:650], np.full(650, 30.0), 0.1).stands
    assert judged(readings[:665], np.full(665, 30.0), 0.1).stands


def test_a_topic_that_repeats_itself_is_alive() -> None:
    readings = rounded(np.full(120, 30.0), 0.1).repeat(30)
    assert not judged(readings, np.full(readings.size, 30.0), 0.1).stands


def followed(model: Model, readings: FloatArray, **options: bool) -> list[Estimate]:
    """An estimator led along the true run."""
    run = truth_run(1500.0, noise=0.0, seed=1)
    estimator = Estimator(model, noise=NOISE, step=0.1, **options)  # type: ignore[arg-type]
    estimates = []
    for k in range(len(run)):
        inputs = {name: float(run.columns[name][max(k - 1, 0)]) for name in model.inputs}
        estimates.append(estimator.update(inputs, dict(zip(model.nodes, readings[:, k], strict=True)), float(k > 0)))
    return estimates


@pytest.fixture(scope="module")
def true() -> FloatArray:
    """degC, shape (2, seconds)."""
    run = truth_run(1500.0, noise=0.0, seed=1)
    return np.array([run.columns["temperature.a"], run.columns["temperature.b"]])


@pytest.mark.long
@pytest.mark.parametrize("value", [None, 0.0, 125.0])
def test_what_a_dead_sensor_said_is_taken_back(model: Model, true: FloatArray, value: float | None) -> None:
    healthy = np.array([rounded(row, 0.1, seed) for seed, row in enumerate(true)])
    dead, blind = healthy.copy(), healthy.copy()
    dead[0, SINCE:900] = dead[0, SINCE] if value is None else value
    blind[0, SINCE + 1 : 900] = np.nan
    watched, without, fooled = followed(model, dead), followed(model, blind), followed(model, dead, watch=False)
    assert "bit for bit" in watched[899].untrusted["a"]
    assert watched[899].temperatures == pytest.approx(without[899].temperatures, abs=0.5)
    assert abs(fooled[899].temperatures[0] - true[0, 899]) > 5 * abs(watched[899].temperatures[0] - true[0, 899])
    assert watched[899].deviations[0] > 3 * watched[SINCE - 1].deviations[0]
    assert not watched[-1].untrusted  # it agrees again, for as long as it stood
    assert watched[-1].deviations[0] < 2 * watched[SINCE - 1].deviations[0]


@pytest.mark.long
def test_spikes_are_not_taken_in_and_a_first_one_is_no_start(model: Model, true: FloatArray) -> None:
    spiky = np.array([rounded(row, 0.1, seed) for seed, row in enumerate(true)])
    clean = followed(model, spiky)
    spiky[0, [0, 400, 401, 800]] = [85.0, 0.0, 85.0, 70.0]
    estimates = followed(model, spiky)
    assert "contradicts" in estimates[800].untrusted["a"]
    for k in (60, 401, 802, 1499):
        assert estimates[k].temperatures == pytest.approx(clean[k].temperatures, abs=0.1)


# --- a forecast -------------------------------------------------------------------------------------


def steady(model: Model, stuck_for: int) -> Run:
    """Two nodes that warm at 9 N·m, a's sensor standing for the last seconds; the model's own truth, as data."""
    n = 900
    inputs = np.array([np.full(n, 9.0 if name == "torque.a" else 20.0) for name in model.inputs])
    path = np.array(model.run(n)(np.full(2, 20.0), inputs, model.values, 1.0)).T
    readings = [rounded(row, 0.1, seed) for seed, row in enumerate(path.T if path.shape[0] == n else path)]
    if stuck_for:
        readings[0][-stuck_for:] = readings[0][-stuck_for]
    columns = {"temperature.a": readings[0], "temperature.b": readings[1]}
    return make_run(columns | dict(zip(model.inputs, inputs, strict=True)))


@pytest.mark.long
def test_a_forecast_goes_on_without_a_stuck_sensor_and_says_so(model: Model) -> None:
    free = len(model.free)
    sure = ModelUncertainty(np.zeros((free, free)), np.full(2, 0.1), "right by construction")
    limit = float(steady(model, 0).columns["temperature.a"][-1]) + 3.0
    healthy, stuck = (forecast(model, steady(model, length), {"a": limit}, fit=sure) for length in (0, 240))
    assert not healthy.doubts
    (doubt,) = stuck.doubts
    assert doubt.node == "a"
    assert "bit for bit" in str(doubt)
    one, other = healthy.nodes["a"], stuck.nodes["a"]
    assert other.time_to_limit == pytest.approx(one.time_to_limit, rel=0.1)
    assert other.low < one.time_to_limit < other.high
    assert other.high - other.low > one.high - one.low


def test_of_a_log_in_which_all_sensors_die_it_is_said_of_each(model: Model) -> None:
    run = steady(model, 0)
    columns = dict(run.columns)
    for place in ("a", "b"):
        columns[f"temperature.{place}"] = np.where(np.arange(len(run)) < 200, columns[f"temperature.{place}"], 0.0)
    estimator = Estimator(model, noise=NOISE, step=0.1)
    left_out, doubts = not_alive(estimator, bind(model, make_run(columns)))
    assert left_out[:, 261:].all()
    assert {doubt.node for doubt in doubts} == {"a", "b"}


@pytest.mark.parametrize("value", [0.0, -49.9, 85.0, 25.0])
def test_a_log_without_any_living_sensor_is_refused(model: Model, value: float) -> None:
    run, free = steady(model, 0), len(model.free)
    sure = ModelUncertainty(np.zeros((free, free)), np.full(2, 0.1), "right by construction")
    dead = {name: np.full(len(run), value) for name in ("temperature.a", "temperature.b")}
    with pytest.raises(InputError, match=r"a: reads .* b: reads .*expected a sensor that is alive"):
        forecast(model, make_run({**run.columns, **dead}), 60.0, fit=sure)


def _driven(name: str, dead: float | None, dither: float) -> tuple[Model, Run]:
    """A plain robot with every value 10 % off under a steady load, all its sensors dead at a temperature or none."""
    robot, rng = ROBOTS[name](), np.random.default_rng(3)
    plant, currents = Plant(robot.off_by(0.1, "signs", rng), AIR, 1.0), np.full(len(robot.driven), 0.6 * robot.asked)
    true = []
    for _ in range(900):
        true.append(plant.temperature)
        plant.step(currents)
    columns = {"temperature.ambient": np.full(900, AIR)}
    for node, current in zip(robot.driven, currents, strict=True):
        columns[f"current.{robot.nodes[node]}"] = current + rng.normal(0.0, 0.05, 900)
    for node in robot.measured:
        read = np.array(true)[:, node] if dead is None else np.full(900, dead)
        columns[f"temperature.{robot.nodes[node]}"] = read + rng.normal(0.0, dither, 900)
    return Model(parse_model(robot.toml(), Path(f"{name}.toml")).network), make_run(columns)


@pytest.mark.parametrize("dither", [0.0, 0.1])
@pytest.mark.parametrize("value", [-40.0, 0.0, 25.0, 40.0])
@pytest.mark.parametrize("name", ["knee", "motor", "leg"])
def test_nor_is_one_believed_beside_a_model_that_nobody_fitted(name: str, value: float, dither: float) -> None:
    """However wrong a model may be: what is heated warms."""
    model, run = _driven(name, value, dither)
    with pytest.raises(InputError, match="expected a sensor that is alive"):
        forecast(model, run, 80.0)


@pytest.mark.parametrize("name", ["knee", "motor", "leg"])
def test_a_healthy_sensor_beside_a_model_that_nobody_fitted_is_alive(name: str) -> None:
    assert not forecast(*_driven(name, None, 0.1), 80.0).doubts


# --- nodes that no sensor tells of: no colder than what surrounds them, no warmer than their heat allows --------------


def _warmed(robot: Robot, start: float, by: float = 1.0) -> Plant:
    """A robot at its start [degC]; its losses more, its cooling less by a factor."""
    return Plant(replace(robot, loss=by * robot.loss, to_air=robot.to_air / by), start, 2.0)


UNREAD = {
    "leg whose thigh nobody reads": (replace(ROBOTS["leg"](), measured=(0, 2)), AIR),
    "leg that comes from work": (replace(ROBOTS["leg"](), measured=(0, 2)), 50.0),
    "motor whose housing is read": (replace(ROBOTS["motor"](), measured=(1,)), AIR),
    "windings whose housings are read": (windings(), AIR),
}
SPOILT: dict[str, Callable[[float, FloatArray], FloatArray]] = {
    "healthy": lambda _, true: true,
    "one lost, the others dead": lambda t, true: np.append(np.full(1, np.nan if t > 60 else true[0]), 0 * true[1:] + 5),
    "dead at -40": lambda _, true: 0 * true - 40,
    "dead at 5": lambda _, true: 0 * true + 5,
    "dead at 40": lambda _, true: 0 * true + 40,
    "die at 0, one after the other": lambda t, true: np.where(t > 400 + 30 * np.arange(true.size), 0.0, true),
    "swapped": lambda _, true: true[::-1],
    "drift down": lambda t, true: true - 0.03 * t,
}


@pytest.mark.long
@pytest.mark.parametrize("spoilt", SPOILT)
@pytest.mark.parametrize("name", UNREAD)
def test_no_node_is_estimated_colder_than_all_around_it_nor_warmer_than_its_heat(name: str, spoilt: str) -> None:
    (robot, start), rng = UNREAD[name], np.random.default_rng(8)
    plant, hottest = _warmed(robot.off_by(0.1, "signs", rng), start), _warmed(robot, start, 2.0)
    model = Model(parse_model(robot.toml(), Path("robot.toml")).network)
    estimator, rows = Estimator(model, noise=0.1), [model.nodes.index(node) for node in robot.nodes]
    asked = 0.6 * robot.asked * rng.uniform(0, 1.6, (8, len(robot.driven)))
    for k in range(450):
        read = SPOILT[spoilt](2.0 * k, plant.temperature[list(robot.measured)])
        read = read + rng.normal(0, 0.1, read.size)
        inputs = {"temperature.ambient": AIR}
        inputs |= {f"current.{robot.nodes[i]}": asked[max(k - 1, 0) // 60, j] for j, i in enumerate(robot.driven)}
        readings = {robot.nodes[node]: value for node, value in zip(robot.measured, read.tolist(), strict=True)}
        estimate = estimator.update(inputs, readings, 2.0 * (k > 0))
        unread = [n for n, node in enumerate(robot.nodes) if node not in readings or node in estimate.untrusted]
        found = estimate.temperatures[rows][unread]
        assert (found >= AIR - 0.5).all(), f"{2 * k} s: {found}"
        beyond = found - hottest.temperature[unread]
        assert (beyond <= 6 * 5).all(), f"{2 * k} s: {found}"  # standard deviations of what is not known at the start
        plant.step(asked[k // 60])
        hottest.step(asked[k // 60])


def test_a_joint_whose_heat_no_input_tells_costs_no_sensor_its_trust(model: Model) -> None:
    """The torque's column is 0 from ten minutes on while a goes on to be heated, and heats b."""
    run = truth_run(2400.0, noise=NOISE, seed=1)
    said = {**run.columns, "torque.a": np.where(run.time < SINCE, run.columns["torque.a"], 0.0)}

    error = ModelError(heat={"a": 5.0, "b": 0.5}, heat_time=1800.0)

    def doubted(unknown: tuple[str, ...]) -> set[str]:
        estimator, found = Estimator(model, noise=NOISE, error=error, unknown=unknown), set[str]()
        for _ in estimator.run(bind(model, replace(run, columns=said))):
            found |= estimator.estimate.untrusted.keys()
        return found

    assert doubted(()) == {"b"}
    assert doubted(("a",)) == set()
