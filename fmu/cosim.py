"""An FMU driven by logs, and compared with the model behind it and with what was measured."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lptn.arrays import FloatArray
from lptn.compare import Errors, predict
from lptn.errors import InputError
from lptn.evidence import Part, evidence
from lptn.logs import Run, read_log
from lptn.model import Model
from lptn.model_file import ModelFile, load_model, parse_model
from lptn.noise import balanced_sigma, estimate_noise
from lptn.opening import Opened
from lptn.simulate import Drive, drive, over_steps

from .component import component
from .naming import of_column, to_column
from .session import Session
from .units import ZERO_CELSIUS


@dataclass(frozen=True)
class DrivenRun:
    """One run through an FMU.

    Args:
        run: the log.
        nodes: the FMU's nodes that the log measures, or that the model has.
        readings: what the FMU gives for them [degC], shape (nodes, n).
        measured: what the log holds [degC], shape (nodes, n), NaN where nothing counts.
        predicted: what the model gives [degC], shape (nodes, n); `None` without a model.
        outputs: all outputs by name at the n ends of steps, in the FMU's units.
        seconds: time that the steps took.
    """

    run: Run
    nodes: tuple[str, ...]
    readings: FloatArray
    measured: FloatArray
    predicted: FloatArray | None
    outputs: Mapping[str, FloatArray]
    seconds: float

    def errors(self, row: int) -> Errors:
        """FMU minus measurement at a node."""
        return Errors.of(self.readings[row] - self.measured[row])

    def from_model(self, row: int) -> float | None:
        """The largest difference between FMU and model at a node [K]."""
        return None if self.predicted is None else float(np.abs(self.readings[row] - self.predicted[row]).max())


@dataclass(frozen=True)
class Cosimulation:
    """What an FMU gave for logs.

    Args:
        fmu: its file.
        fmi: the version of FMI that it was driven by.
        runs: one for each log, or each piece of one.
    """

    fmu: Path
    fmi: str
    runs: tuple[DrivenRun, ...]

    @property
    def all(self) -> Errors:
        """FMU minus measurement over all runs and nodes."""
        return Errors.of(np.concatenate([(each.readings - each.measured).ravel() for each in self.runs]))

    @property
    def from_model(self) -> float | None:
        """The largest difference between FMU and model [K]; `None` without a model."""
        found = [each.from_model(row) for each in self.runs for row in range(len(each.nodes))]
        return None if None in found or not found else max(value for value in found if value is not None)

    def as_json(self) -> dict[str, object]:
        """The comparison as other programs read it: kelvin, seconds."""
        runs: dict[str, object] = {}
        for each in self.runs:
            name = each.run.name if each.run.name not in runs else f"{each.run.name} ({each.run.source})"
            runs[name] = {
                "nodes": {node: _as_json(each, row) for row, node in enumerate(each.nodes)},
                "steps": len(each.run),
                "seconds": each.seconds,
            }
        whole = {"rmse": self.all.rmse, "max": self.all.max, "from_model": self.from_model}
        return {"fmu": str(self.fmu), "fmi": self.fmi, "runs": runs, "all": whole}


def cosimulate(
    fmu: str | Path,
    logs: Sequence[str | Path],
    *,
    model: str | Path | None = None,
    mapped: Mapping[str, str] | None = None,
    ramps: bool = False,
    trust: bool = False,
) -> Cosimulation:
    """Drive an FMU with the inputs of logs.

    Args:
        fmu: the FMU.
        logs: CSV or Parquet files.
        model: a model file to compare with; by default the one inside the FMU, if any.
            It also tells where each run starts.
        mapped: other people's columns, as `--map` takes them.
        ramps: `True` to let the inputs go in straight lines from sample to sample; by default they hold.
        trust: `True` to run the native code of an FMU that was not exported on this machine.

    Raises:
        InputError: an FMU or log that can't be used, or native code that is not trusted.
        FmuError: the FMU refuses an input.
    """
    with Session(fmu, ramps=ramps, trust=trust) as session:
        file = _model_file(session, model)
        opened = None if file is None else Opened(file, Model(file.network), dict(mapped or {}))
        runs = _plain_runs(session, logs) if opened is None else opened.runs([Path(log) for log in logs])
        parts = evidence((), runs).holdout
        plans = [_plan(session, part) if opened is None else _predicted(opened.model, part, parts) for part in parts]
        done = tuple(_drive(session, plan, ramps) for plan in plans)
        return Cosimulation(Path(fmu), str(session.unpacked.description.fmiVersion), done)


@dataclass(frozen=True)
class _Plan:
    """A run with what the FMU gets and what it is compared with."""

    driven: Drive
    nodes: tuple[str, ...]
    inputs: tuple[str, ...]  # the FMU's names of the rows of `driven.inputs`
    start: Mapping[str, float]  # degC, by variable; indicators of runs among them
    predicted: FloatArray | None


def _model_file(session: Session, given: str | Path | None) -> ModelFile | None:
    if given is not None:
        return load_model(Path(given))
    text = session.unpacked.model_text
    return None if text is None else parse_model(text, session.path / "resources" / "model.toml")


def _predicted(model: Model, part: Part, parts: Sequence[Part]) -> _Plan:
    drives = [drive(model, each.run) for each in parts]
    sigma = balanced_sigma(drives, estimate_noise(drives, model.nodes))
    found = predict(model, part, sigma)
    names = [variable.name for variable in component(model).of("state")]
    start = dict(zip(names, found.states[:, 0].tolist(), strict=True)) | _of_run(model, part.run)
    inputs = tuple(of_column(column) for column in model.inputs)
    return _Plan(found.drive, tuple(model.nodes), inputs, start, found.readings)


def _of_run(model: Model, run: Run) -> dict[str, float]:
    """The indicators of effects that are confined to single runs, by variable."""
    names, values = (
        [variable.name for variable in component(model).of("parameter")],
        model.in_run(run.name, model.values),
    )
    return {names[index]: float(values[index]) for index in model.network.runs.values()}


def _plain_runs(session: Session, logs: Sequence[str | Path]) -> list[Run]:
    """Runs for an FMU without a model: its names say which columns it needs."""
    inputs = [to_column(name) for name in session.input_names]
    outputs = [to_column(f"{node}.temperature") for node in _nodes(session)]
    return [run for log in logs for run in read_log(log, inputs=inputs, outputs=outputs)]


def _plan(session: Session, part: Part) -> _Plan:
    nodes = tuple(node for node in _nodes(session) if part.run.has(f"temperature.{node}"))
    if not nodes:
        raise InputError(
            part.run.source, "temperature columns", "no reading of any output of the FMU", "temperature.<node>"
        )
    measured = np.stack([part.run.temperature(node) for node in nodes])
    names = tuple(session.input_names)
    inputs = np.array([part.run.columns[to_column(name)] for name in names]).reshape(len(names), len(part.run))
    first = np.array([row[np.isfinite(row)][0] if np.isfinite(row).any() else np.nan for row in measured])
    start = {
        f"{node}.temperature": value for node, value in zip(nodes, first.tolist(), strict=True) if np.isfinite(value)
    }
    return _Plan(Drive(part.run, inputs, measured, np.isfinite(measured), first), nodes, names, start, None)


def _nodes(session: Session) -> list[str]:
    names = [name.removesuffix(".temperature") for name in session.output_names if name.endswith(".temperature")]
    return [name for name in names if "." not in name]


def _drive(session: Session, plan: _Plan, ramps: bool) -> DrivenRun:
    run, inputs = plan.driven.run, _inputs(session, plan)
    start = {name: value + _offset(session, name) for name, value in plan.start.items() if name in session.variables}
    session.reset(start | dict(zip(session.input_names, inputs[0].tolist(), strict=True)), start=float(run.time[0]))
    found = np.empty((len(run) + 1, len(session.output_names)))
    found[0] = session.outputs
    begun = time.perf_counter()
    for k in range(len(run)):
        session.inputs[:] = inputs[k]
        found[k + 1] = session.step(run.step, inputs[min(k + 1, len(run) - 1)] if ramps else None)
    seconds = time.perf_counter() - begun
    outputs = dict(zip(session.output_names, found.T, strict=True))
    ends = np.stack([_reading(session, node, outputs) for node in plan.nodes])
    measured = np.where(plan.driven.counted, plan.driven.measured, np.nan)
    later = {name: values[1:] for name, values in outputs.items()}
    return DrivenRun(run, plan.nodes, over_steps(ends, run.averaged), measured, plan.predicted, later, seconds)


def _inputs(session: Session, plan: _Plan) -> FloatArray:
    """The inputs of each step as the FMU takes them, shape (n, number of inputs)."""
    names = session.input_names
    lacking = [name for name in names if name not in plan.inputs]
    if lacking:
        expected = "an FMU of the same inputs as the model that it is compared with"
        raise InputError(session.path, "inputs", f"{lacking[0]}, which the model lacks", expected)
    order = np.array([plan.inputs.index(name) for name in names], dtype=int)
    shift = np.array([_offset(session, name) for name in names])
    return np.ascontiguousarray((plan.driven.inputs[order] + shift[:, None]).T)


def _reading(session: Session, node: str, outputs: Mapping[str, FloatArray]) -> FloatArray:
    """What the sensor of a node reads [degC], or its temperature where the FMU has no sensor there."""
    temperature = of_column(f"temperature.{node}")
    sensed = temperature.removesuffix("temperature") + "reading"
    name = sensed if sensed in outputs else temperature
    if name not in outputs:
        raise InputError(session.path, "outputs", f"no {temperature}", "the temperature of each node of the model")
    return outputs[name] - _offset(session, name)


def _offset(session: Session, name: str) -> float:
    """What turns degC into a variable's unit by adding."""
    return ZERO_CELSIUS if session.variables[name].unit == "K" and _is_absolute(name) else 0.0


def _is_absolute(name: str) -> bool:
    return to_column(name).partition(".")[0] in ("temperature", "reading")


def _as_json(each: DrivenRun, row: int) -> dict[str, object]:
    errors = each.errors(row)
    return {"rmse": errors.rmse, "max": errors.max, "mean": errors.mean, "from_model": each.from_model(row)}
