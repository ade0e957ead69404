"""Time until a limit: against answers known in closed form, and against a virtual robot."""

from __future__ import annotations

import json
import math
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from lptn.basics.arrays import FloatArray
from lptn.basics.errors import InputError
from lptn.cli.main import main
from lptn.identify.data import load_model, split_data
from lptn.identify.validation import fit_segments
from lptn.logs.run import Run
from lptn.model.model import Model
from lptn.model.network import Network, NodeDeclaration
from lptn.model.tables import FitTable, FittedTable
from lptn.online.augmented_model import ModelError
from lptn.online.estimator import Estimator
from lptn.online.forecasting import Forecast, forecast
from lptn.online.operating_point import GaitPeriod, find_gait, present_operating_point, steady_seconds
from lptn.online.present import ModelUncertainty, present
from lptn.robots.presets import preset_text
from lptn.simulate.bound_run import bind
from lptn.virtual import Bout, Job, quadruped_logs
from tests.builders import AMBIENT, capacity, effect, link, make_run, node
from tests.hardening.living_sensors import model_of
from tests.hardening.plants import AIR as AIR_AROUND
from tests.hardening.plants import Plant, leg
from tests.model import slot

AIR, CAPACITY, RESISTANCE, OHM, CONSTANT = 20.0, 300.0, 5.0, 0.15, 0.84
PER_TORQUE = OHM / CONSTANT**2  # W/(N·m)²


@pytest.fixture(scope="module")
def motor() -> Model:
    """One motor of 300 J/K with 5 K/W to the air."""
    copper = effect("copper_loss", resistance=OHM, torque_constant=CONSTANT)
    return Model(Network("motor", (node("m", CAPACITY), AMBIENT), (link("m", "ambient", RESISTANCE),), (copper,)))


def warming(torque: FloatArray, *, extra: float = 0.0, noise: float = 0.0, step: float = 0.0, seed: int = 0) -> Run:
    """A log of the motor at 1 Hz from the ambient on: the exact solution for torques held over each second."""
    temperature = np.empty(torque.size + 1)
    temperature[0], fading = AIR, math.exp(-1 / (RESISTANCE * CAPACITY))
    for k, value in enumerate(torque):
        settled = AIR + RESISTANCE * (PER_TORQUE * value**2 + extra)
        temperature[k + 1] = settled + (temperature[k] - settled) * fading
    shown = temperature[:-1] + noise * np.random.default_rng(seed).standard_normal(torque.size)
    shown = np.round(shown / step) * step if step else shown
    columns = {"temperature.m": shown, "torque.m": torque, "temperature.ambient": np.full(torque.size, AIR)}
    return replace(make_run(columns), resolution={"temperature.m": step} if step else {})


def exactly(torque: float, limit: float, after: float, extra: float = 0.0) -> float:
    """Time from `after` s on until the motor is at the limit [s]."""
    settled = RESISTANCE * (PER_TORQUE * torque**2 + extra)
    return -RESISTANCE * CAPACITY * math.log(1 - (limit - AIR) / settled) - after


# --- time to the limit ----------------------------------------------------------------------------


def test_time_to_the_limit_is_that_of_the_exact_solution(motor: Model) -> None:
    prediction = forecast(motor, warming(np.full(300, 10.0)), 60.0, fit=certain(motor)).nodes["m"]
    assert prediction.time_to_limit == pytest.approx(exactly(10.0, 60.0, 300.0), rel=0.005)
    assert prediction.low < prediction.time_to_limit < prediction.high
    assert prediction.steady == pytest.approx(AIR + RESISTANCE * PER_TORQUE * 100, rel=0.01)


def test_never_is_said_with_the_temperature_at_which_it_settles(motor: Model) -> None:
    prediction = forecast(motor, warming(np.full(300, 4.0)), 60.0, fit=certain(motor)).nodes["m"]
    assert not prediction.reaches
    assert prediction.time_to_limit == prediction.low == prediction.high == math.inf
    assert prediction.steady == pytest.approx(AIR + RESISTANCE * PER_TORQUE * 16, abs=0.3)
    assert prediction.steady_low < prediction.steady < prediction.steady_high < 60
    assert prediction.chance < 0.01


