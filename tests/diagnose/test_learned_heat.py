"""Heat that the catalogue lacks goes with its input, as a curve near the truth; where nothing is hidden, none."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from lptn.diagnose.advice import Advice
from lptn.diagnose.answers import Step
from lptn.diagnose.diagnosis import Diagnosis, for_search
from lptn.diagnose.learned_heat import LearnedCurve, input_shares, learned_curve
from lptn.diagnose.unexplained_heat import WanderingHeat
from lptn.effects.learned_heat import LearnedHeat
from lptn.identify.data import DataSplit, split_data
from lptn.identify.validation import fit_segments, holdout_errors
from lptn.logs.run import Run
from lptn.model.model import Model
from lptn.model.network import Network
from lptn.report.heat_story import learned_picture
from lptn.report.narrative import narrative
from tests.benchmarks.learned_heat import HIDDEN, Hidden, curve_against_truth, model, split, truth_run
from tests.builders import AMBIENT, LEG, effect, link, make_run, node


def _unexplained(data: DataSplit) -> Diagnosis:
    """As a search answers that finds no name."""
    return _unexplained_of(model(), data)


def _unexplained_of(model: Model, data: DataSplit) -> Diagnosis:
    fit = fit_segments(model, data.fit)
    return Diagnosis("unexplained", "unexplained", fit, holdout_errors(fit, data.holdout), {})


def _learned(data: DataSplit) -> LearnedCurve | None:
    last = _unexplained(data)
    return learned_curve(last, last, data, WanderingHeat(last.fit))


@pytest.mark.long
@pytest.mark.parametrize("name", HIDDEN)
def test_hidden_heat_goes_with_its_input_and_is_met_by_its_curve(name: str) -> None:
    hidden = HIDDEN[name]
    curve = _learned(for_search(split(31, hidden)))
    assert curve is not None
    assert (curve.inputs[0].node, curve.inputs[0].column) == (hidden.node, hidden.column)
    assert curve.inputs[0].share > 0.6
    error, held = curve_against_truth(curve, hidden)
    assert error < 0.25 * np.abs(curve.heat).max()
    assert held > 0.8
    assert curve.held_out is not None
    assert curve.without is not None
    assert curve.held_out < 0.5 * curve.without
    text = curve.text()
    assert f"unexplained, but goes with {hidden.column}" in text
    assert ("lptn add MODEL learned_heat" in text) == curve.offered


@pytest.mark.parametrize("seed", [32, 33])
def test_nothing_hidden_is_never_offered(seed: int) -> None:
    assert _learned(for_search(split(seed, None))) is None


@pytest.mark.long
def test_heat_by_the_clock_alone_is_not_offered() -> None:
    """A heater that somebody switches by hand goes with nothing that is logged."""
    rng = np.random.default_rng(34)
    switched = iter(rng.uniform(size=4000).repeat(400) < 0.5)
    data = for_search(split(34, Hidden("FR_thigh", "", lambda *_: np.asarray(8.0 * next(switched)))))
    curve = _learned(data)
    assert curve is None or not curve.offered


def test_without_held_out_runs_it_is_told_and_not_offered() -> None:
    data = for_search(split(35, HIDDEN["cogging, |speed|^0.3"]))
    curve = _learned(replace(data, holdout=()))
    assert curve is not None
    assert not curve.offered
    assert curve.command == ""
    assert "unexplained, but goes with velocity.FR_thigh" in curve.text()


def test_what_is_explained_is_not_learned() -> None:
    data = for_search(split(36, HIDDEN["seal above 3 rad/s"]))
    explained = replace(_unexplained(data), verdict="missing", remaining="adequate")
    assert learned_curve(explained, explained, data, WanderingHeat(explained.fit)) is None


def test_a_neighbours_temperature_is_told_and_not_offered() -> None:
    """Heat that comes over from a neighbour above 45 degC, and leaves it: no curve of one node is that."""
    hidden = HIDDEN["leak at 50 degC"]
    runs = [_with_neighbours_heat(370 + number) for number in range(3)]
    shares = input_shares(WanderingHeat(_unexplained(for_search(split_data(runs))).fit), ["FR_thigh"])
    assert shares[0].column == hidden.column
    assert shares[0].declaration(1.0) is None


def _with_neighbours_heat(seed: int) -> Run:
    """Readings of the thigh with heat that follows the hip's temperature, from the response of the chain to it."""
    run = truth_run(seed, None)
    hip = run.columns["temperature.FR_hip"]
    smooth = np.convolve(np.pad(hip, 30, mode="edge"), np.ones(61) / 61, mode="valid")
    heat, rise, readings = (
        10.0 * np.clip((smooth - 40.0) / 5.0, 0.0, 1.0),
        0.0,
        run.columns["temperature.FR_thigh"].copy(),
    )
    for k in range(len(run)):
        readings[k] += rise
        rise += (heat[k] - rise / 1.1) / 220.0
    return replace(run, columns={**run.columns, "temperature.FR_thigh": readings})


