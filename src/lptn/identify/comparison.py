"""Errors (predicted − measured) by run, node and condition; two models on the same logs; predictions as a log."""

from __future__ import annotations

import io
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from pathlib import Path

import numpy as np
import pandas as pd

from lptn.basics.arrays import FloatArray
from lptn.basics.errors import InputError
from lptn.basics.files import write_whole
from lptn.basics.places import class_of
from lptn.identify.data import Segment
from lptn.identify.fitting import fit_nuisances, fit_starts
from lptn.identify.noise import Noise, balanced_sigma, estimate_noise
from lptn.model.model import Model
from lptn.simulate.simulation import BoundRun, bind, simulate

# --- Error per run, node and operating condition: where the model fails ---------------------------


_BINS = 5


@dataclass(frozen=True)
class Prediction:
    """One run, predicted freely from its opening.

    Args:
        part: the run and its windows.
        drive: its inputs and readings, with those that count behind the opening.
        readings: predicted readings [degC], shape (nodes, n).
        states: simulated states, shape (states, n + 1).
    """

    part: Segment
    bound: BoundRun
    readings: FloatArray
    states: FloatArray

    @property
    def error(self) -> FloatArray:
        """Predicted minus measured [K], shape (nodes, n), NaN where nothing counts."""
        return np.where(self.bound.counted, self.readings - self.bound.measured, np.nan)


@dataclass(frozen=True)
class Errors:
    """Error of a set of readings [K]: root mean square, largest, mean (predicted minus measured)."""

    rmse: float
    max: float
    mean: float
    count: int

    @classmethod
    def of(cls, error: FloatArray) -> Errors:
        """Errors of the finite entries of an array of predicted minus measured."""
        finite = error[np.isfinite(error)]
        if finite.size == 0:
            return cls(float("nan"), float("nan"), float("nan"), 0)
        root = float(np.sqrt(np.mean(finite**2)))
        return cls(root, float(np.abs(finite).max()), float(finite.mean()), int(finite.size))


@dataclass(frozen=True)
class Condition:
    """Errors in one bin of an operating condition at one node."""

    node: str
    quantity: str
    lower: float
    upper: float
    errors: Errors


@dataclass(frozen=True)
class Comparison:
    """A model against measurements.

    Args:
        model: the model.
        predictions: one for each run.
        noise: the sensors' noise, the floor that no model can pass.
    """

    model: Model
    predictions: tuple[Prediction, ...]
    noise: Noise

    @cached_property
    def all(self) -> Errors:
        """Errors over all readings that count."""
        return Errors.of(np.concatenate([prediction.error.ravel() for prediction in self.predictions]))

    def node(self, name: str, prediction: Prediction | None = None) -> Errors:
        """Errors at one node, over all runs or in one."""
        row = self.model.nodes.index(name)
        chosen = self.predictions if prediction is None else (prediction,)
        return Errors.of(np.concatenate([each.error[row] for each in chosen]))

    def floor(self, name: str) -> float:
        """The RMSE that noise and steps of the sensor alone would give at a node [K]."""
        return float(self.noise.floor[self.model.nodes.index(name)])

    def conditions(self) -> list[Condition]:
        """Errors binned over each node's torque, speed, temperature and the time since the start."""
        found = []
        for row, node in enumerate(self.model.nodes):
            error = np.concatenate([prediction.error[row] for prediction in self.predictions])
            for quantity, values in self._quantities(row).items():
                found += _binned(node, quantity, values, error)
        return found

    def as_json(self) -> dict[str, object]:
        """The comparison as other tools read it, in kelvin."""
        runs: dict[str, object] = {}
        for prediction in self.predictions:
            name = prediction.part.run.name
            # Logs of one name from two folders must not hide each other.
            name = name if name not in runs else f"{name} ({prediction.part.run.source})"
            errors = {node: self.node(node, prediction) for node in self.model.nodes}
            runs[name] = {
                "nodes": {
                    node: {"rmse": each.rmse, "max": each.max, "mean": each.mean, "floor": self.floor(node)}
                    for node, each in errors.items()
                    if each.count
                }
            }
        return {"runs": runs, "all": {"rmse": self.all.rmse, "max": self.all.max}}

    def _quantities(self, row: int) -> dict[str, FloatArray]:
        node = self.model.nodes[row]
        columns = {
            "torque [N·m]": f"torque.{node}",
            "current [A]": f"current.{node}",
            "power": f"power.{node}",
            "joint speed [rad/s]": f"velocity.{node}",
            "base speed [m/s]": "speed.base",
        }
        runs = [prediction.part.run for prediction in self.predictions]
        found = {
            title: np.concatenate([run.columns[column] for run in runs])
            for title, column in columns.items()
            if all(run.has(column) for run in runs)
        }
        found["temperature [°C]"] = np.concatenate([each.bound.measured[row] for each in self.predictions])
        found["time since start [s]"] = np.concatenate([run.time - run.time[0] for run in runs])
        return found