def test_the_hottest_point_of_a_winding_is_forecast_though_no_sensor_measures_it() -> None:
    """20 A: against finite volumes, of which the log has the mean and the iron alone."""
    truth, model = slot.truth(np.full(3000, 20.0), 1.0), slot.model()
    columns = {f"temperature.{node}": truth[node][:300] for node in model.nodes}
    columns |= {"current.winding": np.full(300, 20.0), "temperature.ambient": np.full(300, slot.AIR)}
    ahead = forecast(model, make_run(columns), {"winding": 105.0, "*.hottest": 105.0}, fit=certain(model))
    assert ahead.names == ("winding", "iron", "winding.hottest")
    for place in ("winding", "winding.hottest"):
        reached = int((truth[place] >= 105.0).argmax()) + 1
        assert ahead.nodes[place].time_to_limit == pytest.approx(reached - 300, rel=0.01)
    assert np.isnan(ahead.measured[2]).all()


def test_a_limit_that_is_passed_takes_no_time(motor: Model) -> None:
    prediction = forecast(motor, warming(np.full(300, 10.0)), 25.0, fit=certain(motor)).nodes["m"]
    assert prediction.time_to_limit == 0


def test_averaging_keeps_the_squares(motor: Model) -> None:
    """A torque that is 14.14 half of the time heats like 10 all the time; its mean would be 7.07."""
    torque = np.tile([np.sqrt(200.0), 0.0], 150)
    prediction = forecast(motor, warming(torque), 60.0, fit=certain(motor)).nodes["m"]
    assert prediction.time_to_limit == pytest.approx(exactly(10.0, 60.0, 300.0), rel=0.02)


def test_heat_that_the_model_lacks_is_found_in_the_log(motor: Model) -> None:
    """3 W that no parameter knows: the forecast takes them along from the log, unlike the bare model."""
    run = warming(np.full(900, 9.0), extra=3.0)
    true, settled = exactly(9.0, 80.0, 900.0, extra=3.0), AIR + RESISTANCE * PER_TORQUE * 81
    now = float(run.columns["temperature.m"][-1])
    bare = RESISTANCE * CAPACITY * math.log((settled - now) / (settled - 80.0))
    doubt = ModelUncertainty(np.zeros((len(motor.free),) * 2), np.ones(1), "test")
    prediction = forecast(motor, run, 80.0, fit=doubt).nodes["m"]
    assert abs(prediction.time_to_limit - true) < 0.1 * abs(bare - true)
    assert prediction.low < true < prediction.high


@pytest.mark.parametrize("ahead", [60, 120])
def test_what_a_winding_adds_in_the_first_minute_does_not_go_on(motor: Model, ahead: int) -> None:
    """The sensor sits on a winding that is 2 K above its housing within a minute; the model has one mass."""
    run, winding = warming(np.full(ahead, 10.0)), 2.0 * (1 - np.exp(-np.arange(ahead) / 20.0))
    read = np.round(run.columns["temperature.m"] + winding + 0.15 * np.random.default_rng(1).standard_normal(ahead))
    run = replace(run, columns={**run.columns, "temperature.m": read}, resolution={"temperature.m": 1.0})
    doubt = ModelUncertainty(np.zeros((len(motor.free),) * 2), np.ones(1), "test", learns=False)
    prediction = forecast(motor, run, 60.0, fit=doubt).nodes["m"]
    assert prediction.low < exactly(10.0, 58.0, ahead) < prediction.high < 3000


def test_parameters_that_the_fit_left_open_are_learnt_from_the_log(motor: Model) -> None:
    """A mass that is a third too large: the log's slope puts it right, and better than missing heat does."""
    values = motor.values.copy()
    (index,) = (k for k in motor.free if motor.parameters[k].name.startswith("capacity"))
    values[index] *= 1.33
    doubted, variance = motor.with_values(values), np.zeros(len(motor.free))
    variance[motor.free.index(index)] = 0.3**2
    doubt = ModelUncertainty(np.diag(variance), certain(motor).error, "test")
    run = warming(np.full(1200, 10.0))
    true = exactly(10.0, 90.0, 1200.0)
    learnt, kept = (forecast(doubted, run, 90.0, fit=uncertainty).nodes["m"] for uncertainty in (doubt, certain(motor)))
    assert abs(learnt.time_to_limit - true) < 0.01 * true
    assert abs(learnt.time_to_limit - true) < abs(kept.time_to_limit - true)
    assert learnt.high - learnt.low < 0.5 * (kept.high - kept.low)  # which goes by missing heat, that fades
    assert learnt.low < true < learnt.high