def test_time_of_day_is_named_in_logs_of_days() -> None:
    """A node in the sun, whose power nobody logs."""
    run = truth_run(38, None, length=3600)
    days = 2 * 1440
    time = 60.0 * np.arange(days, dtype=np.float64)
    rng = np.random.default_rng(38)
    sun = 12.0 * np.clip(np.sin(2 * np.pi * (time / 86400.0 - 0.25)), 0.0, None)
    columns = {name: np.full(days, 21.0) if "ambient" in name else np.zeros(days) for name in run.columns}
    load = rng.uniform(0.0, 7.0, (3, days // 30)).repeat(30, axis=1)
    for row, name in enumerate(LEG):
        columns[f"torque.{name}"] = load[row]
    capacities, out = np.array([150.0, 220.0, 300.0]), np.array([9.0, 12.0, 6.0])
    t, path = np.full(3, 21.0), np.empty((3, days))
    for k in range(days):
        path[:, k] = t
        for _ in range(12):  # s: steps of 5
            one, two = (t[0] - t[1]) / 3.0, (t[1] - t[2]) / 2.0
            heat = 0.4 * load[:, k] ** 2 + np.array([0.0, sun[k], 0.0]) - (t - 21.0) / out
            t = t + 5.0 * (heat + np.array([-one, one - two, two])) / capacities
    for row, name in enumerate(LEG):
        columns[f"temperature.{name}"] = path[row] + 0.1 * rng.standard_normal(days)
    long = replace(run, step=60.0, time=time, columns=columns)
    shares = input_shares(WanderingHeat(_unexplained(split_data([long])).fit), ["FR_thigh"])
    assert shares[0].column == "time of day"
    assert shares[0].share > 0.5


@pytest.mark.long
def test_advice_tells_it_and_other_tools_read_it() -> None:
    curve = _learned(for_search(split(39, HIDDEN["clutch above 4 N*m"])))
    assert curve is not None
    advice = Advice(None, [], [], [], curve)
    assert curve.text() in advice.sentences
    told = advice.as_json()["learned_heat"]
    assert isinstance(told, dict)
    assert told["verdict"] == "unexplained, but goes with torque.FR_calf"
    assert str(told["add"]).startswith("lptn add MODEL learned_heat --at FR_calf --set input=torque")
    drawn = learned_picture(curve)
    assert drawn is not None
    assert any("unexplained heat over torque.FR_calf" in drawing for drawing in drawn.drawings)
    assert len(told["curve"]["watts"]) == len(told["curve"]["band"]) == len(told["curve"]["input"])


@pytest.mark.long
def test_a_model_with_it_says_that_this_heat_stays_unexplained() -> None:
    data = for_search(split(40, HIDDEN["cogging, |speed|^0.3"]))
    curve = _learned(data)
    assert curve is not None
    assert curve.step is not None
    (learned,) = Diagnosis("adequate", "adequate", curve.step.fit, None, {}).learned
    assert learned.effect.key == LearnedHeat.key
    (verdict, *_) = narrative([Step(curve.step.fit)], Diagnosis("adequate", "adequate", curve.step.fit, None, {}))
    assert "Heat at FR_thigh is unexplained, but goes with velocity.FR_thigh" in verdict.text
    told = Diagnosis("adequate", "adequate", curve.step.fit, None, {}).as_json()["learned"]
    assert told == [{"at": "FR_thigh", "verdict": "unexplained, but goes with velocity.FR_thigh"}]


def _housed(seed: int) -> Run:
    """A winding whose joint rubs in its housing above 3 rad/s; the log names the speed after the winding."""
    rng = np.random.default_rng(seed)
    torque, speed = (rng.uniform(0.0, most, 40).repeat(90) for most in (5.0, 6.0))
    t, path = np.full(2, 20.0), np.empty((2, 3600))
    for k in range(3600):
        path[:, k] = t
        passed = (t[0] - t[1]) / 1.5
        rubbing = 3.0 * max(speed[k] - 3.0, 0.0)
        t = t + np.array([0.4 * torque[k] ** 2 - passed, passed + rubbing - (t[1] - 20.0) / 4.0]) / (80.0, 250.0)
    columns = {"temperature.ambient": np.full(3600, 20.0), "torque.a": torque, "velocity.a": speed}
    readings = path + 0.1 * rng.standard_normal(path.shape)
    return make_run(columns | {"temperature.a": readings[0], "temperature.a_case": readings[1]}, name=f"run{seed}")


def test_heat_in_a_housing_goes_with_the_speed_of_its_winding() -> None:
    links = (link("a", "a_case", 1.5), link("a_case", "ambient", 4.0))
    copper = effect("copper_loss", "a", resistance=0.4, torque_constant=1.0)
    motor = Model(Network("motor", (node("a", 80.0), node("a_case", 250.0), AMBIENT), links, (copper,)))
    data = for_search(split_data([_housed(1), _housed(2)], [_housed(3)]))
    last = _unexplained_of(motor, data)
    curve = learned_curve(last, last, data, WanderingHeat(last.fit))
    assert curve is not None
    assert (curve.inputs[0].node, curve.inputs[0].column) == ("a_case", "velocity.a")
    assert curve.offered
    assert "driven_by=a " in curve.command
