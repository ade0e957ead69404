"""Errors (predicted − measured) by run, node and condition; two models on the same logs; predictions as a log."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from pathlib import Path

import numpy as np
import pandas as pd

from lptn.basics.arrays import FloatArray
from lptn.basics.errors import InputError
from lptn.basics.places import class_of
from lptn.basics.processes import one_blas_thread
from lptn.basics.tables import Tabular, write_table
from lptn.identify.data import Segment, holdout_segment
from lptn.identify.noise import Noise, balanced_sigma, estimate_noise
from lptn.identify.problem import Problem
from lptn.identify.solvers import minimise
from lptn.logs.run import Run
from lptn.model.model import Model
from lptn.simulate.bound_run import BoundRun, bind
from lptn.simulate.simulation import Trajectory, simulate

_BINS = 5  # of an operating condition, with equally many readings each


@dataclass(frozen=True, repr=False)
class Prediction:
    """What a model says of one run, beside what was measured there.

    A run that was fitted begins as the fit has it; any other as its initialisation window says (`predict`).

    Args:
        segment: the run and its windows.
        bound: its inputs and readings, those of the evaluation window counting.
        path: the simulated run.
    """

    segment: Segment
    bound: BoundRun
    path: Trajectory

    def __repr__(self) -> str:
        errors = Errors.of(self.error)
        return f"<Prediction of {self.segment.run.name}: RMSE {errors.rmse:.3g} K, largest error {errors.max:.3g} K>"

    @property
    def readings(self) -> FloatArray:
        """Predicted readings [degC], shape (nodes, n)."""
        return self.path.readings

    @property
    def states(self) -> FloatArray:
        """Simulated states as the log holds them, means or samples, shape (states, n)."""
        return self.path.held

    @property
    def error(self) -> FloatArray:
        """Predicted − measured [K], shape (nodes, n), NaN where nothing counts."""
        return np.where(self.bound.counted, self.readings - self.bound.measured, np.nan)


@dataclass(frozen=True)
class Errors:
    """Errors (predicted − measured) of a set of readings [K]: root mean square, largest size, mean, and their count."""

    rmse: float
    max: float
    mean: float
    count: int

    @classmethod
    def of(cls, error: FloatArray) -> Errors:
        """Errors of the finite entries of an array of predicted − measured [K]."""
        finite = error[np.isfinite(error)]
        if finite.size == 0:
            return cls(float("nan"), float("nan"), float("nan"), 0)
        root = float(np.sqrt(np.mean(finite**2)))
        return cls(root, float(np.abs(finite).max()), float(finite.mean()), int(finite.size))


def errors_of(predictions: Sequence[Prediction]) -> Errors:
    """Errors over all readings that count of some runs."""
    return Errors.of(np.concatenate([np.zeros(0), *(prediction.error.ravel() for prediction in predictions)]))


@dataclass(frozen=True)
class Condition:
    """Errors in one bin of an operating condition at one node."""

    node: str
    quantity: str
    lower: float
    upper: float
    errors: Errors


@dataclass(frozen=True, repr=False)
class Comparison(Tabular):
    """A model against measurements.

    Args:
        model: the model.
        predictions: one for each run.
        noise: the sensors' noise, the least that any model can reach.
        fitted: whether the model's parameters were fitted, and are not only those that somebody wrote.
    """

    model: Model
    predictions: tuple[Prediction, ...]
    noise: Noise
    fitted: bool = True

    @cached_property
    def all(self) -> Errors:
        """Errors over all readings that count."""
        return errors_of(self.predictions)

    def node(self, name: str, prediction: Prediction | None = None) -> Errors:
        """Errors at one node, over all runs or in one."""
        row = self.model.nodes.index(name)
        chosen = self.predictions if prediction is None else (prediction,)
        return Errors.of(np.concatenate([result.error[row] for result in chosen]))

    def floor(self, name: str) -> float:
        """The RMSE that noise and steps of the sensor alone would give at a node [K]."""
        return float(self.noise.floor[self.model.nodes.index(name)])

    def conditions(self) -> list[Condition]:
        """Errors binned over each node's torque, speed, temperature and the time since the start."""
        conditions = []
        for row, node in enumerate(self.model.nodes):
            error = np.concatenate([prediction.error[row] for prediction in self.predictions])
            for quantity, values in self._quantities(row).items():
                conditions += _binned(node, quantity, values, error)
        return conditions

    @property
    def summary(self) -> str:
        """Errors over all readings in one line."""
        runs = f"{len(self.predictions)} run{'s' * (len(self.predictions) != 1)}"
        return f"{runs}, RMSE {self.all.rmse:.3g} K, largest error {self.all.max:.3g} K, mean {self.all.mean:+.3g} K"

    def to_pandas(self) -> pd.DataFrame:
        """A row for each run and node: errors, predicted minus measured, and what noise alone would leave [K]."""
        rows = [
            {
                "run": prediction.segment.run.name,
                "node": node,
                "RMSE [K]": errors.rmse,
                "max |error| [K]": errors.max,
                "mean error [K]": errors.mean,
                "noise alone [K]": self.floor(node),
            }
            for prediction in self.predictions
            for node in self.model.nodes
            if (errors := self.node(node, prediction)).count
        ]
        return pd.DataFrame(rows)

    def as_json(self) -> dict[str, object]:
        """The comparison as other tools read it, in kelvin."""
        runs: dict[str, object] = {}
        for prediction in self.predictions:
            name = prediction.segment.run.name
            # Logs of one name from two folders must not hide each other.
            name = name if name not in runs else f"{name} ({prediction.segment.run.source})"
            errors = {node: self.node(node, prediction) for node in self.model.nodes}
            runs[name] = {
                "nodes": {
                    node: {"rmse": summary.rmse, "max": summary.max, "mean": summary.mean, "floor": self.floor(node)}
                    for node, summary in errors.items()
                    if summary.count
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
        runs = [prediction.segment.run for prediction in self.predictions]
        quantities = {
            title: np.concatenate([run.columns[column] for run in runs])
            for title, column in columns.items()
            if all(run.has(column) for run in runs)
        }
        quantities["temperature [°C]"] = np.concatenate([p.bound.measured[row] for p in self.predictions])
        quantities["time since start [s]"] = np.concatenate([run.time - run.time[0] for run in runs])
        return quantities


def predict(model: Model, segment: Segment, sigma: FloatArray | None = None) -> Prediction:
    """Predict a run from the initial states that its initialisation window gives.

    Nothing else is fitted to it.

    Args:
        model: at the values that it is to predict with.
        segment: the run, and which windows of it find the start and are evaluated.
        sigma: standard deviation that weighs each node [K] where the start is found, shape (nodes,); by default that of
            the run alone, so that its error does not depend on what else is fitted or compared.
    """
    bound = bind(model, segment.run)
    if sigma is None:
        sigma = balanced_sigma([bound], estimate_noise([bound], model.nodes))
    window = segment.initialisation
    start = fit_start(model, bound.count(window).until(window[1]), sigma)
    return Prediction(segment, bound.count(segment.evaluation), simulate(model, bound, model.values, start))


@one_blas_thread
def fit_start(model: Model, bound: BoundRun, sigma: FloatArray) -> FloatArray:
    """Initial states of a run from its counted readings [degC], shape (states,), the parameters being held.

    Raises:
        KeyboardInterrupt: Ctrl-C was pressed.
    """
    problem = Problem(model, [bound], sigma, free=())
    solution = minimise(problem, problem.guess(model.values))  # nearly linear, a few steps
    if solution.status == "interrupted":
        raise KeyboardInterrupt
    return problem.point(solution.z).starts[0]


def compare(model: Model, runs: Sequence[Run | Segment]) -> Comparison:
    """Predict each run and set the prediction against what was measured.

    Args:
        model: at the values that it is to predict with.
        runs: the runs, each with a first tenth that finds its start; or segments, which say what finds it.

    Raises:
        InputError: a run lacks an input, or measures none of the model's nodes.

    Example:
        >>> import lptn
        >>> loaded = lptn.load_model("examples/tclab/two_heaters.toml")
        >>> comparison = lptn.compare(loaded.model, loaded.runs(["examples/tclab/log.csv"]))
        >>> comparison
        <Comparison: 1 run, RMSE 12.1 K, largest error 20.8 K, mean -10.5 K>
        >>> comparison.to_pandas()["node"].tolist()
        ['heater1', 'heater2']
    """
    segments = [run if isinstance(run, Segment) else holdout_segment(run) for run in runs]
    bound_runs = [bind(model, segment.run) for segment in segments]
    noise = estimate_noise(bound_runs, model.nodes)
    return Comparison(model, tuple(predict(model, segment) for segment in segments), noise)


def _binned(node: str, quantity: str, values: FloatArray, error: FloatArray) -> list[Condition]:
    """Bins with equally many readings, so that none is judged on a handful."""
    usable = np.isfinite(values) & np.isfinite(error)
    if usable.sum() < _BINS * 2 or np.ptp(values[usable]) == 0:
        return []
    edges = np.unique(np.quantile(values[usable], np.linspace(0, 1, _BINS + 1)))
    conditions = []
    for lower, upper in pairwise(edges):
        last = upper == edges[-1]
        inside = usable & (values >= lower) & ((values <= upper) if last else (values < upper))
        if inside.any():
            conditions.append(Condition(node, quantity, float(lower), float(upper), Errors.of(error[inside])))
    return conditions


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
        """From predicted − measured [K], NaN where nothing counts."""
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
        everywhere = range(len(self.model.predictions))
        return [self._pair(name, members, everywhere) for name, members in (groups | {"all": self.nodes}).items()]

    @cached_property
    def runs(self) -> list[Pair]:
        """Errors of all nodes in each run."""
        runs = [prediction.segment.run.name for prediction in self.model.predictions]
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
    model: Model, other: Model, segments: Sequence[Segment], other_segments: Sequence[Segment] | None = None
) -> Versus:
    """Predict each run with both models.

    Args:
        model: the model in question.
        other: the one to compare it with.
        segments: the runs.
        other_segments: the same runs as the other model reads them (it may name columns otherwise).

    Raises:
        InputError: a run lacks an input of one of them, or they have no node in common.
    """
    both = Versus(compare(model, segments), compare(other, segments if other_segments is None else other_segments))
    if not both.nodes:
        expected = f"at least one of {', '.join(model.nodes)}"
        raise InputError(other.network.origin, "nodes", "none that both models have", expected)
    return both


def _errors(comparison: Comparison, nodes: Sequence[str], runs: Sequence[int]) -> FloatArray:
    rows = [comparison.model.nodes.index(node) for node in nodes]
    chosen: list[Prediction] = [comparison.predictions[number] for number in runs]
    return np.concatenate([prediction.error[rows].ravel() for prediction in chosen])


# --- Predicted temperatures written as a log that can be read again -------------------------------


def write_predictions(comparison: Comparison, path: Path) -> None:
    """Write time [s], each node's predicted reading, each hottest point's temperature [degC] and the inputs.

    Runs follow one after the other.

    Raises:
        InputError: the file name ends in neither `.csv` nor `.parquet`, or can't be written.
    """
    tables = []
    for prediction in comparison.predictions:
        columns = {"time": prediction.bound.run.time}
        for node, readings in zip(comparison.model.nodes, prediction.readings, strict=True):
            columns[f"temperature.{node}"] = readings
        nodes, places = len(comparison.model.nodes), comparison.model.places
        inside = prediction.states[nodes : len(places)]
        columns |= {f"temperature.{place}": row for place, row in zip(places[nodes:], inside, strict=True)}
        for column, values in zip(comparison.model.inputs, prediction.bound.inputs, strict=True):
            columns.setdefault(column, values)
        tables.append(pd.DataFrame(columns))
    write_table(path, pd.concat(tables, ignore_index=True).astype(np.float64), digits=6)