def test_a_model_that_lacks_something_is_not_bent_to_the_log(motor: Model) -> None:
    """A poor fit's parameters stay: in the first minutes a missing mass looks like a small one, and like a draught."""
    table = FitTable(rmse=0.5, parameters={})
    poor, good = (ModelUncertainty.of_table(motor, table, np.array([floor])) for floor in (0.3, 0.5))
    assert (poor.learns, good.learns) == (False, True)
    assert "lptn diagnose" in poor.source
    run = warming(np.full(600, 10.0), extra=8.0)
    kept, learnt = (present(motor, run, uncertainty)[0] for uncertainty in (poor, good))
    np.testing.assert_allclose(kept.values, motor.values, rtol=1e-14)
    assert kept.state()["mean"][kept.augmented.layout.air] == 0
    assert np.abs(learnt.values / motor.values - 1).max() > 1e-6
    assert learnt.state()["mean"][learnt.augmented.layout.air] != 0


def test_no_parameter_is_bent_beyond_its_standard_error_by_heat_that_the_model_lacks(motor: Model) -> None:
    """A third more heat at a load that was not fitted: it is told apart from masses known to 2 %, however little
    the fit's own errors let expect it."""
    true, logged = (np.repeat([6.0, torque], [1500, 900]) for torque in (11.5, 10.0))
    seen = warming(true, noise=0.15)
    run = replace(seen, columns={**seen.columns, "torque.m": logged})
    doubt = ModelUncertainty(np.eye(len(motor.free)) * 0.02**2, np.full(1, 0.1), "test")
    filtered, _ = present(motor, run, doubt)
    moved = np.log(filtered.values / motor.values)[motor.free] / 0.02
    assert np.abs(moved).max() < 3.0
    heat = float(filtered.state()["mean"][filtered.augmented.layout.heat][0])
    assert heat == pytest.approx(PER_TORQUE * (11.5**2 - 10.0**2), rel=0.25)


def test_a_parameter_is_not_learnt_beyond_its_bounds() -> None:
    """The log's mass is 300 J/K; what the model admits ends at 260, and hardly any heat is allowed to be missing."""
    copper = effect("copper_loss", resistance=OHM, torque_constant=CONSTANT)
    mass = NodeDeclaration("m", capacity(250.0, bounds=(200.0, 260.0)))
    model = Model(Network("motor", (mass, AMBIENT), (link("m", "ambient", RESISTANCE),), (copper,)))
    names = [model.parameters[index].name for index in model.free]
    estimator = Estimator(
        model,
        noise=0.05,
        error=ModelError(heat=1e-3),
        learn=dict.fromkeys(names, 0.0),
        covariance=np.eye(len(names)) * 0.3**2,
        watch=False,
    )
    for _ in estimator.run(bind(model, warming(np.full(900, 10.0)))):
        pass
    (index,) = (k for k in model.free if model.parameters[k].name.startswith("capacity"))
    assert estimator.values[index] == pytest.approx(260.0)


def test_standard_errors_of_parameters_at_a_bound_are_not_believed(motor: Model) -> None:
    values = motor.values.copy()
    stopped, inside = motor.free[0], motor.free[1]
    values[stopped] = motor.parameters[stopped].declared.bounds[1]
    model = motor.with_values(values)
    sure = {model.parameters[k].name: FittedTable(value=values[k], error=0.01 * values[k]) for k in (stopped, inside)}
    uncertainty = ModelUncertainty.of_table(model, FitTable(rmse=0.3, parameters=sure), np.array([0.1]))
    assert uncertainty.covariance[0, 0] > 100 * uncertainty.covariance[1, 1]


