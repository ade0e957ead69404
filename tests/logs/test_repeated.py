"""The same readings as data to fit and to hold out: found in any format, in part, as means; other days are not."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from lptn.basics.errors import InputError
from lptn.logs.reading import read_log
from lptn.logs.repeated import repeated_stretch
from lptn.logs.run import Run
from lptn.robots.presets import presets
from lptn.study import Study
from lptn.virtual import leg_logs
from tests.hardening.corruptions import healthy


def _run(log: pd.DataFrame, name: str = "log", step: float | None = None) -> Run:
    (run,) = read_log(log, name=name, step=step)
    return run


@pytest.mark.parametrize("robot", ["leg", "quadruped"])
@pytest.mark.parametrize("steps", [0.1, 1.0])
def test_another_day_is_another(robot: str, steps: float) -> None:
    assert repeated_stretch(_run(healthy(robot, 1, steps)), _run(healthy(robot, 2, steps))) is None


@pytest.mark.parametrize("steps", [0.1, 1.0])
def test_a_part_an_average_and_a_rounded_copy_are_found(steps: float) -> None:
    log = healthy("quadruped", 1, steps)
    run, part = _run(log), log[600:1500].reset_index(drop=True)
    assert repeated_stretch(run, _run(part)) == (600.0, 1499.0)
    assert repeated_stretch(_run(part), run) is not None
    later = part.assign(time=part["time"] - 5000.0)
    assert repeated_stretch(run, _run(later)) == (-4400.0, -3501.0)
    assert repeated_stretch(run, _run(log.round(3))) is not None
    assert repeated_stretch(run, _run(log, step=10.0)) is not None


def _means(log: pd.DataFrame, rows: int) -> pd.DataFrame:
    return log.groupby(np.arange(len(log)) // rows).mean()


def _read_between(log: pd.DataFrame, step: float) -> pd.DataFrame:
    time = np.arange(0.4, log["time"].iloc[-1], step)
    return pd.DataFrame({str(name): np.interp(time, log["time"], log[name]) for name in log} | {"time": time})


@pytest.mark.parametrize(
    "resample",
    [lambda log: log[::5], lambda log: log[3::37], lambda log: _means(log, 50), lambda log: _read_between(log, 1.7)],
    ids=["each fifth row", "each 37th row", "means", "read between the rows"],
)
def test_a_copy_at_a_lower_rate_is_found(resample: Callable[[pd.DataFrame], pd.DataFrame]) -> None:
    """The reader itself takes means over a second, so that most rows of such a copy share a part of their noise."""
    log = healthy("leg", 1, 0.1)
    run, copy = _run(log), _run(resample(log).reset_index(drop=True))
    assert repeated_stretch(run, copy) is not None
    assert repeated_stretch(copy, run) is not None


@pytest.mark.parametrize("steps", [0.1, 1.0])
def test_two_days_of_one_motion_are_not_the_same(steps: float) -> None:
    true, rng = leg_logs(seed=5, noise=0.0)["fit1"].reset_index(drop=True), np.random.default_rng(1)

    def day(warmer: float) -> pd.DataFrame:
        log = true.copy()
        for name in (name for name in map(str, log) if name.startswith("temperature.")):
            log[name] += rng.normal(warmer, 0.1, len(log))
            log[name] = np.round(log[name] / steps) * steps if steps else log[name]
        return log

    monday, tuesday = day(0.0), day(0.3)
    for rows in (10, 100, 300):
        assert repeated_stretch(_run(monday), _run(tuesday[::rows].reset_index(drop=True))) is None


def test_two_robots_that_cool_are_not_the_same_for_falling_alike() -> None:
    time = np.arange(3000.0)
    logs = [
        pd.DataFrame({"time": time, "temperature.knee": np.round(22 + 20 * np.exp(-(time + late) / 900))})
        for late in (0.0, 40.0)
    ]
    assert repeated_stretch(_run(logs[0]), _run(logs[1])) is None


def test_two_gaps_are_not_the_same_readings() -> None:
    """A part of one day, laid over a minute in which no sensor of the other was logged, differs by nothing."""
    monday, tuesday = (_run(healthy("leg", day, 0.1)) for day in (1, 2))
    columns = {name: values.copy() for name, values in monday.columns.items()}
    for name in (name for name in columns if name.startswith("temperature.")):
        columns[name][300:400] = np.nan
        columns[name] += 5.0
    silent = replace(monday, columns=columns)
    for length in (250.0, 350.0):
        part = tuesday.slice(-np.inf, tuesday.time[0] + length)
        assert repeated_stretch(silent, part) is None
        assert repeated_stretch(part, silent) is None


@pytest.mark.parametrize("lost", [2, 10, 25])
def test_a_copy_that_lost_readings_is_found(lost: int) -> None:
    """So many of each minute, of a temperature without noise that would give it away."""
    time = np.arange(500.0)
    log = pd.DataFrame({"time": time, "temperature.knee": 22.0 + 20.0 * np.sin(time / 90.0) + 0.01 * time})
    copy, rng = log.copy(), np.random.default_rng(3)
    for first in range(0, 480, 60):
        copy.loc[first + rng.choice(60, lost, replace=False), "temperature.knee"] = np.nan
    assert repeated_stretch(_run(log), _run(copy)) is not None


def test_a_study_refuses_a_log_that_it_has_in_another_format(tmp_path: Path) -> None:
    log = healthy("leg", 1, 0.1)
    (tmp_path / "leg.toml").write_text(presets()["leg"], encoding="utf-8")
    log.to_csv(tmp_path / "monday.csv", index=False)
    log[9000:].to_parquet(tmp_path / "tuesday.parquet")
    with pytest.raises(InputError, match=r"the same readings as .*monday\.csv"):
        Study(tmp_path / "leg.toml", fit=[tmp_path / "monday.csv"], holdout=tmp_path / "tuesday.parquet")
