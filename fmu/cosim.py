"""An FMU driven by logs, and compared with the model behind it and with what was measured."""

from __future__ import annotations

import logging
import time
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

import numpy as np

from lptn.basics.arrays import FloatArray
from lptn.basics.errors import InputError
from lptn.identify.comparison import Errors, predict
from lptn.identify.data import LoadedModel, split_data
from lptn.logs.columns import column_unit, parse_map_option
from lptn.logs.reading import read_log
from lptn.logs.resampling import raw_keys
from lptn.logs.run import Run
from lptn.model.file import parse_model, read_model_file
from lptn.model.model import Model
from lptn.simulate.readings import readings_of

from .component import Component
from .connected import Connected
from .session import Session
from .ssp import in_units_of, read_values
from .variables import ZERO_CELSIUS, from_column, is_temperature

Driven = Session | Connected
_log = logging.getLogger("lptn.fmu")


@dataclass(frozen=True)
class CosimulatedRun:
    """One run through an FMU.

    Args:
        run: the log.
        nodes: the FMU's nodes that the log measures, or that the model has.
        readings: what the FMU predicts for them [degC], shape (nodes, n).
        measured: what the log holds [degC], shape (nodes, n), NaN where nothing counts.
        predicted: what the model predicts [degC], shape (nodes, n); `None` without a model.
        table: all outputs by log column at the n ends of steps, temperatures in degC, with these ends as `time`.
        seconds: time that the steps took.
        kept: inputs that the log has no column for; they kept their start values.
    """

    run: Run
    nodes: tuple[str, ...]
    readings: FloatArray
    measured: FloatArray
    predicted: FloatArray | None
    table: Mapping[str, FloatArray]
    seconds: float
    kept: tuple[str, ...] = ()

    @property
    def error(self) -> FloatArray:
        """The FMU's predicted minus measured [K], shape (nodes, n), NaN where nothing counts."""
        return self.readings - self.measured

    def errors(self, row: int) -> Errors:
        """The FMU's error at a node: predicted minus measured."""
        return Errors.of(self.error[row])

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
    runs: tuple[CosimulatedRun, ...]

    @property
    def all(self) -> Errors:
        """The FMU's error, predicted minus measured, over all runs and nodes."""
        return Errors.of(np.concatenate([run.error.ravel() for run in self.runs]))

    @property
    def from_model(self) -> float | None:
        """The largest difference between FMU and model [K]; `None` without a model."""
        differences = [run.from_model(row) for run in self.runs for row in range(len(run.nodes))]
        largest = [difference for difference in differences if difference is not None]
        return max(largest) if largest and len(largest) == len(differences) else None

    def as_json(self) -> dict[str, object]:
        """The comparison as other programs read it: kelvin, seconds."""
        runs: dict[str, object] = {}
        for done in self.runs:
            # Logs of one name from two folders must not hide one another.
            name = done.run.name if done.run.name not in runs else f"{done.run.name} ({done.run.source})"
            nodes = {}
            for row, node in enumerate(done.nodes):
                errors, from_model = done.errors(row), done.from_model(row)
                nodes[node] = {"rmse": errors.rmse, "max": errors.max, "mean": errors.mean, "from_model": from_model}
            runs[name] = {"nodes": nodes, "steps": len(done.run), "seconds": done.seconds, "kept": list(done.kept)}
        over_all = {"rmse": self.all.rmse, "max": self.all.max, "from_model": self.from_model}
        return {"fmu": str(self.fmu), "fmi": self.fmi, "runs": runs, "all": over_all}


def cosimulate(
    fmu: str | Path,
    logs: Sequence[str | Path],
    *,
    model: str | Path | None = None,
    mapped: Mapping[str, str] | None = None,
    ramps: bool = False,
    trust: bool = False,
    parameters: str | Path | None = None,
) -> Cosimulation:
    """Drive an FMU, or a system of FMUs, with the inputs of logs.

    Args:
        fmu: the FMU, or an `.ssd` or `.ssp` file that connects several.
        logs: CSV or Parquet files.
        model: a model file to compare with; by default the one inside the FMU, if any.
            The starts of the runs are fitted with it too.
        mapped: other people's columns, as `--map` takes them; and for what has no model inside the columns of its
            variables, by their names.
        ramps: `True` to let the inputs go in straight lines from sample to sample; by default they hold.
        trust: `True` to run the native code of an FMU that was not exported on this machine.
        parameters: an SSV file whose values an FMU takes over.

    Raises:
        InputError: an FMU or log that can't be used, or native code that is not trusted.
        FmuError: the FMU refuses an input.
    """
    system, given, renamed = Path(fmu).suffix in (".ssd", ".ssp"), {}, dict(mapped or {})
    for option, value in (("--model", model), ("--parameters", parameters), ("--ramps", ramps or None)):
        if system and value is not None:
            raise InputError(Path(fmu), option, "a system of FMUs", "one FMU; a system's file says its own parameters")
    with Connected(fmu, trust=trust) if system else Session(fmu, ramps=ramps, trust=trust) as driven:
        text, version = None, "SSP 1.0"
        if isinstance(driven, Session):
            text, version = driven.unpacked.model_text, str(driven.unpacked.description.fmiVersion)
            if parameters is not None:
                given = in_units_of(read_values(parameters), driven.unpacked, parameters)
        if (model is None and text is None) or driven.variables.keys() & renamed.keys():
            plans = _plans_by_names(driven, logs, renamed)
        else:
            inside = driven.path / "resources" / "model.toml"
            file = parse_model(text or "", inside) if model is None else read_model_file(Path(model))
            loaded = LoadedModel(file, Model(file.network), renamed)
            plans = _plans_by_model(loaded.model, loaded.runs([Path(log) for log in logs]))
        done = tuple(_cosimulated(driven, plan, ramps, given) for plan in plans)
        return Cosimulation(Path(fmu), version, done)