@pytest.mark.slow
def test_intervals_cover_what_they_promise(motor: Model) -> None:
    """Sensor steps of 1 K and a torque that wanders: 90 % intervals hold the true time in most of 25 logs."""
    inside, errors, widths = [], [], []
    for seed in range(25):
        rng = np.random.default_rng(seed)
        knots = rng.normal(10.0, 1.2, 400)
        torque = np.interp(np.arange(3000), 8.0 * np.arange(400), knots)
        whole = warming(torque)
        true = float(np.flatnonzero(whole.columns["temperature.m"] >= 60.0)[0]) - 300.0
        seen = warming(torque, noise=0.15, step=1.0, seed=seed)
        prediction = forecast(motor, first(seen, 300), 60.0, fit=certain(motor)).nodes["m"]
        inside.append(prediction.low <= true <= prediction.high)
        errors.append(abs(prediction.time_to_limit - true) / true)
        widths.append((prediction.high - prediction.low) / true)
    assert np.mean(inside) >= 0.75
    assert np.median(errors) < 0.06
    assert np.median(widths) < 0.35


def test_doubt_about_parameters_widens_the_interval(motor: Model) -> None:
    run = warming(np.full(300, 10.0))
    doubt = ModelUncertainty(np.eye(len(motor.free)) * 0.1**2, certain(motor).error, "test")
    sure, unsure = (forecast(motor, run, 60.0, fit=uncertainty).nodes["m"] for uncertainty in (certain(motor), doubt))
    assert unsure.high - unsure.low > 1.5 * (sure.high - sure.low)
    wider = forecast(motor, run, 60.0, fit=doubt, coverage=0.99).nodes["m"]
    assert wider.low < unsure.low < unsure.high < wider.high


def unfitted(table: pd.DataFrame, folder: Path) -> Forecast:
    """The forecast of a quadruped's preset that nobody fitted."""
    table.to_csv(folder / "now.csv", index=False)
    (folder / "robot.toml").write_text(preset_text("quadruped"))
    loaded = load_model(folder / "robot.toml")
    return forecast(loaded.model, loaded.runs([folder / "now.csv"])[-1], 200.0)


@pytest.mark.long
@pytest.mark.parametrize(("seed", "speed", "load"), [(96, 1.0, 4.0), (97, 0.5, 2.0), (98, 0.8, 0.0), (99, 1.0, 2.0)])
def test_healthy_sensors_are_believed_though_nobody_fitted_the_model(
    seed: int, speed: float, load: float, tmp_path: Path
) -> None:
    """A preset misses what a trot adds by as much as a sensor's fault would: all calves were off, or drifted."""
    trot = Job((Bout("stand", 300), Bout("trot", 900, speed, load)), 20.0)
    ahead = unfitted(quadruped_logs(seed=seed, runs={"now": trot})["now"], tmp_path)
    assert "30% of each parameter" in ahead.trust
    assert ahead.doubts == ()


@pytest.mark.long
@pytest.mark.parametrize(
    ("seed", "run"), [(95, "abd_LF_RR_2Nm"), (96, "knee_LF_RR_6Nm"), (96, "hip_LF_RR_4Nm"), (97, "hip_LF_RR_2Nm")]
)
def test_a_healthy_sensor_of_1_k_may_stand_where_its_joint_hardly_warms(seed: int, run: str, tmp_path: Path) -> None:
    """The noise of one that had dwelled between two steps was taken for twice as large, and it for one that stands."""
    assert unfitted(quadruped_logs(seed=seed)[run], tmp_path).doubts == ()


@pytest.mark.long
@pytest.mark.parametrize("seed", [1, 3, 4])
def test_healthy_sensors_are_believed_where_the_model_lacks_the_windings(seed: int) -> None:
    """One of a leg was left out: "lag 30 s", which a winding within its joint makes, or undecided."""
    robot = leg()
    true, random = robot.off_by(0.1, "cores", np.random.default_rng(seed)), np.random.default_rng(2)

    def log(minutes: int) -> Run:
        plant, rows = Plant(true, AIR_AROUND, 1.0), []
        for _ in range(minutes):
            currents = random.uniform(0.0, 11.0, 3) * (random.random(3) < 0.8)
            for _ in range(60):
                rows.append([*plant.temperature[:3], *currents])
                plant.step(currents)
        table = np.array(rows).T
        table[:3] = np.round(table[:3] + 0.05 * random.standard_normal(table[:3].shape), 1)
        names = [f"{quantity}.{joint}" for quantity in ("temperature", "current") for joint in robot.nodes]
        columns = dict(zip(names, table, strict=True)) | {"temperature.ambient": np.full(table.shape[1], AIR_AROUND)}
        return make_run(columns)

    fitted = fit_segments(model_of(robot), split_data([log(90)]).fit)
    ahead = forecast(fitted.model, log(60), 60.0, fit=ModelUncertainty.of_fit(fitted))
    assert ahead.doubts == ()


