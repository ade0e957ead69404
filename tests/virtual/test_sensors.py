"""Check what sensors, clock and the ambient's sensor show against what is written out here."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from scipy.integrate import solve_ivp

from lptn.virtual import QUADRUPED_NODES, Bout, Hidden, Job, Logs, leg_logs, quadruped, quadruped_logs
from lptn.virtual.robot import Array
from lptn.virtual.sensors import lagged
from tests.truth.plans import swing, trial


def test_lag_is_the_exact_one() -> None:
    time = np.arange(200.0)
    ramp = np.column_stack([20 + 0.1 * time] * 2)
    read = lagged(ramp, np.array([20.0, 0.0]))
    before = 20.0 - 0.1 * 20 * (1 - np.exp(-time / 20))
    assert read[:, 0] == pytest.approx(before + 0.1 * time, abs=1e-9)
    assert read[:, 1] == pytest.approx(ramp[:, 1], abs=0)


ACT = (Bout("trot", 700, 0.8, 4.0), Bout("rest", 300))
RUNS = {"mix": Job(ACT, 20.0, cutout=None)}
TEMPERATURES = [f"temperature.{node}" for node in QUADRUPED_NODES]


def logs(*hidden: tuple[str, str, float], full: bool = False, rate: float = 1.0) -> Logs:
    physics = "full" if full else "plain"
    return quadruped_logs(hidden, seed=2, runs=RUNS, physics=physics, noise=0, quantisation=0, rate=rate)  # type: ignore[arg-type]


def read(log: pd.DataFrame) -> Array:
    return log[TEMPERATURES].to_numpy()


def test_drift_is_a_ramp_from_the_run_s_beginning() -> None:
    gap = (logs(("sensor_drift", "pc", 1.0))["mix"] - logs()["mix"])["temperature.pc"].to_numpy()
    assert gap == pytest.approx(4.0 / 3600 * np.arange(1000))


@pytest.mark.parametrize("size", [1.0, 0.45, -0.5])
def test_clock_shows_what_was_so_many_seconds_ago(size: float) -> None:
    late, usual = read(logs(("clock_offset", "*", size))["mix"]), read(logs()["mix"])
    then = np.arange(1000) - 30 * size
    inside = (then >= 0) & (then <= 999)
    expected = np.column_stack([np.interp(then, np.arange(1000), column) for column in usual.T])
    assert late[inside] == pytest.approx(expected[inside], abs=1e-9)
    # Before the first row it was as it is then; after the last it goes on as it went.
    expected[then > 999] += np.outer(then[then > 999] - 999, usual[-1] - usual[-2])
    assert late[~inside] == pytest.approx(expected[~inside], abs=0.02)
    assert inside.sum() >= 970


def test_clock_is_wrong_at_a_hundred_hertz_too() -> None:
    hidden = ("clock_offset", "*", 0.455)
    fast, slow = read(logs(hidden, rate=100)["mix"])[::100], read(logs(hidden)["mix"])
    assert fast == pytest.approx(slow, abs=1e-4)


def test_hot_spot_follows_the_copper_loss() -> None:
    spot, usual = logs(("hot_spot", "FR_calf", 1.0))["mix"], logs()["mix"]
    robot = quadruped(seed=2, physics="plain")
    loss = robot.resistance[2] * usual["torque.FR_calf"] ** 2 / robot.torque_constant[2] ** 2
    gap = (spot - usual)["temperature.FR_calf"]
    # The log's torque has noise of 2 % in each second.
    assert gap.iloc[100:700].mean() == pytest.approx(0.12 * loss.iloc[100:700].mean(), rel=0.02)
    assert gap.iloc[3] == pytest.approx(0.12 * loss.iloc[:3].mean() * (1 - np.exp(-1)), rel=0.05)
    assert gap.iloc[703] / gap.iloc[700] == pytest.approx(np.exp(-1), rel=1e-6)
    assert not (spot - usual).drop(columns="temperature.FR_calf").to_numpy().any()


def test_position_between_winding_and_case() -> None:
    done = logs(("sensor_position", "FR_calf~FR_calf_case", 2.0), full=True)
    truth = done.truth["mix"]
    expected = 0.6 * truth["temperature.FR_calf"] + 0.4 * truth["housing.FR_calf"]
    assert done["mix"]["temperature.FR_calf"].to_numpy() == pytest.approx(expected.to_numpy())
    assert (truth["temperature.FR_calf"] - truth["housing.FR_calf"]).max() > 5


def test_position_that_cannot_be_is_refused() -> None:
    with pytest.raises(ValueError, match="place of sensor_position: found the case of FR_calf; expected full physics"):
        logs(("sensor_position", "FR_calf~FR_calf_case", 1.0))
    with pytest.raises(ValueError, match=r"size of sensor_position: found 6; expected at most 5\.00 at FR_calf"):
        logs(("sensor_position", "FR_calf~FR_hip", 6.0))


@pytest.mark.parametrize("full", [False, True])
def test_offset_of_the_ambient_is_not_in_the_log(full: bool) -> None:
    colder = logs(("ambient_offset", "ambient", -2.0), full=full)
    assert (colder["mix"]["temperature.ambient"] == 20).all()
    usual = logs(full=full).truth["mix"]["temperature.ambient"]
    assert colder.truth["mix"]["temperature.ambient"].to_numpy() == pytest.approx(usual.to_numpy() - 5.0)
    assert read(colder["mix"])[0] == pytest.approx(usual[0] - 5.0)


@pytest.mark.long
def test_true_ambient_lags_behind_the_logged_one() -> None:
    hidden = [("ambient_lag", "ambient", 1.0)]
    runs = swing(3)
    done, usual = (quadruped_logs(h, seed=3, runs=runs, physics="plain") for h in (hidden, ()))
    for name, log in done.items():
        logged, true = log["temperature.ambient"], done.truth[name]["temperature.ambient"].to_numpy()
        pd.testing.assert_series_equal(logged, usual[name]["temperature.ambient"])
        pd.testing.assert_series_equal(logged, usual.truth[name]["temperature.ambient"])
        assert np.ptp(logged) == pytest.approx(8.0)
        exact = solve_ivp(
            lambda t, x, given: (np.interp(t, np.arange(len(given)), given) - x) / 1200.0,
            (0, len(log) - 1),
            [logged[0]],
            args=(logged.to_numpy(),),
            t_eval=np.arange(len(log)),
            max_step=20,
            rtol=1e-6,
        )
        assert true == pytest.approx(exact.y[0], abs=1e-2)
    # Runs that say nothing of their ambient get one that changes.
    own = quadruped_logs(hidden, seed=3, runs=trial(3), physics="plain")
    for name, log in own.items():
        pd.testing.assert_frame_equal(log, done[name])


@pytest.mark.long
def test_leg_feels_the_lag_of_the_ambient() -> None:
    lagging, prompt = (
        leg_logs([Hidden("ambient_lag", "ambient", size)], seed=1, noise=0, rate=1) for size in (1, 1e-9)
    )
    for name, log in lagging.items():
        assert np.ptp(log["temperature.ambient"]) == pytest.approx(8.0)
        pd.testing.assert_series_equal(log["temperature.ambient"], prompt[name]["temperature.ambient"])
        assert (log - prompt[name])["temperature.FR_calf"].abs().max() > 0.8
