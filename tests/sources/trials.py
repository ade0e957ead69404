"""What the slow rows share: whole virtual quadrupeds fitted and predicted, minutes each, once a process."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from lptn.identify.comparison import predict
from lptn.identify.data import load_model, split_data
from lptn.online.forecasting import NodeForecast
from lptn.robots.presets import preset_text
from lptn.virtual import quadruped_logs, write_logs
from tests.benchmarks import forecast as forecast_trial

SEEDS = (3, 11)  # robots that nothing was tuned on; at 3 the models are at their worst
LEVELS = ("none", "default")  # of errors that differ from run to run and stand in no log
SOURCE_RUNS: Mapping[str, tuple[float, float, float]] = import_module("whole_body").SOURCE_RUNS
"""[QuadrupedLPTN, table 3]: largest error [°C], mean square error [°C²], reduction [%]."""
ROBOT, TROTS = 401, 5  # of the forecast trial: its first robot


def whole_body(seed: int, level: str = "none") -> Any:
    """One robot through eleven runs of the source's protocol, and its tests; examples/quadruped/whole_body.py."""
    return _trial(seed, level)  # one key of the cache, however it is called


@cache
def _trial(seed: int, level: str) -> Any:
    study = import_module("whole_body")
    with tempfile.TemporaryDirectory() as folder:
        return study.trial(seed, level, Path(folder), study.FEW)


@cache
def windings(seed: int, level: str) -> Any:
    """The same with winding and housing apart, and a trunk; fitted to eleven of the protocol's runs."""
    study = import_module("whole_body")
    with tempfile.TemporaryDirectory() as folder:
        return study.trial(seed, level, Path(folder), study.FEW, "windings")


def largest(seed: int, level: str) -> Mapping[str, tuple[Any, tuple[float, float]]]:
    """Of each held-out run the errors of both models, and the oracle's largest and mean square error."""
    floor = import_module("oracle").floor(seed, level)
    return {pair.what: (pair, floor[pair.what]) for pair in windings(seed, level).tests.runs}


def neighbours(seed: int) -> dict[str, tuple[float, float, float]]:
    """Rise [K] of the unpowered joints beside a powered knee over its run: truth, whole body, single nodes."""
    name, beside = "knee_RF_LR_10Nm", ("FR_hip", "FR_thigh", "RL_hip", "RL_thigh")
    logs = quadruped_logs(seed=seed, level="none", quantisation=1.0)
    rises: dict[str, list[float]] = {joint: [] for joint in beside}
    truth, study = logs.truth[name], import_module("whole_body")
    with tempfile.TemporaryDirectory() as folder:  # fitted to all runs of the protocol, this one too, as the source's
        fitted = study.trial(seed, "none", Path(folder), tuple(logs))
    for joint in beside:
        rises[joint].append(_rise(truth[f"temperature.{joint}"].to_numpy()))
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        write_logs(place / "logs", logs)
        for fit, variant in zip(fitted.fits, (None, "single-node"), strict=True):
            path = place / "model.toml"
            path.write_text(preset_text("quadruped", variant))
            loaded = load_model(path)
            (segment,) = split_data(loaded.runs([place / "logs" / f"{name}.parquet"])).fit
            prediction = predict(fit.model, segment, np.ones(len(fit.model.nodes)))
            for joint in beside:
                rises[joint].append(_rise(prediction.readings[fit.model.nodes.index(joint)]))
    return {joint: (values[0], values[1], values[2]) for joint, values in rises.items()}


def _rise(temperature: np.ndarray) -> float:
    return float(temperature[-1] - temperature[0])


@dataclass(frozen=True)
class Forecasted:
    """A forecast of the first joint: error as a share of the time to go, and whether its interval held."""

    error: float
    inside: bool


@cache
def forecasts() -> tuple[Forecasted, ...]:
    """Trots of one robot forecast with the shipped model, fitted to the robot's protocol, as it passes 48 degC."""
    done = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        robot = forecast_trial.fitted(ROBOT, "windings", folder)
        for trot, run in forecast_trial.planned(ROBOT, TROTS).items():
            trial = forecast_trial.trials(robot, trot, run, 48.0, (), folder)[0]
            said: NodeForecast = trial.steady.nodes[trial.first]
            true = trial.truth[trial.first]
            done.append(Forecasted(forecast_trial.error(said, true), forecast_trial.holds(said, true)))
    return tuple(done)