def test_a_model_that_runs_away_settles_nowhere() -> None:
    copper = effect("copper_loss", resistance=OHM, torque_constant=CONSTANT)
    hotter = effect("resistance_rise", alpha=0.0039)
    nodes = (node("m", CAPACITY), AMBIENT)
    model = Model(Network("motor", nodes, (link("m", "ambient", 20.0),), (copper, hotter)))
    prediction = forecast(model, warming(np.full(300, 12.0)), 60.0).nodes["m"]
    assert prediction.reaches
    assert prediction.steady == math.inf


# --- what is taken to go on -----------------------------------------------------------------------


def test_only_the_present_activity_is_averaged(motor: Model) -> None:
    rng = np.random.default_rng(1)
    torque = np.concatenate([np.full(400, 2.0), np.full(200, 8.0)]) * rng.normal(1, 0.05, 600)
    result = forecast(motor, warming(torque), 60.0)
    assert result.window.seconds == pytest.approx(200, abs=10)
    assert "unchanged" in result.window.why


def test_an_activity_that_never_changes_is_averaged_whole(motor: Model) -> None:
    steady = [
        steady_seconds(bind(motor, warming(torque)), motor.inputs)
        for torque in (np.random.default_rng(seed).normal(8, 0.5, 900) for seed in range(20))
    ]
    assert steady == [900.0] * 20


@pytest.mark.long
def test_a_longer_window_scatters_less(motor: Model) -> None:
    """Source table, row 6.2: averages over ten gait cycles scatter, longer ones less."""
    errors: dict[str, list[float]] = {"short": [], "steady": []}
    for seed in range(8):
        rng = np.random.default_rng(seed)
        run = warming(np.interp(np.arange(400), 8.0 * np.arange(60), rng.normal(10.0, 1.0, 60)))
        now = float(run.columns["temperature.m"][-1])
        settled = AIR + RESISTANCE * PER_TORQUE * (100 + 1 * 2 / 3)  # between knots the variance is two thirds
        true = RESISTANCE * CAPACITY * math.log((settled - now) / (settled - 60))
        errors["short"].append(forecast(motor, run, 60.0, window=5.0).nodes["m"].time_to_limit / true - 1)
        errors["steady"].append(forecast(motor, run, 60.0).nodes["m"].time_to_limit / true - 1)
    assert np.std(errors["steady"]) < 0.5 * np.std(errors["short"])


def test_part_of_a_step_counts_in_part(motor: Model) -> None:
    bound = bind(motor, warming(np.array([*[0.0] * 97, 4.0, 4.0, 2.0])))
    point = present_operating_point(bound, motor.inputs, 2.5, 10, GaitPeriod(None))
    torque = point.inputs[motor.inputs.index("torque.m")]
    assert torque == pytest.approx(np.sqrt((0.5 * 16 + 16 + 4) / 2.5))


# --- the gait -------------------------------------------------------------------------------------


@pytest.mark.parametrize("rate", [10.0, 100.0])
@pytest.mark.parametrize("period", [0.42, 0.8, 2.7])
def test_the_gait_period_is_found_from_joints_out_of_phase(rate: float, period: float) -> None:
    time = np.arange(0, 60, 1 / rate)
    rng = np.random.default_rng(0)
    size = 1 + 0.1 * np.interp(time, np.arange(0, 70, 8), rng.standard_normal(9))
    speeds = [
        size * np.sin(2 * np.pi * (time / period + phase)) + 0.1 * rng.standard_normal(time.size) for phase in (0, 0.3)
    ]
    assert find_gait(speeds, 1 / rate).period == pytest.approx(period, rel=0.01)


