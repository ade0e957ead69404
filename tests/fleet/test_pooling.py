"""Parameters pooled over robots and days: who stands apart, who drifts, and how far off a robot's value is."""

from __future__ import annotations

from dataclasses import dataclass, replace
from datetime import date, timedelta
from pathlib import Path

import numpy as np
import pytest

from lptn.fleet.fleet import fit_each
from lptn.fleet.pooling import FleetParameter, Session, pool
from lptn.fleet.robots import by_day, robots_of
from tests.fleet.truth import MODEL, RESISTANCE, write_log

START = date(2026, 1, 1)
MEAN = np.log(3.0)


@dataclass
class Truth:
    """What was made: each robot's value on the last day, which drift and which stand apart."""

    last: dict[str, float]
    drift: set[str]
    apart: set[str]


def fleet(
    seed: int, robots: int = 200, *, days: int = 7, ageing: int = 10, apart: int = 5, trend: float = 0.0
) -> tuple[list[Session], Truth]:
    """Robots that scatter by 8 %, their days by 2 %, fits of 1 to 6 %; some age by 30 % from the third month on."""
    rng = np.random.default_rng(seed)
    sessions, truth = list[Session](), Truth({}, set(), set())
    for number in range(robots):
        name, own = f"r{number:03}", MEAN + rng.normal(0.0, 0.08)
        if number < ageing:
            truth.drift.add(name)
        elif number < ageing + apart:
            truth.apart.add(name)
            own += rng.choice([-0.5, 0.5])
        for month in range(days):
            aged = 0.3 * max(0.0, month - 2) / (days - 3) if name in truth.drift else 0.0
            truth.last[name] = own + aged + trend * month
            error = rng.uniform(0.01, 0.06)
            value = truth.last[name] + rng.normal(0.0, 0.02) + rng.normal(0.0, error)
            sessions.append(Session(name, START + timedelta(days=30 * month), value, error))
    return sessions, truth


def drifting(pooled: FleetParameter, least: float = 0.95) -> set[str]:
    return {name for name, robot in pooled.robots.items() if robot.drifts > least}


@pytest.mark.parametrize("seed", [21, 22, 23])
def test_robots_that_age_or_stand_apart_are_told_and_no_other(seed: int) -> None:
    sessions, truth = fleet(seed)
    pooled = pool(sessions)
    assert len(drifting(pooled) & truth.drift) >= 8
    assert not drifting(pooled) - truth.drift
    apart = {name for name, robot in pooled.robots.items() if robot.apart > 0.95}
    assert apart == truth.apart
    assert pooled.mean == pytest.approx(MEAN, abs=0.03)
    assert pooled.scatter == pytest.approx(0.08, rel=0.25)
    assert pooled.days == pytest.approx(0.02, rel=0.4)
    seen = [day for name in drifting(pooled) if (day := pooled.robots[name].seen)]
    assert all(START + timedelta(days=90) <= day <= START + timedelta(days=180) for day in seen)


@pytest.mark.parametrize("seed", [31, 32])
def test_errors_of_pooled_values_hold_and_are_smaller_than_the_fits(seed: int) -> None:
    sessions, truth = fleet(seed, ageing=0, apart=0)
    pooled = pool(sessions)
    off = np.array([(robot.value - truth.last[name]) / robot.error for name, robot in pooled.robots.items()])
    assert 0.85 < np.sqrt(np.mean(off**2)) < 1.15
    alone = {session.robot: session.error for session in sessions}  # of the last day
    assert np.mean([robot.error < alone[name] for name, robot in pooled.robots.items()]) > 0.8


def test_a_drift_that_all_have_is_the_fleets() -> None:
    sessions, _ = fleet(41, ageing=0, apart=0, trend=0.03)
    pooled = pool(sessions)
    assert pooled.trend == pytest.approx(0.03, rel=0.1)
    assert not drifting(pooled, 0.9)
    assert pooled.mean == pytest.approx(MEAN + 6 * 0.03, abs=0.03)


@pytest.mark.parametrize("robots", [1, 2, 4])
def test_of_few_robots_or_days_nothing_is_made_up(robots: int) -> None:
    for days in (1, 2, 7):
        sessions, _ = fleet(50 + robots, robots, days=days, ageing=0, apart=0)
        pooled = pool(sessions)
        assert not drifting(pooled, 0.5)
        assert all(robot.apart < 0.5 and robot.seen is None for robot in pooled.robots.values())


def test_one_robot_drifts_by_itself() -> None:
    sessions, _ = fleet(24, 1, ageing=1, apart=0)
    pooled = pool(sessions)
    assert (pooled.trend, pooled.scatter) == (0, None)
    assert drifting(pooled) == {"r000"}


def test_without_two_days_of_a_robot_nothing_is_said_of_days() -> None:
    sessions, _ = fleet(25, 40, days=1, ageing=0, apart=0)
    exact = [replace(session, error=0.001) for session in sessions]
    pooled = pool(exact)
    assert pooled.days is None
    assert pooled.scatter == pytest.approx(np.std([session.value for session in exact]), rel=0.1)
    assert max(robot.error for robot in pooled.robots.values()) < 0.002


def test_days_are_told_apart_by_dates_in_names(tmp_path: Path) -> None:
    for name in ("a/walk_2026-03-14.csv", "a/walk_20260315_2.csv", "a/walk_20260315_1.csv", "b/one.csv"):
        write_log(tmp_path / name, seed=1)
    write_log(tmp_path / "b" / "two_2026-03-14.csv", seed=2)
    found = by_day(robots_of([tmp_path]))
    assert [(robot.name, robot.of, str(robot.day), len(robot.logs)) for robot in found] == [
        ("a_2026-03-14", "a", "2026-03-14", 1),
        ("a_2026-03-15", "a", "2026-03-15", 2),
        ("b", "b", "None", 2),  # a log without a day: all together
    ]


def test_a_motor_whose_paste_dries_is_named_with_its_size(tmp_path: Path) -> None:
    (tmp_path / "motor.toml").write_text(MODEL)
    for robot in range(6):
        for month in range(5):
            dry = 1.0 + 0.12 * month if robot == 4 else 1.0
            day = START + timedelta(days=30 * month)
            log = tmp_path / "robots" / f"R{robot}" / f"{day}.csv"
            write_log(log, 10 * robot + month, resistance=RESISTANCE * dry * (1 + 0.02 * robot))
    done = fit_each(tmp_path / "motor.toml", [tmp_path / "robots"])
    assert len(done.fitted) == 30
    (deviation,) = (one for one in done.deviations if one.of.name != "rmse")
    assert (deviation.robot, deviation.of.name, deviation.drifts) == ("R4", "resistance.ambient~motor", True)
    # From 1 to 1.48 in four months: 10 % of its value a month.
    assert deviation.as_json()["per_month"] == pytest.approx(0.1 * RESISTANCE * 1.48 * 1.08, rel=0.3)
    assert str(deviation).startswith("R4: resistance.ambient~motor drifts by +")
