"""The command `lptn monitor`: faults of temperature sensors in logs."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter as Option
from cyclopts import validators

from lptn import report as drawn
from lptn.basics.errors import InputError
from lptn.cli import options
from lptn.cli.terminal import is_quiet, progress, show_table, write_json

if TYPE_CHECKING:
    from lptn.logs.run import Run
    from lptn.online.monitoring import MonitoredRun


def monitor(
    model: Path,
    /,
    *logs: Path,
    threshold: Annotated[float, Option(validator=validators.Number(gt=0))] = 10.0,
    healthy: Annotated[list[Path] | None, Option(consume_multiple=True)] = None,
    false_alarms: Annotated[float, Option(validator=validators.Number(gt=0))] = 0.01,
    calibration: Path | None = None,
    details: options.Details = False,
    json: options.Json = None,
    plot: options.Picture = None,
    columns: options.Columns = options.COLUMNS,
) -> None:
    """Find faulty temperature sensors and dead inputs.

    A sensor is called stuck, dead, clamped, noisy, spiky or silent (dropout), off (offset), drifting, lagging,
    disconnected (it reads the air) or swapped with another. A torque, current, speed or ambient temperature that the
    readings contradict is called a faulty input. Undecided: either a sensor or an input would explain the readings.

    Example: lptn monitor fitted.toml today.parquet --threshold 10 --healthy monday.parquet tuesday.parquet

    Args:
        threshold: Threshold of the plain detector, in K.
        healthy: Logs of the same kind without faults, preferably those that the model was fitted to.
        false_alarms: Rate of false alarms of the statistical detector, per hour.
        calibration: Calibration file: written with --healthy, read without it.
    """
    options.needs_logs(logs)
    read, written = (None, calibration) if healthy else (calibration, None)
    inputs = (model, *logs, *(healthy or ()), *(() if read is None else (read,)))
    options.check_outputs(json, written, pictures=[plot], inputs=inputs)
    options.check_inputs(model, *logs, *(healthy or ()))
    from lptn.identify.data import load_model
    from lptn.online.calibration import calibrate, read_calibration, write_calibration
    from lptn.online.monitoring import monitor as watch
    from lptn.report.narrative import monitoring_narrative

    loaded = load_model(model, columns.texts)
    runs, healthy_runs = loaded.runs(logs), loaded.runs(healthy or [])
    _refuse_shared(runs, healthy_runs)
    with progress("reading") as report:
        learnt = None if read is None else read_calibration(read, loaded.model)
        if healthy_runs:
            learnt = calibrate(loaded.model, healthy_runs, false_alarms=false_alarms, report=report)
        if learnt is not None and written is not None:
            write_calibration(learnt, written)
        result = watch(
            loaded.model, runs, threshold=threshold, calibration=learnt, rmse=loaded.file.fit.rmse, report=report
        )
    print(monitoring_narrative(result))
    rows = [cells for watched in result.runs for cells in _rows(watched)]
    if rows and not is_quiet():
        heads = "run", "sensor", "fault", "size", "since", "statistical", f"over {threshold:g} K"
        show_table(heads, rows, most=None if details else options.ROWS)
        print("Times are in s on each log's clock, or since its start where that clock counts from 1970.")
    write_json(json, result.as_json())
    options.write_figure(plot, lambda: drawn.monitoring_figure(result))


def _refuse_shared(runs: list[Run], healthy: list[Run]) -> None:
    """Refuse logs that are also used for calibration: they would be found healthy."""
    sources = {run.fingerprint: run.source for run in healthy}
    for run in runs:
        if run.fingerprint in sources:
            problem = f"the same data as {sources[run.fingerprint]} (--healthy)"
            raise InputError(run.source, "LOGS", problem, "each log once: to learn from, or to watch")


_UNITS = {"offset": "K", "drift": "K/s", "lag": "s"}


def _rows(watched: MonitoredRun) -> Iterator[list[str]]:
    """A line for each sensor with an alarm: what both detectors say of it, and when."""
    direct = {alarm.channel or alarm.node: alarm for alarm in watched.threshold_alarms}
    statistical = {alarm.channel or alarm.node: alarm for alarm in watched.statistical_alarms}
    for node in [*statistical, *(node for node in direct if node not in statistical)]:
        best = statistical.get(node) or direct[node]
        size = best.detail if best.size is None else f"{best.size:+.2g} {_UNITS[best.kind]}"
        alarms = statistical.get(node), direct.get(node)
        times = [f"{alarm.time - watched.run.origin:.0f} s" if alarm else "–" for alarm in alarms]
        yield [watched.run.name, node, best.kind, size, f"{best.onset - watched.run.origin:.0f} s", *times]