def predict(model: Model, part: Segment, sigma: FloatArray) -> Prediction:
    """Predict a run from the initial states that its opening gives.

    Where the model grants the run an error that is no part of the robot, such as the ambient sensor's, that is taken
    from all of the run: one number with a prior.

    Args:
        model: at the values that it is to predict with.
        part: the run, which stretch of it finds the start, and which counts.
        sigma: standard deviation that weighs each node [K], shape (nodes,).
    """
    bound = bind(model, part.run)
    model = fit_nuisances(model, bound.count((part.opening[0], part.counted[1])).until(part.counted[1]), sigma)
    opening = bound.count(part.opening).until(part.opening[1])
    (start,) = fit_starts(model, [opening], sigma)
    path = simulate(model, bound, model.values, start)
    return Prediction(part, bound.count(part.counted), path.readings, path.states)


def compare(model: Model, parts: Sequence[Segment]) -> Comparison:
    """Predict each run and set the prediction against what was measured.

    Raises:
        InputError: a run lacks an input, or measures none of the model's nodes.
    """
    bound_runs = [bind(model, part.run) for part in parts]
    noise = estimate_noise(bound_runs, model.nodes)
    sigma = balanced_sigma(bound_runs, noise)
    return Comparison(model, tuple(predict(model, part, sigma) for part in parts), noise)


def _binned(node: str, quantity: str, values: FloatArray, error: FloatArray) -> list[Condition]:
    """Bins with equally many readings, so that none is judged on a handful."""
    usable = np.isfinite(values) & np.isfinite(error)
    if usable.sum() < _BINS * 2 or np.ptp(values[usable]) == 0:
        return []
    edges = np.unique(np.quantile(values[usable], np.linspace(0, 1, _BINS + 1)))
    found = []
    for lower, upper in pairwise(edges):
        last = upper == edges[-1]
        inside = usable & (values >= lower) & ((values <= upper) if last else (values < upper))
        if inside.any():
            found.append(Condition(node, quantity, float(lower), float(upper), Errors.of(error[inside])))
    return found


# --- Two models on the same logs: mean error by class of joints, largest and mean square error by condition ---


@dataclass(frozen=True)
class Pair:
    """Errors of two models on the same readings [K].

    Args:
        what: the class of joints, or the run, that the readings are of.
        mean: mean absolute errors.
        square: mean square errors [K²].
        max: largest absolute errors.
    """

    what: str
    mean: tuple[float, float]
    square: tuple[float, float]
    max: tuple[float, float]

    @classmethod
    def of(cls, what: str, errors: tuple[FloatArray, FloatArray]) -> Pair:
        """From predicted minus measured [K], NaN where nothing counts."""
        finite = [np.abs(error[np.isfinite(error)]) for error in errors]
        mean, square, largest = zip(
            *((float(e.mean()), float((e**2).mean()), float(e.max())) for e in finite), strict=True
        )
        return cls(what, mean, square, largest)

    @property
    def figures(self) -> tuple[tuple[float, float, str], ...]:
        """Mean, largest and mean square error of both models, with the unit."""
        return ((*self.mean, "K"), (*self.max, "K"), (*self.square, "K²"))

    @property
    def reduction(self) -> float:
        """By how much of the second model's largest error the first one's is smaller."""
        return 1.0 - self.max[0] / self.max[1]

    @property
    def square_reduction(self) -> float:
        """By how much of the second model's mean square error the first one's is smaller."""
        return 1.0 - self.square[0] / self.square[1]


