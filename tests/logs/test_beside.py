"""Doubts about a log's units: settled by another run of the robot, and in the way of any conclusion."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from lptn.basics.errors import InputError
from lptn.logs.beside import refuse_doubtful, refuse_other_units
from lptn.logs.columns import ColumnSource
from lptn.logs.reading import read_log
from lptn.logs.run import Run

AIR = "temperature.ambient"


def _run(name: str, room: float, *, in_degf: bool = False, columns: dict[str, ColumnSource] | None = None) -> Run:
    time = np.arange(400.0)
    log = pd.DataFrame(
        {AIR: np.full(400, room), "temperature.a": room + 0.05 * time, "temperature.b": room + 0.02 * time}
    )
    log = 1.8 * log + 32 if in_degf else log
    (run,) = read_log(log.assign(time=time), columns, name=name)
    return run


def test_a_room_in_degf_is_settled_by_a_run_in_the_same_room() -> None:
    cold, monday, hot = _run("cold", 13.0, in_degf=True), _run("monday", 20.0), _run("hot", 56.0)
    assert [issue.certain for issue in cold.issues] == [False] * len(cold.issues)
    with pytest.raises(InputError, match=r"degF, since monday begins at 20 degC") as refused:
        refuse_other_units([monday, cold])
    assert 'unit = "degF"' in str(refused.value)
    refuse_other_units([cold])  # alone it may be a chamber of 55 degC
    refuse_other_units([hot, _run("hotter", 58.0)])
    said = {key: ColumnSource((key,), "degF") for key in (AIR, "temperature.a", "temperature.b")}
    refuse_other_units([monday, _run("cold", 13.0, in_degf=True, columns=said)])


def test_nothing_is_concluded_from_a_run_in_doubt_until_someone_says_what_it_is() -> None:
    refuse_doubtful([_run("monday", 20.0)])
    with pytest.raises(InputError, match="conclusions can be drawn from"):
        refuse_doubtful([_run("monday", 20.0), _run("hot", 56.0)])
    said = {key: ColumnSource((key,), "degC") for key in (AIR, "temperature.a", "temperature.b")}
    refuse_doubtful([_run("hot", 56.0, columns=said)])


def test_a_frozen_sensor_stands_in_the_way_of_no_conclusion() -> None:
    time, rng = np.arange(900.0), np.random.default_rng(1)
    log = pd.DataFrame({"time": time, AIR: 20.0, "temperature.a": 20 + 0.02 * time + rng.normal(0, 0.1, 900)})
    log.loc[300:700, "temperature.a"] = log["temperature.a"][300]
    (run,) = read_log(log, name="frozen")
    assert [issue.kind for issue in run.issues] == ["frozen"]
    refuse_doubtful([run])


def test_air_near_a_joint_stands_in_the_way_until_someone_says_that_it_is_the_rooms_but_a_sign_does_not() -> None:
    time = np.arange(900.0)
    warm = 20 * (1 - np.exp(-time / 300))
    log = pd.DataFrame({"time": time, AIR: 20 + 0.3 * warm, "temperature.a": 20 + warm})
    speed = 3 * np.sin(time / 7)
    log = log.assign(**{"velocity.a": speed, "torque.a": -4 * np.sign(speed)})
    (run,) = read_log(log, name="beside")
    assert {issue.kind for issue in run.issues} == {"follows", "sign"}
    with pytest.raises(InputError, match=r"rises with temperature\.a.*conclusions can be drawn from.*valid = \["):
        refuse_doubtful([run])
    (run,) = read_log(log, {AIR: ColumnSource((AIR,), valid=(-80.0, 80.0))}, name="beside")
    assert {issue.kind for issue in run.issues} == {"sign"}
    refuse_doubtful([run])


def test_surroundings_in_degf_around_a_robot_in_degc() -> None:
    time = np.arange(400.0)
    log = pd.DataFrame({"time": time, AIR: 53.6, "temperature.a": 12.4 + 0.05 * time})
    with pytest.raises(InputError, match=r"surroundings of 53\.6 degC around a robot that begins at 12\.4 degC"):
        read_log(log)


def _room_and_robot(seed: int, follows: float) -> pd.DataFrame:
    """An hour of a knee in stop-and-go, in a room whose temperature drifts by itself over the hour."""
    rng, time = np.random.default_rng(seed), np.arange(3600.0)
    heat = np.repeat(rng.choice([0.0, 4.0, 9.0], 60), 60)
    warm, drift, phase = np.zeros(3600), rng.uniform(1, 4), rng.uniform(0, 6)
    for k in range(3599):
        warm[k + 1] = warm[k] + (heat[k] - warm[k] / 5) / 200
    room = 20 + drift * np.sin(2 * np.pi * rng.uniform(0.2, 0.6) * time / 3600 + phase)
    noise = rng.normal(0, 0.05, (2, 3600))
    columns = {AIR: room + follows * warm + noise[0], "temperature.a": room + warm + noise[1]}
    return pd.DataFrame({"time": time, **columns}).round(2)


@pytest.mark.parametrize("seed", range(20))
def test_a_room_that_warms_as_its_robot_does_by_chance_does_not_follow_it(seed: int) -> None:
    (run,) = read_log(_room_and_robot(seed, 0.0), name="drifting")
    assert run.issues == ()


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("follows", [0.2, 0.35, 0.45])
def test_air_near_a_joint_follows_it_though_its_room_drifts(follows: float, seed: int) -> None:
    (run,) = read_log(_room_and_robot(seed, follows), name="beside")
    assert [issue.kind for issue in run.issues] == ["follows"]
