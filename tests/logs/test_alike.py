"""Two sensors that read alike: joints that work alike are as warm by right, and only a copy has another's noise."""

from __future__ import annotations

from functools import cache

import numpy as np
import pandas as pd
import pytest

from lptn.basics.arrays import FloatArray
from lptn.logs.reading import read_log
from lptn.virtual import Bout, Job, leg_logs, quadruped_logs

STAND_AND_TROT = (Bout("stand", 300), Bout("trot", 600, 0.8))
TROT, STAND = (Bout("trot", 1800, 0.5, 2.0),), (Bout("stand", 1800, 0, 4.0),)
SQUAT, WALK = ((Bout(act, 900, 0.9, 2.0), Bout("rest", 900)) for act in ("squat", "walk"))


@cache
def quadruped(seed: int, segments: tuple[Bout, ...], noise: float, step: float) -> pd.DataFrame:
    """A log of a healthy one at 1 Hz."""
    run = Job(segments, cutout=None)
    return quadruped_logs(seed=seed, runs={"run": run}, noise=noise, quantisation=step)["run"]


def biped(seed: int, noise: float, step: float, scatter: float) -> pd.DataFrame:
    """Half an hour of gaits of a minute: hips and knees, left and right, each a mass of its own by scatter."""
    rng, time = np.random.default_rng(seed), np.arange(1800.0)
    gaits = np.repeat(rng.choice([0.0, 2.0, 5.0, 7.0], 30), 60)
    log = pd.DataFrame({"time": time, "temperature.ambient": 22.0})
    for joint, share in {"hip": 0.8, "knee": 1.0}.items():
        for side in ("L", "R"):
            current = gaits * share * (1 + scatter * rng.standard_normal())
            heat, out = 0.2 * current**2 / 300, np.exp(scatter * rng.standard_normal()) / 1500
            true = np.full(time.size, 22.0)
            for k in range(time.size - 1):
                true[k + 1] = true[k] + heat[k] - out * (true[k] - 22.0)
            log[f"current.{joint}_{side}"] = current
            log[f"temperature.{joint}_{side}"] = rounded(true + rng.normal(0, noise, time.size), step)
    return log


def rounded(readings: FloatArray, step: float) -> FloatArray:
    return np.asarray(np.round(readings / step) * step if step else readings)


def duplicates(log: pd.DataFrame) -> list[set[str]]:
    issues = [issue for issue in read_log(log, strict=False)[0].issues if issue.kind == "duplicate"]
    return [{issue.key, issue.problem.rpartition(" ")[2]} for issue in issues]


@pytest.mark.parametrize("noise_and_step", [(0.15, 1.0), (0.1, 0.5), (0.1, 0.0), (0.0, 1.0)])
@pytest.mark.parametrize(
    ("seed", "segments"),
    [(98, STAND_AND_TROT), (3, STAND_AND_TROT), (41, STAND_AND_TROT), (98, TROT), (7, STAND), (5, SQUAT), (12, WALK)],
)
def test_joints_that_work_alike_are_as_warm_and_are_no_copies(
    seed: int, segments: tuple[Bout, ...], noise_and_step: tuple[float, float]
) -> None:
    assert not duplicates(quadruped(seed, segments, *noise_and_step))


@pytest.mark.parametrize("noise_and_step", [(0.15, 1.0), (0.1, 0.5), (0.1, 0.0)])
@pytest.mark.parametrize(("seed", "scatter"), [(0, 0.0), (1, 0.002), (2, 0.01), (3, 0.05)])
def test_a_biped_whose_legs_are_alike_has_no_copies(
    seed: int, scatter: float, noise_and_step: tuple[float, float]
) -> None:
    assert not duplicates(biped(seed, *noise_and_step, scatter))