@dataclass(frozen=True)
class _Plan:
    """A run with what the FMU gets and what it is compared with.

    Args:
        run: the log.
        nodes: the nodes to compare.
        inputs: by the FMU's names, in the log's units, shape (n,) each.
        measured: readings that count [degC], shape (nodes, n), NaN elsewhere.
        predicted: what the model predicts [degC], shape (nodes, n); `None` without a model.
        start: temperatures [degC] and indicators of runs to start from, by variable.
        columns: the log's columns of variables that are called otherwise.
    """

    run: Run
    nodes: tuple[str, ...]
    inputs: Mapping[str, FloatArray]
    measured: FloatArray
    predicted: FloatArray | None
    start: Mapping[str, float]
    columns: Mapping[str, str] = field(default_factory=dict)

    def column(self, driven: Driven, name: str) -> str:
        """The log column of a variable."""
        return self.columns.get(name) or driven.column(name)

    def scale(self, driven: Driven, name: str) -> tuple[float, float]:
        """Factor and offset that turn a variable's values into its column's, in SI with temperatures in degC."""
        unit = driven.unit(name)
        if unit is None or unit.exponents is None:
            return 1.0, 0.0
        kelvin = "K" in unit.exponents and is_temperature(self.column(driven, name))
        return unit.factor, unit.offset - ZERO_CELSIUS * kelvin


def _plans_by_model(model: Model, runs: Sequence[Run]) -> list[_Plan]:
    """Runs as a model sees them: it says which columns count, and the starts are fitted with it."""
    exported, names = Component(model), [from_column(column) for column in model.inputs]
    states, parameters = ([variable.name for variable in exported.of(kind)] for kind in ("state", "parameter"))
    plans = []
    for segment in split_data((), runs).holdout:
        prediction = predict(model, segment)
        path, values = prediction.path, model.in_run(segment.run.name, model.values)
        start = dict(zip(states, path.states[:, 0].tolist(), strict=True))
        start |= {parameters[index]: float(values[index]) for index in model.network.runs.values()}
        bound = prediction.bound
        measured = np.where(bound.counted, bound.measured, np.nan)
        inputs = dict(zip(names, bound.inputs, strict=True))
        predicted = path.readings
        if model.in_time:  # from the same instants as the FMU's
            predicted = _of_rows(readings_of(model, path.states, values), segment.run.averaged)
        plans.append(_Plan(segment.run, tuple(model.nodes), inputs, measured, predicted, start))
    return plans


def _plans_by_names(driven: Driven, logs: Sequence[str | Path], mapped: Mapping[str, str]) -> list[_Plan]:
    """Runs for what has no model: its names say which columns it needs, and each run starts as first measured."""
    columns = {name: mapped.get(name) or driven.column(name) for name in (*driven.input_names, *driven.output_names)}
    others = {key: text for key, text in mapped.items() if key not in columns}
    for name in others.keys() & driven.variables.keys():
        variable = driven.variables[name]
        if variable.causality in ("input", "output"):
            found = f"an {variable.causality} of {variable.type}"
            raise InputError(driven.path, f"--map {name}", found, "one of reals, no forecast")
    sources = dict(parse_map_option(f"{key}={text}") for key, text in others.items())
    temperatures = {name: columns[name] for name in driven.output_names if columns[name].startswith("temperature.")}
    # An input that nobody maps, and whose name is no quantity of logs, may keep its start value.
    spare = [
        columns[name]
        for name in driven.input_names
        if name not in mapped and not column_unit(columns[name]) and driven.variables[name].start is not None
    ]
    inputs = [columns[name] for name in driven.input_names if columns[name] not in spare]
    plans = []
    outputs = list(dict.fromkeys(temperatures.values()))
    read = partial(read_log, columns=sources, inputs=inputs, outputs=outputs, optional=spare)
    for run in (run for log in logs for run in read(log)):
        # Two components may show one place; each is compared with what was measured there.
        seen = {name: column.partition(".")[2] for name, column in temperatures.items() if run.has(column)}
        measured = np.array([run.temperature(place) for place in seen.values()]).reshape(len(seen), len(run))
        first = {name: row[np.isfinite(row)][:1] for name, row in zip(seen, measured, strict=True)}
        start = {
            name: float(value[0])
            for name, value in first.items()
            if value.size and driven.variables[name].start is not None  # a state, which is what can be set
        }
        counted = np.where(np.isfinite(measured), measured, np.nan)
        given = {name: run.columns[columns[name]] for name in driven.input_names if run.has(columns[name])}
        plans.append(_Plan(run, tuple(seen), given, counted, None, start, columns))
    return plans