def test_where_there_is_no_gait_the_reason_is_said() -> None:
    rng = np.random.default_rng(0)
    assert "stand" in find_gait([1e-3 * rng.standard_normal(900)], 0.1).why_not
    assert "period" in find_gait([rng.standard_normal(900)], 0.1).why_not
    assert "1 s apart" in find_gait([np.sin(np.arange(900.0))], 1.0).why_not
    assert "no joint speeds" in find_gait([], 0.01).why_not


def test_holding_the_average_of_a_gait_is_repeating_it(motor: Model) -> None:
    """Ten cycles at 100 Hz, repeated sample by sample, warm the motor as their average does."""
    cycle = 10 + 6 * np.sin(2 * np.pi * np.arange(50) / 50)
    torque = np.tile(cycle, 10 * 60)  # 300 s
    run = motor.run(torque.size)
    inputs = np.array([torque if column == "torque.m" else np.full(torque.size, AIR) for column in motor.inputs])
    repeated = run(np.array([AIR]), inputs, motor.values, 0.01).full()[0, -1]
    mean = np.array([np.sqrt(np.mean(cycle**2)) if column == "torque.m" else AIR for column in motor.inputs])
    held = motor.run(300)(np.array([AIR]), np.tile(mean[:, None], 300), motor.values, 1.0).full()[0, -1]
    assert held == pytest.approx(repeated, abs=0.01)


# --- the command ----------------------------------------------------------------------------------

MODEL = """[model]
name = "motor"
ambient = "temperature.ambient"

[nodes.m]
capacity = 300

[[links]]
between = ["m", "ambient"]
resistance = 5

[[effects]]
kind = "copper_loss"
at = "m"
resistance = 0.15
torque_constant = 0.84
"""


@pytest.fixture
def files(tmp_path: Path) -> tuple[Path, Path]:
    """A model file and a log at 20 Hz of a trot of 2 Hz."""
    time = np.arange(0, 300, 0.05)
    turn = 2 * np.pi * 2.0 * time
    second = warming(np.full(300, 10.0)).columns["temperature.m"]
    table = pd.DataFrame({"time": time, "torque.m": np.sqrt(200) * np.sin(turn), "velocity.m": 5 * np.cos(turn)})
    table["temperature.m"] = np.interp(time, np.arange(300), second)
    table["temperature.ambient"] = AIR
    (tmp_path / "motor.toml").write_text(MODEL)
    table.to_parquet(tmp_path / "trot.parquet")
    return tmp_path / "motor.toml", tmp_path / "trot.parquet"