@pytest.mark.parametrize(
    ("seed", "scatter", "step"),
    [(1, 0.0005, 0.5), (1, 0.001, 0.5), (2, 0.0005, 0.5), (10, 0.0005, 0.5), (11, 0.0005, 1.0)],
)
def test_coarse_sensors_without_noise_of_two_legs_that_are_alike_are_no_copies(
    seed: int, scatter: float, step: float
) -> None:
    """They give the same number in 99 of 100 rows, and cross half of their steps in the same row."""
    log = biped(seed, 0.0, step, scatter)
    assert not duplicates(log)
    log["temperature.knee_R"] = log["temperature.knee_L"]
    assert {"temperature.knee_L", "temperature.knee_R"} in duplicates(log)


@pytest.mark.parametrize("hold", [3, 10])
@pytest.mark.parametrize(("seed", "segments"), [(98, STAND_AND_TROT), (4, SQUAT), (7, TROT)])
def test_sensors_that_one_bus_repeats_for_seconds_are_no_copies(
    seed: int, segments: tuple[Bout, ...], hold: int
) -> None:
    log = quadruped(seed, segments, 0.03, 0.0).copy()
    names = [name for name in map(str, log) if name.startswith("temperature.")]
    log[names] = log[names].to_numpy()[np.arange(len(log)) // hold * hold]
    assert not duplicates(log)


@pytest.mark.parametrize("step", [0.0, 0.1, 1.0])
@pytest.mark.parametrize(("seed", "segments"), [(98, STAND_AND_TROT), (4, STAND), (7, TROT)])
def test_sensors_that_share_their_converters_noise_are_no_copies(
    seed: int, segments: tuple[Bout, ...], step: float
) -> None:
    log, rng = quadruped(seed, segments, 0.1, 0.0).copy(), np.random.default_rng(seed)
    names = [name for name in map(str, log) if name.startswith("temperature.")]
    log[names] = rounded(log[names].to_numpy() + rng.normal(0, 0.2, (len(log), 1)), step)
    assert not duplicates(log)


@pytest.mark.parametrize(
    ("sensors", "own", "offset"),  # noise and step of both
    [
        ((0.15, 1.0), (0.1, 0.01), 0.0),
        ((0.15, 1.0), (0.3, 1.0), 2.7),
        ((0.15, 1.0), (0.0, 1.0), 3.0),
        ((0.3, 0.0), (0.2, 1.0), 0.0),
        ((0.1, 0.5), (0.1, 0.0), 2.7),
        ((0.1, 0.1), (0.1, 0.1), 0.0),
        ((0.1, 0.1), (0.03, 0.0), -1.3),
        ((0.1, 0.1), (0.0, 0.0), 1.3),
    ],
)
@pytest.mark.parametrize(
    ("seed", "segments", "pair"),
    [
        (98, STAND_AND_TROT, ("FL_calf", "RL_thigh")),
        (3, TROT, ("FL_calf", "FR_calf")),  # loads alike: the noise alone tells
        (5, SQUAT, ("RL_thigh", "RR_thigh")),
        (6, WALK, ("FR_calf", "pc")),  # whose load nobody logs
    ],
)
def test_a_copy_is_found_by_the_noise_of_its_sensor(
    seed: int,
    segments: tuple[Bout, ...],
    pair: tuple[str, str],
    sensors: tuple[float, float],
    own: tuple[float, float],
    offset: float,
) -> None:
    log, rng = quadruped(seed, segments, *sensors).copy(), np.random.default_rng(seed)
    of, copied = (f"temperature.{place}" for place in pair)
    log[copied] = rounded(log[of].to_numpy() + offset + rng.normal(0, own[0], len(log)), own[1])
    assert {of, copied} in duplicates(log)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_legs_copy_is_found_in_a_log_of_ten_rows_a_second(seed: int) -> None:
    log, rng = leg_logs([], seed=seed, noise=0.1, quantisation=0.1)["fit1"], np.random.default_rng(seed)
    assert not duplicates(log)
    log["temperature.FR_calf"] = log["temperature.FR_thigh"] + rng.normal(0, 0.1, len(log))
    assert duplicates(log) == [{"temperature.FR_calf", "temperature.FR_thigh"}]
