"""Time until a temperature limit, with its uncertainty, from a model and the log so far."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import inf, isfinite
from typing import Literal

import numpy as np
from scipy.linalg import block_diag
from scipy.special import ndtr, ndtri

from lptn.basics.arrays import FloatArray
from lptn.basics.errors import InputError
from lptn.basics.places import matching
from lptn.identify.fitting import Fit
from lptn.identify.noise import estimate_noise
from lptn.logs.run import Run
from lptn.model.model import Model
from lptn.online.operating_point import Gait, OperatingPoint, find_gait, operating_point, steady_seconds
from lptn.online.present import Dynamics, Knowledge, Present, advance, present
from lptn.simulate.bound_run import BoundRun, bind

# --- What a forecast says: time to the limit of each node, and the temperatures to come -----------


@dataclass(frozen=True)
class Window:
    """The end of the log that is taken to go on.

    Args:
        seconds: its length.
        cycles: gait cycles in it, `None` where no gait was found.
        period: of the gait [s], `None` likewise.
        steady: how long the operating point has been unchanged [s].
        why: what it is, in words.
    """

    seconds: float
    cycles: int | None
    period: float | None
    steady: float
    why: str


@dataclass(frozen=True)
class NodeForecast:
    """When a node reaches its limit; infinite for never.

    Args:
        node: its name.
        limit: degC.
        now: expected reading at the end of the log [degC].
        time_to_limit: s from the end of the log, 0 where the limit is passed already.
        low: end of the interval on the early side [s].
        high: on the late side [s].
        chance: probability that the limit is passed at all while the operating point stays.
        steady: where the temperature settles [degC], infinite where it runs away.
        steady_low: end of its interval on the cold side [degC].
        steady_high: on the hot side [degC].
    """

    node: str
    limit: float
    now: float
    time_to_limit: float
    low: float
    high: float
    chance: float
    steady: float
    steady_low: float
    steady_high: float

    @property
    def reaches(self) -> bool:
        """Whether the limit is expected to be reached."""
        return isfinite(self.time_to_limit)


@dataclass(frozen=True)
class Forecast:
    """Temperatures to come with the operating point held.

    Args:
        nodes: one for each node with a limit, by name.
        names: of all nodes of the model.
        time: s from the end of the log, shape (n,).
        temperature: expected readings [degC], shape (names, n).
        low: lower end of their interval [degC], shape (names, n).
        high: upper end [degC], shape (names, n).
        coverage: of all intervals.
        window: the end of the log that is taken to go on.
        trust: where the uncertainty of the model is from, in words.
        log: time [s] until the end of the log, 0 there, shape (k,).
        measured: its readings [degC], shape (names, k), NaN where missing.
    """

    nodes: dict[str, NodeForecast]
    names: tuple[str, ...]
    time: FloatArray
    temperature: FloatArray
    low: FloatArray
    high: FloatArray
    coverage: float
    window: Window
    trust: str
    log: FloatArray
    measured: FloatArray

    def as_json(self) -> dict[str, object]:
        """The forecast as other tools read it: s and degC; what is never reached is null."""
        return {
            "coverage": self.coverage,
            "trust": self.trust,
            "window": {
                "seconds": self.window.seconds,
                "cycles": self.window.cycles,
                "gait_period": self.window.period,
                "steady": self.window.steady,
                "why": self.window.why,
            },
            "nodes": {name: _json(each) for name, each in self.nodes.items()},
            "path": {
                "time": self.time.tolist(),
                "temperature": dict(zip(self.names, self.temperature.tolist(), strict=True)),
                "low": dict(zip(self.names, self.low.tolist(), strict=True)),
                "high": dict(zip(self.names, self.high.tolist(), strict=True)),
            },
        }


def _json(one: NodeForecast) -> dict[str, object]:
    numbers = {
        "limit": one.limit,
        "now": one.now,
        "time_to_limit": one.time_to_limit,
        "low": one.low,
        "high": one.high,
        "chance": one.chance,
        "steady": one.steady,
        "steady_low": one.steady_low,
        "steady_high": one.steady_high,
    }
    return {"reaches": one.reaches, **{name: value if isfinite(value) else None for name, value in numbers.items()}}


# --- The present operating point held: temperatures to come, and how sure they are ----------------


_FIRST_STEP, _LAST_STEP, _GROWTH = 5.0, 300.0, 1.05  # s
_TIME_CONSTANTS = 5.0  # of the slowest heat flow, after which little moves
_LONGEST = 12 * 3600.0  # s
_HOTTEST = 500.0  # degC; beyond it nothing more is computed


@dataclass(frozen=True)
class Future:
    """Expected readings.

    Args:
        time: s from now, shape (n,), the first 0.
        mean: degC, shape (nodes, n).
        spread: standard deviation [K], shape (nodes, n).
        settled: whether the path goes on until little moves; else the temperatures run away.
    """

    time: FloatArray
    mean: FloatArray
    spread: FloatArray
    settled: bool


def future(model: Model, present: Present, point: OperatingPoint) -> Future:
    """Carry the present forwards with the operating point held.

    The operating point is known as the mean over a window, so its error is one more unknown; besides, the inputs go
    on to vary as they did in that window.
    """
    dynamics = Dynamics(model)
    n, nodes, size, mean = len(model.states), len(model.nodes), present.mean.size, present.mean
    covariance = block_diag(present.covariance, point.error)
    p = dynamics.values(mean[n + nodes :])  # the unknowns behind missing heat stay as they are
    time, step = [0.0], _FIRST_STEP
    paths = [_shown(dynamics, mean[:n], p, covariance[:size, :size])]
    slowest = float(np.abs(np.linalg.eigvals(dynamics.rates(mean[:n], point.inputs, p)).real).min())
    horizon = min(_TIME_CONSTANTS / max(slowest, 1e-9), _LONGEST)
    while time[-1] < horizon:
        motion = dynamics.step(mean[:n], mean[n : n + nodes], point.inputs, p, step)
        mean, covariance = advance(mean, covariance, motion, present.heat, step)
        covariance[:n, :n] += motion.by_input @ (point.scatter / step) @ motion.by_input.T
        if not np.isfinite(mean).all() or mean[:n].max() > _HOTTEST:
            break
        time.append(time[-1] + step)
        paths.append(_shown(dynamics, mean[:n], p, covariance[:size, :size]))
        step = min(step * _GROWTH, _LAST_STEP)
    shown, spread = (np.array([path[part] for path in paths]).T for part in (0, 1))
    return Future(np.array(time), shown, spread, time[-1] >= horizon)


def _shown(dynamics: Dynamics, x: FloatArray, p: FloatArray, covariance: FloatArray) -> tuple[FloatArray, FloatArray]:
    shown, slope = dynamics.readings(x, p)
    return shown, np.sqrt(np.maximum(np.sum((slope @ covariance) * slope, axis=1), 0.0))


def crossing(time: FloatArray, path: FloatArray, limit: float) -> float:
    """When a path first reaches a limit [s], straight between its points; infinite where it never does."""
    above = np.flatnonzero(path >= limit)
    if above.size == 0:
        return float("inf")
    k = int(above[0])
    if k == 0:
        return 0.0
    share = (limit - path[k - 1]) / (path[k] - path[k - 1])
    return float(time[k - 1] + share * (time[k] - time[k - 1]))


# --- Time until a limit, from a model and the log so far ------------------------------------------


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
    bound = bind(model, run)
    if len(bound) * run.step < _SHORTEST:
        raise InputError(run.source, "log", f"{len(bound) * run.step:g} s", f"at least {_SHORTEST:g} s")
    wanted = _by_node(limits, bound, model)
    noise = estimate_noise([bound], model.nodes)
    knowledge = Knowledge.of_fit(fit) if isinstance(fit, Fit) else fit
    knowledge = knowledge or Knowledge.nothing(model)
    chosen = _window(bound, model, cycles, window, _gait(run) if gait is None else gait)
    point = operating_point(bound, model.inputs, chosen.seconds, max(chosen.seconds, chosen.steady))
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
        measured=bound.measured,
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


def _window(bound: BoundRun, model: Model, cycles: int, window: WindowChoice, gait: Gait) -> Window:
    length, period = len(bound) * bound.run.step, gait.period
    steady = steady_seconds(bound, model.inputs)
    unseen = "" if period else f" ({gait.why_not})"
    if not isinstance(window, str):
        seconds = min(float(window), length)
        return Window(seconds, None, period, steady, f"the last {seconds:.4g} s, as asked for{unseen}")
    if window == "cycles" and period is not None:
        count = min(cycles, int(length / period))
        return Window(count * period, count, period, steady, f"the last {count} gait cycles")
    whole = f"the whole log, {steady:.4g} s" if steady >= length - bound.run.step else f"the last {steady:.4g} s"
    why = f"{whole}, over which the operating point is unchanged{unseen}"
    if period is None or steady < period:
        return Window(steady, None, period, steady, why)
    count = int(steady / period)
    return Window(count * period, count, period, steady, why)


def _gait(run: Run) -> Gait:
    return find_gait([values for name, values in run.columns.items() if name.startswith("velocity.")], run.step)


def _by_node(limits: float | Mapping[str, float], bound: BoundRun, model: Model) -> dict[str, float]:
    """The limit of each node that has one; what is said later wins."""
    measured = [node for node, row in zip(model.nodes, bound.measured, strict=True) if np.isfinite(row).any()]
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
