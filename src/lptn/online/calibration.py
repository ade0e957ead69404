"""What is usual on healthy logs: how wrong the model is there, and how much it looks like a fault by chance.

A calibration is kept in a file, so that healthy logs need to be studied only once.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache
from itertools import product
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import BaseModel, Field, ValidationError

from lptn.basics.arrays import FloatArray
from lptn.basics.bounds import DESCRIPTION
from lptn.basics.errors import InputError
from lptn.basics.files import bytes_of, write_whole
from lptn.basics.places import class_of
from lptn.basics.processes import one_blas_thread
from lptn.basics.toml import expectation, found_in, sentence
from lptn.identify.noise import estimate_noise
from lptn.logs.run import Run
from lptn.model.model import Model
from lptn.online.augmented_model import BIAS_TIME, ModelError
from lptn.online.fault_bank import (
    KINDS,
    LAG,
    MODEL_OFF,
    STEP,
    Hypothesis,
    Innovations,
    Kind,
    coarsely_bound,
    prescribed,
    warming_by_loads,
)  # fmt: skip
from lptn.online.quantisation import SENSOR_ERROR
from lptn.simulate.bound_run import bind

FALSE_ALARMS = 0.01
"""False alarms an hour that are put up with, all sensors of a robot together: one in a hundred hours."""
_SEARCH_STEP = 30.0  # s; model errors wander over minutes, so coarser steps than the detector's show them as well
_SEARCH_RUNS = 8
_BLOCK_OF_MAXIMA = 1800.0  # s; the largest weight is taken over blocks of about so long, beyond a joint's time constant
_LEAST_LIMIT = 4.5  # standard deviations; a quieter log is luck
_UNTRIED = 9.0  # standard deviations; the limit where no healthy log was given

Report = Callable[[str], None]


_Size = Annotated[float, Field(ge=0, allow_inf_nan=False)]
_Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]


class Calibration(BaseModel, frozen=True, extra="forbid"):
    """The statistical detector's calibration, as it is stored in a file.

    Args:
        nodes: of the model, in order.
        healthy_hours: length of the healthy logs; 0 where there were none.
        limits: weight that calls a fault of each kind, an offset, a drift, a lag [standard deviations].
        noise: of the sensors, one for each node, rounding included [K].
        model_error: what the model lacks on healthy logs.
    """

    nodes: tuple[str, ...]
    healthy_hours: _Size
    limits: dict[Kind, _Positive]
    noise: tuple[_Size, ...]
    model_error: ModelError


@one_blas_thread
def calibrate(
    model: Model, runs: Sequence[Run], *, false_alarms: float = FALSE_ALARMS, report: Report = lambda _: None
) -> Calibration:
    """Learn from healthy logs, best those that the model was fitted on, what a healthy log looks like.

    The sizes of the model's errors are those under which the filter's innovations are likeliest. The limits
    follow from the largest weight of a fault at each sensor in each half hour: the tail of these maxima says what is
    passed as rarely as was asked for, and a margin is added. What the healthy logs don't hold (a gait, a load) is not
    in it.

    Args:
        runs: healthy runs.
        false_alarms: how many a robot may give in an hour, all sensors and kinds together.
        report: gets a line on what is being done.

    Raises:
        ValueError: no run, or a rate that is not above 0.
    """
    if not runs or not false_alarms > 0:
        raise ValueError("calibrate: expected one healthy run or more, and a rate of false alarms above 0")
    noise = _noise(model, runs)
    some = np.unique(np.linspace(0, len(runs) - 1, min(len(runs), _SEARCH_RUNS)).round().astype(int))
    first = ModelError()  # which the search replaces
    error = _likeliest([Hypothesis.of(model, runs[index], noise, first, _SEARCH_STEP) for index in some], report)
    weights = list[FloatArray]()
    for number, run in enumerate(runs, start=1):
        report(f"calibrating on healthy logs: {number} of {len(runs)}")
        healthy = Hypothesis.of(model, run, noise, error)
        weight = Innovations(healthy).faults(len(healthy.run)).weight
        blocks = max(1, round(len(weight) * healthy.run.run.step / _BLOCK_OF_MAXIMA))
        weights += [block.max(axis=0) for block in np.array_split(weight, blocks)]
    hours = sum(len(run) * run.step for run in runs) / 3600
    share = false_alarms * hours / len(weights) / (len(KINDS) * len(model.nodes))
    maxima = np.array(weights)
    # A lag's course is known, so chance alone passes no limit (Ville's inequality): only a model that is wrong does.
    usual = [*(rare(maxima[:, kind].ravel(), share) for kind in range(LAG)), float(maxima[:, LAG].max())]
    limits: dict[Kind, float] = {
        kind: max(_MARGIN * weight, _LEAST_LIMIT) for kind, weight in zip(KINDS, usual, strict=True)
    }
    return Calibration(nodes=tuple(model.nodes), healthy_hours=hours, limits=limits, noise=noise, model_error=error)


def uncalibrated(model: Model, runs: Sequence[Run], rmse: float | None) -> Calibration:
    """A cautious guess for want of healthy logs: errors as large as the fit's, limits set high.

    Args:
        runs: the logs to watch, for their sensors' noise.
        rmse: of the model's fit [K], if it was fitted.
    """
    bound_runs = [bind(model, run) for run in runs]
    capacities = model.values[[model.network.capacities[node] for node in model.nodes]]
    heats = np.concatenate([warming_by_loads(model, bound) for bound in bound_runs], axis=1) * capacities[:, None]
    loaded = heats[heats.any(axis=1)]
    # A watt of heat for each kelvin of the fit's error, or as large a share of the loads' heat as parameters are off.
    of_loads = MODEL_OFF * float(np.sqrt(np.square(loaded).mean())) if loaded.size else 0.0
    size = max(_FIRST_SIZES["heat"], rmse or 0.0, of_loads)
    inputs = dict.fromkeys(prescribed(model), _FIRST_INPUT)
    error = ModelError(size, _FIRST_HEAT_TIME, _FIRST_SIZES["change"], size, 2 * _FIRST_AIR, inputs)
    limits: dict[Kind, float] = dict.fromkeys(KINDS, _UNTRIED)
    limits["lag"] = _LEAST_LIMIT  # of a fault whose course is known, and which explains more than any other
    return Calibration(
        nodes=tuple(model.nodes),
        healthy_hours=0.0,
        limits=limits,
        noise=_noise(model, runs),
        model_error=error,
    )


def _noise(model: Model, runs: Sequence[Run]) -> tuple[float, ...]:
    """Noise of each sensor in the detector's steps [K], as if each reading had its own.

    What rounding adds stays as long as the temperature is in one cell, so that all readings of a cell say as much of it
    as one.
    """
    noise = estimate_noise([bind(model, run) for run in runs], model.nodes)
    readings = [coarsely_bound(model, run, STEP).measured for run in runs]
    step = noise.step if noise.left is None else noise.left
    moved = sum(np.nansum(np.abs(np.diff(one, axis=1)), axis=1) for one in readings)  # K
    count = sum(np.isfinite(one).sum(axis=1) for one in readings)
    in_a_cell = np.maximum(count * step / np.maximum(np.maximum(moved, step), SENSOR_ERROR), 1.0)
    return tuple(np.hypot(noise.floor, step * np.sqrt((in_a_cell - 1) / 12)).tolist())


# --- Limits that healthy logs pass rarely ---------------------------------------------------------

_TAIL, _LEAST_TAIL = 0.1, 20  # share, and number, of the largest maxima that the tail is fitted to
_MARGIN = 1.1  # on the limits: healthy logs to come hold what those before did not


def rare(maxima: FloatArray, share: float) -> float:
    """The value that only this share of maxima passes, by an exponential tail fitted to the largest tenth of them.

    Only the largest count, for quiet logs say nothing of what busy ones can do.
    """
    tail = min(0.5, max(_TAIL, _LEAST_TAIL / maxima.size))
    border = float(np.quantile(maxima, 1 - tail))
    excess = maxima[maxima > border] - border
    slope = float(excess.mean()) if excess.size else 0.0
    return float(max(border + slope * np.log(tail / min(share, tail)), maxima.max()))


# --- How wrong a model is on healthy runs: the errors under which the innovations are likeliest ---

_FACTOR = 2.0  # from one size tried to the next
_GAIN = 2e-3  # of log-likelihood a reading; less than that is not worth another trial
_HEAT_TIMES = _SEARCH_STEP, BIAS_TIME  # s; what wanders within a step is white, what lasts for longer is the bias
_FIRST_SIZES = {"heat": 0.5, "change": 0.5, "bias": 0.5}  # W, share, W
_FIRST_HEAT_TIME, _FIRST_AIR, _FIRST_INPUT = 100.0, 0.1, 1.0  # s; share; K


def _likeliest(healthy: Sequence[Hypothesis], report: Report) -> ModelError:
    """The model errors under which the innovations on healthy runs are likeliest, to a factor of two.

    Nodes of a class (all calves) share their sizes: a model is as wrong about one as about the other.
    """
    readings, model = sum(int(np.isfinite(one.measured).sum()) for one in healthy), healthy[0].model
    air = prescribed(model)
    best = {"heat_time": _FIRST_HEAT_TIME, "air": _FIRST_AIR, **dict.fromkeys(air, _FIRST_INPUT)}
    for name in dict.fromkeys(map(class_of, model.nodes)):
        best |= {f"{kind} {name}": size for kind, size in _FIRST_SIZES.items()}

    def error(sizes: dict[str, float]) -> ModelError:
        heat, change, bias = (
            {node: sizes[f"{kind} {class_of(node)}"] for node in model.nodes} for kind in _FIRST_SIZES
        )
        return ModelError(
            heat, sizes["heat_time"], change, bias, sizes["air"], {column: sizes[column] for column in air}
        )

    @cache
    def value(sizes: tuple[tuple[str, float], ...]) -> float:
        report(f"calibrating: sizes of the model's errors, trial {value.cache_info().misses}")
        return sum(replace(one, error=error(dict(sizes))).nats() for one in healthy) / max(readings, 1)

    def times(name: str, factor: float) -> dict[str, float]:
        size = best[name] * factor
        return best | {name: float(np.clip(size, *_HEAT_TIMES)) if name == "heat_time" else size}

    before: dict[str, float] = {}
    while best != before:
        before = best
        for name, factor in product(before, (_FACTOR, 1 / _FACTOR)):
            while value(tuple((trial := times(name, factor)).items())) > value(tuple(best.items())) + _GAIN:
                best = trial
    return error(best)


# --- The file -------------------------------------------------------------------------------------


def write_calibration(calibration: Calibration, path: Path) -> None:
    """Write a calibration as JSON, whole or not at all."""
    write_whole(path, calibration.model_dump_json(indent=2) + "\n")


def read_calibration(path: Path, model: Model) -> Calibration:
    """Read a calibration of a model.

    Raises:
        InputError: the file can't be read, is not a calibration, or is one of another model.
    """
    try:
        read = Calibration.model_validate_json(bytes_of(path, DESCRIPTION, "a calibration, as `--healthy` writes it"))
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(str(part) for part in first["loc"]) or "calibration"
        stands = sentence(first["msg"]) if first["type"] == "json_invalid" else found_in(first)
        expected = "JSON" if first["type"] == "json_invalid" else expectation(first)
        raise InputError(path, place, stands, f"{expected}, as `lptn monitor --healthy` writes it") from error
    if set(read.limits) != set(KINDS):
        raise InputError(path, "limits", ", ".join(read.limits) or "none", f"one for each of {', '.join(KINDS)}")
    same = read.nodes == tuple(model.nodes) and len(read.noise) == len(model.nodes)
    if not same or not set(read.model_error.inputs) <= set(model.inputs):
        expected = f"those of the model: {', '.join(model.nodes)}"
        raise InputError(path, "nodes", ", ".join(read.nodes) or "none", expected)
    return read
