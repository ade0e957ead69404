"""The command `lptn forecast`: time until a limit, as a table, a figure and JSON."""

from __future__ import annotations

from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, cast

from cyclopts import Parameter as Option
from cyclopts import validators

from lptn import report
from lptn.basics.errors import InputError
from lptn.cli import options
from lptn.cli.terminal import is_quiet, progress, show_table, write_json

if TYPE_CHECKING:
    from lptn.online.operating_point import WindowChoice


def forecast(
    model: Path,
    log: Path,
    /,
    *,
    limit: list[str],
    window: str = "steady",
    cycles: Annotated[int, Option(validator=validators.Number(gte=1))] = 10,
    coverage: options.Coverage = 0.9,
    details: options.Details = False,
    json: options.Json = None,
    plot: options.Picture = None,
    columns: options.Columns = options.COLUMNS,
) -> None:
    """Forecast when each joint reaches its limit.

    The robot is assumed to continue as at the end of the log.

    Example: lptn forecast fitted.toml now.parquet --limit 60

    Args:
        limit: Limit in degC for all joints, or NODE=degC, also for a pattern of nodes; may be repeated.
        window: The load assumed to continue: steady (since the last change), cycles, or a number of seconds.
        cycles: Number of gait cycles with --window cycles.
    """
    options.check_outputs(json, pictures=[plot], inputs=(model, log))
    limits, chosen = options.limits_of(limit, ""), _window(window)
    options.check_inputs(model, log)
    from lptn.report.tables import forecast_table
    from lptn.study import Study

    with progress("forecasting"):
        study = Study(model, holdout=[log], columns=columns.texts)
        ahead = study.forecast(limits, cycles, coverage, window=chosen)
    print(ahead.narrative())
    if not is_quiet():
        most = None if details else options.ROWS
        show_table(*forecast_table(ahead.result, most), most=most)
    write_json(json, ahead.result.as_json())
    options.write_figure(plot, lambda: report.forecast_figure(ahead.result))


def _window(word: str) -> WindowChoice:
    if word in ("steady", "cycles"):
        return cast("WindowChoice", word)
    try:
        seconds = float(word)
    except ValueError:
        seconds = float("nan")
    if not (isfinite(seconds) and seconds > 0):
        raise InputError("command line", "--window", f"'{word}'", "steady, cycles or a number of seconds above 0")
    return seconds
