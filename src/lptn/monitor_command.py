"""The command `lptn monitor`."""

from __future__ import annotations

import io
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter as Option
from cyclopts import validators

from lptn.cli_support import Json, Map, check_outputs, check_picture, needs_logs
from lptn.errors import InputError

if TYPE_CHECKING:
    from lptn.logs import Run
    from lptn.model import Model
    from lptn.model_file import ModelFile
    from lptn.monitor import Calibration

Healthy = Annotated[
    list[Path] | None,
    Option(
        name="--healthy",
        help="Logs without a fault, like those to be watched: best those that the model was fitted on.",
        negative="",
        consume_multiple=True,
    ),
]


def monitor(
    model: Path,
    /,
    *logs: Path,
    threshold: Annotated[
        float, Option(help="Residual that the plain detector calls a fault, in K.", validator=validators.Number(gt=0))
    ] = 10.0,
    healthy: Healthy = None,
    false_alarms: Annotated[
        float,
        Option(help="False alarms an hour that the statistical detector may give.", validator=validators.Number(gt=0)),
    ] = 0.01,
    calibration: Annotated[
        Path | None,
        Option(help="File for what the healthy logs teach: written with --healthy, read without."),
    ] = None,
    json: Json = None,
    plot: Annotated[Path | None, Option(help="Picture to write: .png, .svg or .pdf.")] = None,
    map: Map = None,  # noqa: A002 - the option's name
) -> None:
    """Find faults of temperature sensors: drift, offset, stuck, dropout.

    Example: lptn monitor fitted.toml today.parquet --threshold 10 --healthy monday.parquet tuesday.parquet
    """
    from lptn.monitor import monitor as watch
    from lptn.monitor.terminal import show_monitoring
    from lptn.opening import open_model
    from lptn.terminal import progress, write_json

    needs_logs(logs)
    check_outputs(json, plot, calibration if healthy else None, inputs=(model, *logs, *(healthy or ())))
    check_picture(plot)
    opened = open_model(model, map or ())
    runs, good = opened.runs(logs), opened.runs(healthy or [])
    _refuse_shared(runs, good)
    with progress("reading") as report:
        learnt = _calibration(opened.model, good, false_alarms, calibration, report)
        found = watch(
            opened.model, runs, threshold=threshold, calibration=learnt, rmse=_rmse(opened.file), report=report
        )
    show_monitoring(found)
    write_json(json, found.as_json())
    if plot is not None:
        from lptn.files import write_whole
        from lptn.monitor.figure import monitoring_figure

        picture = io.BytesIO()
        monitoring_figure(found).savefig(picture, format=plot.suffix.lower().removeprefix("."))
        write_whole(plot, picture.getvalue())


def _calibration(
    model: Model, healthy: list[Run], false_alarms: float, path: Path | None, report: Callable[[str], None]
) -> Calibration | None:
    """What healthy logs teach: learnt now and kept, or learnt before, or nothing."""
    from lptn.monitor.calibration import calibrate
    from lptn.monitor.keeping import keep, kept

    if healthy:
        learnt = calibrate(model, healthy, false_alarms=false_alarms, report=report)
        if path is not None:
            keep(learnt, model.nodes, path)
        return learnt
    return None if path is None else kept(path, model)


def _refuse_shared(runs: list[Run], healthy: list[Run]) -> None:
    """A log that taught what is healthy would be found healthy."""
    known = {run.fingerprint: run.source for run in healthy}
    for run in runs:
        if run.fingerprint in known:
            found = f"the same data as {known[run.fingerprint]} (--healthy)"
            raise InputError(run.source, "LOGS", found, "each log once: to learn from, or to watch")


def _rmse(file: ModelFile) -> float | None:
    """The error of the model's fit [K], `None` for a model that was not fitted."""
    import tomlkit

    rmse = tomlkit.parse(file.text).unwrap().get("fit", {}).get("rmse")
    return None if rmse is None else float(rmse)
