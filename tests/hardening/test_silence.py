"""Channels that stand still, are gone or clamped: said on the line of that channel, and of no other.

Logs of virtual robots, corrupted after they were made; beside them the same logs as they were.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import numpy.typing as npt
import pandas as pd
import pytest

from lptn.logs.columns import ColumnSource
from lptn.logs.quality import Issue
from lptn.logs.reading import read_log
from lptn.virtual import leg_logs

Corrupt = Callable[[pd.DataFrame], None]
SEEDS = (1, 2, 3)


@cache
def _healthy(seed: int, steps: float) -> pd.DataFrame:
    return leg_logs([], seed=seed, noise=0.1, quantisation=steps, columns="all")["fit1"].reset_index(drop=True)


def _log(seed: int, steps: float) -> pd.DataFrame:
    return _healthy(seed, steps).copy()


def _between(log: pd.DataFrame, start: float, stop: float) -> npt.NDArray[np.bool_]:
    time = log["time"].to_numpy() - log["time"].iloc[0]
    return np.asarray((time >= start) & (time <= stop))


def _hold(log: pd.DataFrame, key: str, start: float, stop: float, more: float = 0.0) -> None:
    inside = _between(log, start, stop)
    log.loc[inside, key] = log.loc[inside, key].iloc[0] + more


def _frozen(log: pd.DataFrame) -> None:
    _hold(log, "temperature.FR_calf", 300, 1500)


def _frozen_to_the_end(log: pd.DataFrame) -> None:
    _hold(log, "temperature.FR_calf", log["time"].iloc[-1] - log["time"].iloc[0] - 600, np.inf)


def _dead(log: pd.DataFrame) -> None:
    log.loc[_between(log, 300, 1200), "temperature.FR_calf"] = 0.0


def _full_scale_to_the_end(log: pd.DataFrame) -> None:
    log.loc[_between(log, 1500, np.inf), "temperature.FR_calf"] = 125.0


def _clamped(log: pd.DataFrame) -> None:
    readings = log["temperature.FR_calf"]
    log["temperature.FR_calf"] = np.minimum(readings, np.floor(readings.quantile(0.6)))


def _torque_frozen(log: pd.DataFrame) -> None:
    _hold(log, "torque.FR_calf", 300, 1200, more=1.0)


def _torque_huge(log: pd.DataFrame) -> None:
    log.loc[700, "torque.FR_calf"] = 18_000.0


CORRUPTIONS: dict[str, tuple[Corrupt, str, str]] = {
    "frozen": (_frozen, "temperature.FR_calf", "frozen"),
    "frozen to the end": (_frozen_to_the_end, "temperature.FR_calf", "frozen"),
    "dead": (_dead, "temperature.FR_calf", "dead"),
    "full scale to the end": (_full_scale_to_the_end, "temperature.FR_calf", "dead"),
    "clamped": (_clamped, "temperature.FR_calf", "clamped"),
    "torque frozen": (_torque_frozen, "torque.FR_calf", "frozen"),
    "torque huge": (_torque_huge, "torque.FR_calf", "size"),
}


def _issues(log: pd.DataFrame) -> list[Issue]:
    return [issue for run in read_log(log, strict=False) for issue in run.issues]


@pytest.mark.parametrize("steps", [0.0, 0.1, 1.0])
@pytest.mark.parametrize("seed", SEEDS)
def test_a_healthy_log_is_called_so(steps: float, seed: int) -> None:
    assert not _issues(_log(seed, steps))


@pytest.mark.parametrize("kind", CORRUPTIONS)
@pytest.mark.parametrize("seed", SEEDS)
def test_what_a_fine_sensor_never_does_is_said_of_that_channel_alone(kind: str, seed: int) -> None:
    corrupt, key, expected = CORRUPTIONS[kind]
    log = _log(seed, 0.1)
    corrupt(log)
    found = {(issue.key, issue.kind) for issue in _issues(log)}
    if kind == "frozen to the end":  # at its highest, that and a clamped sensor are the same to a log
        found = {(place, what.replace("clamped", "frozen")) for place, what in found}
    assert found == {(key, expected)}


@pytest.mark.parametrize("kind", ["dead", "full scale to the end"])
@pytest.mark.parametrize("seed", SEEDS)
def test_coarse_sensors_too_where_they_jump(kind: str, seed: int) -> None:
    corrupt, key, expected = CORRUPTIONS[kind]
    log = _log(seed, 1.0)
    corrupt(log)
    assert {(issue.key, issue.kind) for issue in _issues(log)} == {(key, expected)}


def test_two_channels_with_the_same_readings() -> None:
    log = _log(1, 0.1)
    log["temperature.FR_calf"] = log["temperature.FR_hip"]
    (issue,) = _issues(log)
    assert issue.kind == "duplicate"
    assert {issue.key, issue.problem.rpartition(" ")[2]} == {"temperature.FR_calf", "temperature.FR_hip"}


def test_a_torque_of_zero_is_odd_only_while_the_joint_moves() -> None:
    log = _log(1, 0.1)
    inside = _between(log, 300, 1200)
    log.loc[inside, "torque.FR_calf"] = 0.0
    log.loc[inside, "velocity.FR_calf"] = 0.0
    assert not _issues(log)
    log.loc[inside, "velocity.FR_calf"] = 1.5
    (issue,) = _issues(log)
    assert (issue.key, issue.kind) == ("torque.FR_calf", "frozen")


def test_a_torque_that_no_joint_bears_is_refused() -> None:
    log = _log(1, 0.1)
    _torque_huge(log)
    with pytest.raises(ValueError, match="more than any joint bears"):
        read_log(log)
    source = ColumnSource(("torque.FR_calf",), unit="N*m")
    with pytest.raises(ValueError, match="more than any joint bears"):
        read_log(log, {"torque.FR_calf": source})
    read_log(log, {"torque.FR_calf": replace(source, valid=(-100.0, 100.0))})
