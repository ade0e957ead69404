"""Error per run, node and operating condition: where the model fails."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np

from lptn.arrays import FloatArray
from lptn.evidence import Part
from lptn.identify import fit_nuisances, fit_starts
from lptn.model import Model
from lptn.noise import Noise, balanced_sigma, estimate_noise
from lptn.simulate import Drive, drive, simulate

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

    part: Part
    drive: Drive
    readings: FloatArray
    states: FloatArray

    @property
    def error(self) -> FloatArray:
        """Predicted minus measured [K], shape (nodes, n), NaN where nothing counts."""
        return np.where(self.drive.counted, self.readings - self.drive.measured, np.nan)


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
        found["temperature [°C]"] = np.concatenate([each.drive.measured[row] for each in self.predictions])
        found["time since start [s]"] = np.concatenate([run.time - run.time[0] for run in runs])
        return found


def predict(model: Model, part: Part, sigma: FloatArray) -> Prediction:
    """Predict a run from the initial states that its opening gives.

    Where the model grants the run an error that is no part of the robot, such as the ambient sensor's, that is taken
    from all of the run: one number with a prior.

    Args:
        model: at the values that it is to predict with.
        part: the run, which stretch of it finds the start, and which counts.
        sigma: standard deviation that weighs each node [K], shape (nodes,).
    """
    driven = drive(model, part.run)
    model = fit_nuisances(model, driven.count((part.opening[0], part.counted[1])).until(part.counted[1]), sigma)
    opening = driven.count(part.opening).until(part.opening[1])
    (start,) = fit_starts(model, [opening], sigma)
    path = simulate(model, driven, model.values, start)
    return Prediction(part, driven.count(part.counted), path.readings, path.states)


def compare(model: Model, parts: Sequence[Part]) -> Comparison:
    """Predict each run and set the prediction against what was measured.

    Raises:
        InputError: a run lacks an input, or measures none of the model's nodes.
    """
    drives = [drive(model, part.run) for part in parts]
    noise = estimate_noise(drives, model.nodes)
    sigma = balanced_sigma(drives, noise)
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
