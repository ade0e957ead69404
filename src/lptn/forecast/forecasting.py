"""Time until a limit, from a model and the log so far."""

from __future__ import annotations

from collections.abc import Mapping
from math import inf, isfinite
from typing import Literal

import numpy as np
from scipy.special import ndtr, ndtri

from lptn.errors import InputError
from lptn.forecast.future import Future, crossing, future
from lptn.forecast.gait import Gait, find_gait
from lptn.forecast.knowledge import Knowledge
from lptn.forecast.operating_point import operating_point, steady_seconds
from lptn.forecast.present import present
from lptn.forecast.result import Forecast, NodeForecast, Window
from lptn.identify import Fit
from lptn.logs import Run
from lptn.model import Model
from lptn.noise import estimate_noise
from lptn.places import matching
from lptn.simulate import Drive, drive

_SHORTEST = 60.0  # s of log; from less nothing can be said

WindowChoice = Literal["steady", "cycles"] | float


def forecast(
    model: Model,
    run: Run,
    limits: float | Mapping[str, float],
    cycles: int = 10,
    coverage: float = 0.9,
    fit: Fit | Knowledge | None = None,
    *,
    window: WindowChoice = "steady",
    gait: Gait | None = None,
) -> Forecast:
    """When each node reaches its limit if the robot goes on as it does at the end of a log.

    The present is estimated from the log; the inputs are averaged over a window, squares where heat goes with the
    square, and held. Gait cycles are a hundred times shorter than any thermal time constant, so holding their
    average is repeating them. The interval holds: errors of the parameters, heat that the model lacks (autocorrelated),
    a cooling that differs from run to run, the present temperatures (noise and steps of the sensors), and
    the scatter of what was averaged.

    Args:
        model: the fitted model.
        run: the log so far.
        limits: degC; one for all joints that the log measures, or by node or pattern (`"*_calf"`).
        cycles: gait cycles to average, where `window` is `"cycles"`.
        coverage: of the intervals, between 0 and 1.
        fit: what is known of the model's errors; without it a model error of 1 K is assumed and parameters are taken
            for exact.
        window: `"steady"`, as long as the operating point has been unchanged; `"cycles"`, the last few gait cycles, as
            [QuadrupedLPTN, application 3] does; or seconds.
        gait: of the log, where the run is too coarse to show it.

    Returns:
        Times, temperatures and their intervals.

    Raises:
        InputError: the log is too short, lacks an input or measures no node; a limit for a node that the model lacks.
        ValueError: a coverage, number of cycles or window out of range.

    Source: [QuadrupedLPTN, application 3].
    """
    _check(cycles, coverage, window)
    driven = drive(model, run)
    if len(driven) * run.step < _SHORTEST:
        raise InputError(run.source, "log", f"{len(driven) * run.step:g} s", f"at least {_SHORTEST:g} s")
    wanted = _by_node(limits, driven, model)
    noise = estimate_noise([driven], model.nodes)
    knowledge = Knowledge.of_fit(fit) if isinstance(fit, Fit) else fit
    knowledge = knowledge or Knowledge.nothing(model)
    chosen = _window(driven, model, cycles, window, _gait(run) if gait is None else gait)
    point = operating_point(driven, model.inputs, chosen.seconds, max(chosen.seconds, chosen.steady))
    path = future(model, present(model, run, noise, knowledge), point)
    factor = float(ndtri(0.5 + coverage / 2))
    return Forecast(
        nodes={node: _node(node, limit, path, model.nodes.index(node), factor) for node, limit in wanted.items()},
        names=tuple(model.nodes),
        time=path.time,
        temperature=path.mean,
        low=path.mean - factor * path.spread,
        high=path.mean + factor * path.spread,
        coverage=coverage,
        window=chosen,
        trust=knowledge.source,
        log=run.time - run.time[-1] - run.step,
        measured=driven.measured,
    )


def _node(node: str, limit: float, path: Future, row: int, factor: float) -> NodeForecast:
    mean, spread = path.mean[row], path.spread[row]
    low, high = mean - factor * spread, mean + factor * spread
    ends = (mean[-1], low[-1], high[-1]) if path.settled else (inf, inf, inf)
    return NodeForecast(
        node=node,
        limit=limit,
        now=float(mean[0]),
        time_to_limit=crossing(path.time, mean, limit),
        low=crossing(path.time, high, limit),
        high=crossing(path.time, low, limit),
        chance=float(ndtr((mean - limit) / np.maximum(spread, 1e-9)).max()),
        steady=float(ends[0]),
        steady_low=float(ends[1]),
        steady_high=float(ends[2]),
    )


def _window(driven: Drive, model: Model, cycles: int, window: WindowChoice, gait: Gait) -> Window:
    length, period = len(driven) * driven.run.step, gait.period
    steady = steady_seconds(driven, model.inputs)
    unseen = "" if period else f" ({gait.why_not})"
    if not isinstance(window, str):
        seconds = min(float(window), length)
        return Window(seconds, None, period, steady, f"the last {seconds:.4g} s, as asked for{unseen}")
    if window == "cycles" and period is not None:
        count = min(cycles, int(length / period))
        return Window(count * period, count, period, steady, f"the last {count} gait cycles")
    whole = f"the whole log, {steady:.4g} s" if steady >= length - driven.run.step else f"the last {steady:.4g} s"
    why = f"{whole}, over which the operating point is unchanged{unseen}"
    if period is None or steady < period:
        return Window(steady, None, period, steady, why)
    count = int(steady / period)
    return Window(count * period, count, period, steady, why)


def _gait(run: Run) -> Gait:
    return find_gait([values for name, values in run.columns.items() if name.startswith("velocity.")], run.step)


def _by_node(limits: float | Mapping[str, float], driven: Drive, model: Model) -> dict[str, float]:
    """The limit of each node that has one; what is said later wins."""
    measured = [node for node, row in zip(model.nodes, driven.measured, strict=True) if np.isfinite(row).any()]
    moved = {
        column.partition(".")[2] for column in model.inputs if column.startswith(("torque.", "current.", "velocity"))
    }
    joints = [node for node in measured if node in moved] or measured
    if not isinstance(limits, Mapping):
        limits = {"": limits}
    found: dict[str, float] = {}
    for pattern, limit in limits.items():
        nodes = matching(pattern, model.nodes) if pattern else joints
        if not nodes:
            raise InputError("limits", "node", f"'{pattern}'", f"one of {', '.join(model.nodes)}, or a pattern of them")
        if not isfinite(limit):
            raise InputError("limits", pattern or "all joints", f"{limit}", "a temperature in degC")
        found |= dict.fromkeys(nodes, float(limit))
    return {node: found[node] for node in model.nodes if node in found}


def _check(cycles: int, coverage: float, window: WindowChoice) -> None:
    if cycles < 1:
        raise ValueError(f"cycles: found {cycles}; expected 1 or more")
    if not 0 < coverage < 1:
        raise ValueError(f"coverage: found {coverage:g}; expected a share between 0 and 1")
    if isinstance(window, str) and window not in ("steady", "cycles"):
        raise ValueError(f"window: found '{window}'; expected steady, cycles or a number of seconds")
    if not isinstance(window, str) and not window > 0:
        raise ValueError(f"window: found {window:g} s; expected a time above 0 s")