def test_the_command_says_times_and_writes_json_and_figure(
    files: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    written, picture = tmp_path / "found.json", tmp_path / "found.png"
    words = [*map(str, files), "--limit", "60", "--limit", "m=65"]
    lptn("forecast", *words, "--json", str(written), "--plot", str(picture))
    said = capsys.readouterr().out
    assert "gait cycles of 0.5 s" in said
    content = json.loads(written.read_text())
    assert content["nodes"]["m"]["limit"] == 65
    assert content["nodes"]["m"]["time_to_limit"] == pytest.approx(exactly(10.0, 65.0, 300.0), rel=0.05)
    assert content["window"]["gait_period"] == pytest.approx(0.5, rel=0.01)
    assert len(content["path"]["time"]) == len(content["path"]["temperature"]["m"])
    assert picture.read_bytes().startswith(b"\x89PNG")


def test_it_says_how_far_before_the_end_of_a_log_its_present_is_where_an_input_ends_earlier(
    files: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    model, log = files
    table, cut, written = pd.read_parquet(log), tmp_path / "cut.parquet", tmp_path / "found.json"
    table.loc[table["time"] >= 200, "torque.m"] = np.nan
    table.to_parquet(cut)
    for path, late in ((log, 0.0), (cut, 100.0)):
        lptn("forecast", str(model), str(path), "--limit", "60", "--json", str(written))
        assert ("before the end of the log" in capsys.readouterr().out) == (late > 0)
        assert json.loads(written.read_text())["seconds_before_log_end"] == pytest.approx(late, abs=1.0)


def test_ten_gait_cycles_on_request(files: tuple[Path, Path], capsys: pytest.CaptureFixture[str]) -> None:
    lptn("forecast", *map(str, files), "--limit", "60", "--window", "cycles")
    assert "the last 10 gait cycles" in capsys.readouterr().out


def test_what_is_never_reached_is_null(files: tuple[Path, Path], tmp_path: Path) -> None:
    written = tmp_path / "found.json"
    lptn("forecast", *map(str, files), "--limit", "400", "--json", str(written))
    one = json.loads(written.read_text())["nodes"]["m"]
    assert one["reaches"] is False
    assert one["time_to_limit"] is None


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--limit", "hot"], "'hot'"),
        (["--limit", "nobody=60"], "'nobody'"),
        (["--limit", "60", "--window", "-5"], "'-5'"),
        (["--limit", "60", "--plot", "x.gif"], ".gif"),
    ],
)
def test_bad_options_are_refused_in_one_line(
    files: tuple[Path, Path], words: list[str], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert lptn("forecast", *map(str, files), *words) == 2
    line = capsys.readouterr().err
    assert said in line
    assert line.count("\n") == 1


@pytest.mark.parametrize(("small", "ohm", "bead"), [(1e-3, 5.0, 0.0), (0.1, 0.1, 0.0), (300.0, 5.0, 1e-3)])
def test_a_model_much_faster_than_the_log_is_refused_before_it_is_filtered(
    small: float, ohm: float, bead: float
) -> None:
    """By Runge-Kutta steps as short as the model asks for, a log of 2 minutes took more than 10."""
    nodes, links = [node("motor", small), AMBIENT], [link("motor", "ambient", ohm)]
    if bead:
        nodes, links = [*nodes, node("bead", bead)], [*links, link("motor", "bead", 5.0)]
    model = Model(Network("fast", tuple(nodes), tuple(links), (effect("copper_loss", "motor"),)))
    log = {f"temperature.{name}": np.full(120, 25.0) for name in model.nodes}
    run = make_run({**log, "temperature.ambient": np.full(120, 22.0), "torque.motor": np.ones(120)})
    with pytest.raises(InputError, match=r"found a time constant of .* in a log of steps of 1 s"):
        forecast(model, run, 60.0)


@pytest.mark.parametrize("lost", [math.nan, -94.6, -49.9, 850.0, 0.0])
def test_behind_a_lost_sensor_a_forecast_comes_to_an_end(motor: Model, lost: float) -> None:
    """It once believed such readings, and its parameters ran away until each row took thousands of steps."""
    healthy = warming(np.full(900, 5.0), noise=0.05)
    readings = healthy.columns["temperature.m"].copy()
    readings[600:] = lost + 0.05 * np.random.default_rng(1).standard_normal(300)
    spoilt = replace(healthy, columns={**healthy.columns, "temperature.m": readings})
    begun = time.process_time()
    told = forecast(motor, spoilt, 60.0).nodes["m"]
    assert time.process_time() - begun < 20
    assert abs(told.now - exact_now(900)) < 1.0


def exact_now(seconds: float) -> float:
    """The motor's temperature after so long at 5 N·m [degC]."""
    return AIR + RESISTANCE * PER_TORQUE * 25 * -math.expm1(-seconds / (RESISTANCE * CAPACITY))


def test_a_log_that_is_too_short_is_refused(motor: Model) -> None:
    with pytest.raises(InputError, match="at least 60 s"):
        forecast(motor, warming(np.full(40, 10.0)), 60.0)


def lptn(*words: str) -> int:
    """The command's exit status."""
    with pytest.raises(SystemExit) as stop:
        main(words)
    return int(stop.value.code or 0)


def first(run: Run, seconds: int) -> Run:
    """The first seconds of a run at 1 Hz."""
    return run.slice(float("-inf"), float(seconds))


def certain(model: Model) -> ModelUncertainty:
    """A model whose parameters are right."""
    free = len(model.free)
    return ModelUncertainty(np.zeros((free, free)), np.full(len(model.nodes), 0.02), "right by construction")