@dataclass(frozen=True)
class Versus:
    """A model against another on the nodes and runs that both predict.

    Source: [QuadrupedLPTN, table 2, 3] (classes, conditions); "error reduction" in table 3 is that of the
    largest error.
    """

    model: Comparison
    other: Comparison

    @property
    def names(self) -> tuple[str, str]:
        """What the two models are called; by their files where they have one name."""
        one, other = self.model.model.network, self.other.model.network
        return (one.name, other.name) if one.name != other.name else (Path(one.origin).name, Path(other.origin).name)

    @cached_property
    def nodes(self) -> list[str]:
        """Nodes that both models have."""
        return [node for node in self.model.model.nodes if node in self.other.model.nodes]

    @cached_property
    def classes(self) -> list[Pair]:
        """Errors of each class of like nodes over all runs, then of all nodes."""
        groups: dict[str, list[str]] = {}
        for node in self.nodes:
            groups.setdefault(class_of(node), []).append(node)
        found = [self._pair(name, members, range(len(self.model.predictions))) for name, members in groups.items()]
        return [*found, self._pair("all", self.nodes, range(len(self.model.predictions)))]

    @cached_property
    def runs(self) -> list[Pair]:
        """Errors of all nodes in each run."""
        runs = [prediction.part.run.name for prediction in self.model.predictions]
        return [self._pair(name, self.nodes, [number]) for number, name in enumerate(runs)]

    def _pair(self, what: str, nodes: Sequence[str], runs: Sequence[int]) -> Pair:
        return Pair.of(what, (_errors(self.model, nodes, runs), _errors(self.other, nodes, runs)))

    def as_json(self) -> dict[str, object]:
        """Both models' errors as other tools read them, in kelvin; the given model first, then the other."""

        def written(pairs: Sequence[Pair]) -> dict[str, object]:
            return {
                pair.what: {
                    "mean_abs": list(pair.mean),
                    "mean_square": list(pair.square),
                    "max": list(pair.max),
                    "max_reduction": pair.reduction,
                }
                for pair in pairs
            }

        return {"models": list(self.names), "classes": written(self.classes), "runs": written(self.runs)}


def versus(
    model: Model, other: Model, parts: Sequence[Segment], other_parts: Sequence[Segment] | None = None
) -> Versus:
    """Predict each run with both models.

    Args:
        model: the model in question.
        other: the one to compare it with.
        parts: the runs.
        other_parts: the same runs as the other model reads them (it may name columns otherwise).

    Raises:
        InputError: a run lacks an input of one of them, or they have no node in common.
    """
    found = Versus(compare(model, parts), compare(other, parts if other_parts is None else other_parts))
    if not found.nodes:
        expected = f"at least one of {', '.join(model.nodes)}"
        raise InputError(other.network.origin, "nodes", "none that both models have", expected)
    return found


def _errors(comparison: Comparison, nodes: Sequence[str], runs: Sequence[int]) -> FloatArray:
    rows = [comparison.model.nodes.index(node) for node in nodes]
    chosen: list[Prediction] = [comparison.predictions[number] for number in runs]
    return np.concatenate([prediction.error[rows].ravel() for prediction in chosen])


# --- Predicted temperatures written as a log that can be read again -------------------------------


def check_ending(path: Path) -> None:
    """Refuse a kind of table that can't be written.

    Raises:
        InputError: the file name ends in neither `.csv` nor `.parquet`.
    """
    if path.suffix not in (".csv", ".parquet"):
        raise InputError(path, "--output", f"a file name ending in '{path.suffix}'", "one ending in .csv or .parquet")


def write_predictions(comparison: Comparison, path: Path) -> None:
    """Write time [s], each node's predicted reading [degC] and the inputs, runs one after the other.

    Raises:
        InputError: the file name ends in neither `.csv` nor `.parquet`, or can't be written.
    """
    check_ending(path)
    tables = []
    for prediction in comparison.predictions:
        columns = {"time": prediction.bound.run.time}
        for node, readings in zip(comparison.model.nodes, prediction.readings, strict=True):
            columns[f"temperature.{node}"] = readings
        for column, values in zip(comparison.model.inputs, prediction.bound.inputs, strict=True):
            columns.setdefault(column, values)
        tables.append(pd.DataFrame(columns))
    table = pd.concat(tables, ignore_index=True)
    if path.suffix == ".csv":
        write_whole(path, table.to_csv(index=False, float_format="%.6g"))
    else:
        buffer = io.BytesIO()
        table.astype(np.float64).to_parquet(buffer, index=False)
        write_whole(path, buffer.getvalue())