def _cosimulated(session: Driven, plan: _Plan, ramps: bool, given: Mapping[str, float]) -> CosimulatedRun:
    run, inputs = plan.run, _inputs(session, plan)
    start = {}
    for name in plan.start.keys() & session.variables.keys():
        factor, offset = plan.scale(session, name)
        start[name] = (plan.start[name] - offset) / factor
    entrances = dict(zip(session.input_names, inputs[0].tolist(), strict=True))
    session.reset({**given, **start, **entrances}, start=float(run.time[0]))
    rows = np.empty((len(run) + 1, len(session.output_names)))
    rows[0] = session.outputs
    quiet = 0.5  # s between what is said of the progress
    begun = said = time.perf_counter()
    for k in range(len(run)):
        now = time.perf_counter()
        if now - said > quiet:
            said = now
            _log.info("%s: %d of %d steps", run.name, k, len(run))
        session.inputs[:] = inputs[k]
        rows[k + 1] = session.step(run.step, inputs[min(k + 1, len(run) - 1)] if ramps else None)
    seconds = time.perf_counter() - begun
    # In the units of logs; by log column, or by their own name where two have the same column.
    columns = {name: plan.column(session, name) for name in session.output_names}
    many = Counter(columns.values())
    scales = [plan.scale(session, name) for name in columns]
    units = zip(columns, rows.T, scales, strict=True)
    outputs = {name: factor * values + offset for name, values, (factor, offset) in units}
    ends = {column if many[column] == 1 else name: outputs[name][1:] for name, column in columns.items()}
    sensed = [_reading(session, node, outputs) for node in plan.nodes]
    readings = _of_rows(np.array(sensed).reshape(len(sensed), len(run) + 1), run.averaged)
    nodes = tuple(node.removesuffix(".temperature") for node in plan.nodes)
    table = {"time": run.time + run.step} | ends
    kept = tuple(name for name in session.input_names if name not in plan.inputs and plan.predicted is None)
    return CosimulatedRun(run, nodes, readings, plan.measured, plan.predicted, table, seconds, kept)


def _of_rows(ends: FloatArray, averaged: bool) -> FloatArray:
    """What n rows hold of the values at their n + 1 ends: the mean of both, or that at the start."""
    return (ends[:, :-1] + ends[:, 1:]) / 2 if averaged else ends[:, :-1]


def _inputs(session: Driven, plan: _Plan) -> FloatArray:
    """The inputs of each step as the FMU takes them, shape (n, number of inputs)."""
    means = {key for name in plan.inputs for key in raw_keys(session.column(name))}
    rows = []
    for name in session.input_names:
        if name in plan.inputs:
            factor, offset = plan.scale(session, name)
            rows.append((plan.inputs[name] - offset) / factor)
        elif session.column(name) in means:  # the model wants its mean alone, which the log gives
            rows.append(np.zeros(len(plan.run)))
        elif plan.predicted is None:
            rows.append(np.full(len(plan.run), session.inputs[len(rows)]))
        else:
            expected = "an FMU of the same inputs as the model that it is compared with"
            raise InputError(session.path, "inputs", f"{name}, which the model lacks", expected)
    return np.ascontiguousarray(np.array(rows).reshape(len(rows), len(plan.run)).T)


def _reading(session: Driven, node: str, outputs: Mapping[str, FloatArray]) -> FloatArray:
    """What the sensor of a node, or an output, reads [degC]; its temperature where the FMU has no sensor there."""
    temperature = node if node in outputs else from_column(f"temperature.{node}")
    sensor = temperature.removesuffix("temperature") + "reading"
    name = sensor if sensor in outputs else temperature
    if name not in outputs:
        raise InputError(session.path, "outputs", f"no {temperature}", "the temperature of each node of the model")
    return outputs[name]
