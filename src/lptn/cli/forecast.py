"""The command `lptn forecast`: time until a limit, as a table, a figure and JSON."""

from __future__ import annotations

from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter as Option
from cyclopts import validators

from lptn.basics.errors import InputError
from lptn.cli.options import (
    Json,
    Map,
    Picture,
    Rate,
    check_inputs,
    check_outputs,
    check_picture,
    column_options,
    write_figure,
)

if TYPE_CHECKING:
    from lptn.identify.data import LoadedModel
    from lptn.logs.run import Run
    from lptn.online.forecasting import Forecast, NodeForecast
    from lptn.online.operating_point import Gait, WindowChoice
    from lptn.online.present import ModelUncertainty


_FINEST = 1e-3  # s; no robot logs its joints faster


def forecast(
    model: Path,
    log: Path,
    /,
    *,
    limit: Annotated[
        list[str], Option(help="degC for all joints, or NODE=degC, also by pattern; may be given again.", negative="")
    ],
    window: Annotated[
        str,
        Option(help="The load assumed to continue: steady (since the last change), cycles, or a number of seconds."),
    ] = "steady",
    cycles: Annotated[int, Option(help="Gait cycles of --window cycles.", validator=validators.Number(gte=1))] = 10,
    coverage: Annotated[float, Option(help="Of the intervals.", validator=validators.Number(gt=0, lt=1))] = 0.9,
    json: Json = None,
    plot: Picture = None,
    map: Map = None,  # noqa: A002 - the option's name
    rate: Rate = None,
) -> None:
    """Say when each joint reaches a temperature limit if the robot goes on as it does at the log's end.

    Example: lptn forecast fitted.toml now.parquet --limit 60
    """
    check_outputs(json, plot, inputs=(model, log))
    check_picture(plot)
    limits, chosen = _limits(limit), _window(window)
    check_inputs(model, log)
    from lptn.cli.terminal import progress, write_json
    from lptn.identify.data import load_model
    from lptn.online.forecasting import forecast as forecast_of

    loaded = load_model(model, column_options(map, rate))
    with progress("forecasting"):
        run = loaded.runs([log])[-1]
        trust = _knowledge(loaded, run)
        ahead = forecast_of(loaded.model, run, limits, cycles, coverage, trust, window=chosen, gait=_gait(loaded, log))
    _show(ahead)
    write_json(json, ahead.as_json())
    if plot is not None:
        from lptn.report.online_figures import forecast_figure

        write_figure(forecast_figure(ahead), plot)


_LATE = 60.0  # s before a log's end, that are worth a word


def _limits(words: list[str]) -> dict[str, float]:
    """Limits by node or pattern; the empty pattern stands for all joints."""
    limits = {}
    for word in words:
        node, separator, number = word.rpartition("=")
        try:
            value = float(number)
        except ValueError:
            value = float("nan")
        if not isfinite(value) or (separator and not node.strip()):
            raise InputError("command line", "--limit", f"'{word}'", "degC or NODE=degC, such as 60 or FR_calf=70")
        limits[node.strip()] = value
    # What is said of all joints must not hide what is said of one.
    return {"": limits.pop(""), **limits} if "" in limits else limits


def _window(word: str) -> WindowChoice:
    if word == "steady":
        return "steady"
    if word == "cycles":
        return "cycles"
    try:
        seconds = float(word)
    except ValueError:
        seconds = float("nan")
    if not (isfinite(seconds) and seconds > 0):
        raise InputError("command line", "--window", f"'{word}'", "steady, cycles or a number of seconds above 0")
    return seconds


def _knowledge(loaded: LoadedModel, run: Run) -> ModelUncertainty:
    """What the model file keeps of its fit."""
    from lptn.identify.noise import estimate_noise
    from lptn.online.present import ModelUncertainty
    from lptn.simulate.bound_run import bind

    noise = estimate_noise([bind(loaded.model, run)], loaded.model.nodes)
    return ModelUncertainty.of_table(loaded.model, loaded.file.fit, noise.floor)


def _gait(loaded: LoadedModel, log: Path) -> Gait:
    """The gait at the log's end, from its joint speeds with their sign and at the log's own rate."""
    from lptn.logs.reading import read_log
    from lptn.online.operating_point import find_gait
    from lptn.simulate.bound_run import needed_columns

    inputs, outputs = needed_columns(loaded.model)
    signed = [f"signed_velocity.{node}" for node in loaded.model.nodes]
    runs = read_log(
        log,
        loaded.columns,
        step=_FINEST,
        inputs=inputs if loaded.guessing else (),  # for its guesses are what the model needs
        outputs=outputs,
        optional=signed,
        guessing=loaded.guessing,
    )
    run = runs[-1]
    return find_gait([run.columns[name] for name in signed if run.has(name)], run.step)


def _show(ahead: Forecast) -> None:
    from lptn.cli.terminal import show_table

    rows = [
        (one.node, f"{one.now:.1f}", f"{one.limit:g} °C", _time(one), _interval(one), _settled(one))
        for one in ahead.nodes.values()
    ]
    heads = ("node", ">now", ">limit", ">time to it", f">{ahead.coverage:.0%} interval", ">settles at [°C]")
    show_table(heads, rows)
    window = ahead.window
    cycles = f" ({window.cycles} gait cycles of {window.period:.3g} s)" if window.cycles and window.period else ""
    print(f"Load assumed to continue: {window.why}{cycles}.")
    if ahead.late >= _LATE:
        print(f"Now is {_duration(ahead.late)} before the end of the log: the inputs after it are unknown.")
    print(f"Uncertainty of the model: {ahead.trust}.")
    for doubt in ahead.doubts:
        print(f"Sensor ignored: {doubt}. Since then the forecast uses the model and the other sensors.")


def _time(one: NodeForecast) -> str:
    if one.time_to_limit == 0:
        return "passed"
    return _duration(one.time_to_limit) if one.reaches else "never"


def _interval(one: NodeForecast) -> str:
    if one.time_to_limit == 0:
        return ""
    if not isfinite(one.low):
        return f"never ({1 - one.chance:.0%})"
    return f"{_duration(one.low)} to {_duration(one.high) if isfinite(one.high) else 'never'}"


def _settled(one: NodeForecast) -> str:
    if not isfinite(one.steady):
        return "runs away"
    return f"{one.steady:.0f} ({one.steady_low:.0f} to {one.steady_high:.0f})"


def _duration(seconds: float) -> str:
    """A time until something: 45 s, 9.2 min, 2.1 h."""
    if seconds < 99.5:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.1f} min" if seconds < 7200 else f"{seconds / 3600:.1f} h"
