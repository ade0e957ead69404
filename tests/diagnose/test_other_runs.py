"""Held-out runs that differ from the fitted ones by one thing, their truth integrated by SciPy."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from lptn.basics.arrays import FloatArray
from lptn.basics.parameters import ParameterInstance
from lptn.diagnose.answers import Step
from lptn.diagnose.diagnosis import diagnose, examine
from lptn.diagnose.fit_statistics import CLEARLY
from lptn.diagnose.improvement import History, improve
from lptn.diagnose.refits import refit
from lptn.diagnose.runs_that_differ import RunDifference, in_words, runs_that_differ
from lptn.effects import catalogue
from lptn.identify.data import DataSplit, holdout_segment, split_data
from lptn.identify.fitting import Fit
from lptn.identify.validation import fit_segments
from lptn.logs.run import Run
from lptn.model.file import parse_model
from lptn.model.model import Model
from lptn.model.network import EffectDeclaration, Network
from lptn.virtual import Hidden
from tests.builders import AMBIENT, effect, link, make_run, node
from tests.diagnose.conftest import Leg, leg  # noqa: F401 - a fixture

NODES = ("winding", "body", "foot")
STEP, MINUTES = 5.0, 40
CAPACITY = np.array([100.0, 250.0, 180.0])  # J/K
AMONG = np.array([1.5, 4.0])  # K/W from each node to the next
TO_AIR = np.array([12.0, 5.0, 9.0])  # K/W
NOISE = 0.1  # K


def network() -> Network:
    """Three nodes in a row, heated by a logged power at the first, each of them in air."""
    links = (link("winding", "body", 2.0), link("body", "foot", 5.0), *(link(name, "ambient", 8.0) for name in NODES))
    return Network("row", (*(node(name, 200.0) for name in NODES), AMBIENT), links, (effect("heat_input", "winding"),))


def held_gain() -> Network:
    """The same with the heat of a watt held at a watt."""
    (heated,) = network().effects
    return replace(network(), effects=(replace(heated, parameters=(replace(heated.parameters[0], fixed=True),)),))


def truth(
    name: str,
    seed: int,
    *,
    fan: float = 1.0,
    fan_at: Sequence[int] = (0, 1, 2),
    warmer: float = 0.0,
    reads_high: float = 0.0,
    heat: float = 1.0,
    late: float = 0.0,
    bursts: float = 0.0,
) -> Run:
    """A run from SciPy's integrator, with what differs in it."""
    rng = np.random.default_rng(seed)
    n = int(MINUTES * 60 / STEP)
    power = rng.uniform(0.0, 12.0, n // 48 + 1).repeat(48)[:n]
    power[-n // 4 :] = 0.0
    air, begun = 20.0 + rng.uniform(0.0, 3.0), rng.uniform(2.0, 8.0, 3)
    loss = 1.0 / TO_AIR
    loss[list(fan_at)] *= fan
    noise_heat = bursts * (np.sin(np.arange(n) / 17.0) > 0.6) * rng.uniform(0.0, 1.0, n)

    def rates(t: float, x: FloatArray) -> FloatArray:
        index = min(int(t / STEP + 1e-9), n - 1)
        q = (x[:-1] - x[1:]) / AMONG
        gained = np.array([heat * power[index], noise_heat[index], 0.0]) - loss * (x - air - warmer)
        gained[:-1] -= q
        gained[1:] += q
        return np.asarray(gained / CAPACITY)

    times = STEP * np.arange(n)
    at = np.clip(times - late, 0.0, times[-1])
    path = solve_ivp(rates, (0.0, times[-1]), air + begun, t_eval=np.unique(at), max_step=STEP, rtol=1e-8, atol=1e-8)
    readings = np.array([np.interp(at, path.t, row) for row in path.y]) + rng.normal(0.0, NOISE, (3, n))
    readings[0] += reads_high
    columns = {f"temperature.{place}": row for place, row in zip(NODES, readings, strict=True)}
    columns |= {"temperature.ambient": np.full(n, air), "power.winding": power}
    return make_run(columns, step=STEP, name=name)


@pytest.fixture(scope="module")
def fitted() -> Fit:
    """The model, fitted to two runs that do not differ."""
    return fit_segments(Model(held_gain()), split_data([truth("monday", 1), truth("tuesday", 2)]).fit)


def said_of(fitted: Fit, **differs: object) -> list[RunDifference]:
    """What is said of one held-out run."""
    run = truth("run4", 3, **differs)  # type: ignore[arg-type]
    return runs_that_differ(fitted, split_data([], [run]).holdout)


def _named(difference: RunDifference) -> tuple[object, object]:
    """What explains a run best, and where, as other tools read it."""
    return difference.as_json()["effect"], difference.as_json()["at"]


def test_of_a_run_like_the_fitted_ones_nothing_is_said(fitted: Fit) -> None:
    assert said_of(fitted) == []


@pytest.mark.long
def test_a_fan_is_found_and_its_size(fitted: Fit) -> None:
    (difference,) = said_of(fitted, fan=3.0)
    assert (difference.run, *_named(difference)) == ("run4", "surface_scale", "*")
    assert difference.as_json()["amplitude"] == pytest.approx(2.0, rel=0.1)
    assert difference.rmse_after < 1.2 * NOISE < difference.rmse_before
    assert difference.text().startswith("run4 loses heat 3 times as fast as the other runs: was a fan on?")
    assert "not a prediction" in difference.text()


@pytest.mark.long
def test_a_fan_at_one_node_is_placed(fitted: Fit) -> None:
    (difference,) = said_of(fitted, fan=3.0, fan_at=(1,))
    assert _named(difference) == ("surface_scale", "body")
    assert "run4 loses heat at body 3 times as fast" in difference.text()


@pytest.mark.long
def test_a_cover_is_told_from_a_fan(fitted: Fit) -> None:
    (difference,) = said_of(fitted, fan=0.4)
    assert _named(difference) == ("surface_scale", "*")
    assert "only 0.4 times as fast" in difference.text()


@pytest.mark.long
def test_a_warmer_room_is_found(fitted: Fit) -> None:
    (difference,) = said_of(fitted, warmer=2.3)
    assert _named(difference) == ("ambient_offset", "ambient")
    assert difference.as_json()["amplitude"] == pytest.approx(2.3, abs=0.3)
    assert "In run4 the ambient was 2.3 K warmer than given." in difference.text()
    # The same data to the last bit, up to the start: every sensor off by as much.
    assert difference.causes[1].key == ("sensor_offset", "*@run4")


@pytest.mark.long
def test_a_sensor_that_reads_high_is_found(fitted: Fit) -> None:
    (difference,) = said_of(fitted, reads_high=1.5)
    assert _named(difference) == ("sensor_offset", "winding")
    assert difference.as_json()["amplitude"] == pytest.approx(1.5, abs=0.15)
    assert "the sensor of winding reads 1.5 K high" in difference.text()


@pytest.mark.long
def test_an_offset_below_the_steps_of_its_sensor_is_found() -> None:
    def in_steps(run: Run) -> Run:
        read = {f"temperature.{place}": np.round(run.temperature(place)) for place in NODES}
        return replace(run, columns={**run.columns, **read}, resolution=dict.fromkeys(read, 1.0))

    runs = [in_steps(truth("monday", 1)), in_steps(truth("tuesday", 2))]
    done = fit_segments(Model(held_gain()), split_data(runs).fit)
    like, high = (in_steps(truth("run4", 200, reads_high=size)) for size in (0.0, 0.7))
    assert runs_that_differ(done, split_data([], [like]).holdout) == []
    (difference,) = runs_that_differ(done, split_data([], [high]).holdout)
    assert _named(difference) == ("sensor_offset", "winding")
    assert difference.as_json()["amplitude"] == pytest.approx(0.7, abs=0.15)


@pytest.mark.long
def test_a_heater_that_gives_more_is_not_called_a_draught(fitted: Fit) -> None:
    (difference,) = said_of(fitted, heat=1.3)
    assert _named(difference) == ("heat_scale", "winding")
    assert difference.as_json()["amplitude"] == pytest.approx(0.3, rel=0.05)


@pytest.mark.long
def test_clocks_apart_are_found(fitted: Fit) -> None:
    (difference,) = said_of(fitted, late=40.0)
    assert difference.causes[0].effect == "clock_offset"
    assert difference.as_json()["amplitude"] == pytest.approx(40.0, abs=5.0)
    assert "s later than the inputs" in difference.text()


@pytest.mark.long
def test_what_no_one_parameter_explains_is_said_plainly(fitted: Fit) -> None:
    # Of a reading that is 3 K high a contact that conducts worse would explain half.
    (difference,) = said_of(fitted, bursts=20.0, reads_high=2.0, fan=1.9)
    written = difference.as_json()
    assert (written["effect"], written["amplitude"], written["indistinguishable"]) == (None, None, [])
    assert "no one parameter that may differ from run to run explains half of it" in difference.text()
    assert re.search(r"on the fitted runs, most clearly at winding \(\S+ for \S+ K\)", difference.text())
    assert written["rmse_before"] == difference.rmse_before > 1.0


@pytest.mark.long
def test_a_cause_that_leaves_much_says_so(fitted: Fit) -> None:
    (difference,) = said_of(fitted, bursts=40.0)
    assert difference.causes[0].effect == "constant_heat"
    assert "It does not explain all" in difference.text()


def test_the_rest_of_a_fitted_run_is_left_out(fitted: Fit) -> None:
    fan = truth("monday", 1, fan=3.0)
    assert runs_that_differ(fitted, split_data([], [fan]).holdout) == []


def test_every_effect_that_may_differ_from_run_to_run_has_its_sentences() -> None:
    for kind in catalogue().values():
        assert all(kind.in_one_run) == kind.per_run, kind.key


def _held_out(history: History, data: DataSplit) -> list[tuple[object, ...]]:
    """What is said of the held-out runs beside the model that was found."""
    differing = runs_that_differ(history.best.fit, data.holdout)
    return [(difference.run, *_named(difference)) for difference in differing]


@pytest.mark.parametrize(("differs", "effect"), [({"fan": 3.0}, "surface_scale"), ({"warmer": 3.0}, "ambient_offset")])
def test_what_a_held_out_run_has_is_said_of_it_and_adds_nothing(differs: dict[str, float], effect: str) -> None:
    """The fitted runs have nothing against the model; its error on the run is told as it is."""
    data = split_data([truth("monday", 1), truth("tuesday", 2)], [truth("run4", 3, **differs)])  # type: ignore[arg-type]
    history = improve(Model(held_gain()), data)
    assert len(history.steps) == 1
    assert history.first.only_held_out_runs_object
    assert history.best.holdout is not None
    assert history.best.holdout.rmse > 10 * NOISE
    assert [said[:2] for said in _held_out(history, data)] == [("run4", effect)]


def test_a_held_out_run_that_nothing_explains_is_left_as_it_is() -> None:
    data = split_data([truth("monday", 1), truth("tuesday", 2)], [truth("run4", 3, bursts=8.0)])
    history = improve(Model(held_gain()), data)
    assert history.verdict == "unexplained"
    assert len(history.steps) == 1
    assert history.first.only_held_out_runs_object
    (difference,) = runs_that_differ(history.best.fit, data.holdout)
    assert difference.rmse_after > CLEARLY * difference.rmse_fit


@pytest.mark.long
def test_a_held_out_run_that_differs_does_not_choose_what_is_missing_in_all(leg: Leg) -> None:  # noqa: F811
    model, data = leg(Hidden("coulomb_friction", "*"), Hidden("loss_scale", "FR_calf", size=0.8, run="holdout"))
    history = improve(model, data)
    assert [step.key for step in history.steps[1:]] == [("coulomb_friction", "*")]
    assert _held_out(history, data) == [("holdout", "loss_scale", "FR_calf")]


@pytest.mark.long
def test_nor_does_one_in_which_several_things_differ(leg: Leg) -> None:  # noqa: F811
    odd = [("surface_scale", "FR_calf", -2.0), ("loss_scale", "FR_hip", 4.0), ("surface_scale", "FR_thigh", 6.0)]
    in_holdout = [Hidden(effect, at, size=size, run="holdout") for effect, at, size in odd]
    model, data = leg(Hidden("coulomb_friction", "*"), *in_holdout)
    history = improve(model, data)
    assert [step.key for step in history.steps[1:]] == [("coulomb_friction", "*")]
    assert history.best.holdout is not None
    assert history.best.holdout.rmse > 1.0  # it is judged on that run, and says so
    assert [said[0] for said in _held_out(history, data)] == ["holdout"]


MOTOR = """
[model]
name = "motor"
ambient = "temperature.ambient"
[nodes.motor]
capacity = { value = 100, unit = "J/K", bounds = [5, 5000] }
[[links]]
between = ["motor", "ambient"]
resistance = { value = 2, unit = "K/W", bounds = [0.05, 50] }
[[effects]]
kind = "copper_loss"
at = "motor"
input = "current"
resistance = 0.3
"""


def _motor(name: str, seed: int, capacity: float, resistance: float, heat: float) -> Run:
    """One mass [J/K, K/W] whose copper loses 0.3 ohm times the current squared, and which gets a heat [W] besides;
    exact while the current holds."""
    rng, n = np.random.default_rng(seed), 2700
    current = rng.uniform(0.0, 7.0, n // 180).repeat(180)
    kept, warm = np.exp(-1.0 / capacity / resistance), np.zeros(n)
    for k in range(n - 1):
        end = resistance * (0.3 * current[k] ** 2 + heat)
        warm[k + 1] = end + (warm[k] - end) * kept
    readings = {"temperature.motor": 24.0 + warm + rng.normal(0.0, NOISE, n), "current.motor": current}
    return make_run({"temperature.ambient": np.full(n, 24.0)} | readings, name=name)


@pytest.mark.parametrize(("capacity", "resistance"), [(180.0, 2.4), (70.0, 0.8), (250.0, 5.0)])
def test_what_the_fitted_run_is_sure_of_stands_beside_a_run_of_another_motor(
    capacity: float, resistance: float
) -> None:
    data = split_data([_motor("bench", 1, 120.0, 1.6, 5.0)], [_motor("other", 2, capacity, resistance, 0.0)])
    history = improve(Model(parse_model(MOTOR, Path("motor.toml")).network), data)
    steps = history.steps[1:]
    assert [("constant_heat", "motor") in {step.key, *step.indistinguishable} for step in steps] == [True]
    assert steps[0].fit.rmse < 1.1 * NOISE < history.steps[0].fit.rmse
    assert steps[0].likely
    assert [said[0] for said in _held_out(history, data)] == ["other"]


@pytest.mark.parametrize(
    ("heat_held_out", "left", "verdict", "told"),
    [
        (5.0, 1.1, "missing", 0.9),
        (4.0, 0.6, "missing", 0.9),
        (4.0, 0.8, "unexplained", 0.9 * 0.36),
        (4.0, 1.1, "unexplained", 0.9 * 0.195),
        (-2.0, 0.8, "unexplained", None),
    ],
)
def test_what_explains_less_than_it_leaves_is_told_unless_it_removes_nothing_or_predicts_worse(
    monkeypatch: pytest.MonkeyPatch, heat_held_out: float, left: float, verdict: str, told: float | None
) -> None:
    """A heat that is there, beside something without a name that leaves much of the held-out run's error."""
    data = split_data([_motor("bench", 1, 120.0, 1.6, 5.0)], [_motor("other", 2, 120.0, 1.6, heat_held_out)])
    base = fit_segments(Model(parse_model(MOTOR, Path("motor.toml")).network), data.fit)
    declared = EffectDeclaration(catalogue()["constant_heat"](), "motor")
    step = Step(refit(base, declared), declared, probability=0.9)
    before, after = (SimpleNamespace(left_of_held_out=error, is_lacking=lambda **_: True) for error in (1.0, left))
    made = SimpleNamespace(fit=step.fit, steps=(step,), rivals=(), refused=(), before=before, after=after)
    monkeypatch.setattr(import_module("lptn.diagnose.diagnosis"), "composition", lambda *_, **__: made)
    diagnosis = examine(base, data)
    assert diagnosis.verdict == verdict
    shown, unused = [one.probability for one in diagnosis.steps], [one.key for one in diagnosis.refused]
    assert shown == ([] if told is None else [pytest.approx(told, rel=0.01)])
    assert unused == ([step.key] if told is None else [])


def test_what_a_held_out_run_does_not_log_is_not_looked_for(leg: Leg) -> None:  # noqa: F811
    """It could not be predicted there."""
    model, data = leg()
    (held_out,) = (segment.run for segment in data.holdout)
    columns = {name: values for name, values in held_out.columns.items() if name != "speed.base"}
    lacking = replace(held_out, columns=columns)
    data = DataSplit(data.fit, (holdout_segment(lacking),))
    assert data.lacking() == {"holdout": ["speed.base"]}
    asked = {scored.candidate.effect.key for scored in diagnose(model, data).weighed}
    assert "second_mass" in asked
    assert "forced_convection" not in asked


@pytest.mark.parametrize(
    ("change", "bounds", "said"),
    [
        (2.0, (-1.0, 20.0), "run4 loses heat 3 times as fast as the other runs: was a fan on?"),
        (0.016, (-1.0, 20.0), "run4 loses heat 1.016 times as fast as the other runs"),
        (-0.03, (-1.0, 20.0), "run4 loses heat only 0.970 times as fast as the other runs"),
        (-0.03, (-0.03, 0.03), "run4 loses heat at most 0.970 times as fast as the other runs"),
    ],
)
def test_what_a_size_means_is_said_no_louder_than_it_is(change: float, bounds: tuple[float, float], said: str) -> None:
    declared = replace(catalogue()["surface_scale"].parameters[0], value=change, bounds=bounds)
    amplitude = ParameterInstance(declared, "*@run4", "surface_scale")
    declaration = EffectDeclaration(catalogue()["surface_scale"](), "*", (declared,), run="run4")
    assert in_words(declaration, amplitude, "run4") == said
