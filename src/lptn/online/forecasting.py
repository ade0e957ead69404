"""Time until a temperature limit, with its uncertainty, from a model and the log so far.

The log is filtered up to its end by the online estimator; from there the present operating point is held. The interval
holds what the fit left uncertain, heat that the model lacks, and the scatter of the operating point.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from math import inf, isfinite

import numpy as np
from scipy.special import ndtr, ndtri

from lptn.basics.arrays import FloatArray
from lptn.basics.errors import InputError
from lptn.basics.places import matching
from lptn.basics.processes import one_blas_thread
from lptn.identify.fitting import Fit
from lptn.logs.run import Run
from lptn.model.model import Model
from lptn.online.augmented_model import AugmentedModel
from lptn.online.estimator import Estimator
from lptn.online.operating_point import GaitPeriod, OperatingPoint, WindowChoice, find_gait, present_operating_point
from lptn.online.present import Doubt, ModelUncertainty, present_by_live_sensors
from lptn.simulate.bound_run import BoundRun, bind

# --- What a forecast says -------------------------------------------------------------------------


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


@dataclass(frozen=True, repr=False)
class Forecast:
    """Future temperatures at a constant operating point.

    Args:
        nodes: one for each place with a limit, by name.
        names: of all places of the model: nodes, then hottest points, which no sensor measures.
        time: s from the end of the log, shape (n,).
        temperature: expected readings [degC], shape (names, n).
        low: lower end of their interval [degC], shape (names, n).
        high: upper end [degC], shape (names, n).
        coverage: of all intervals.
        window: the end of the log that is taken to go on.
        trust: where the uncertainty of the model is from, in words.
        log: time [s] until the end of the log, 0 there, shape (k,).
        measured: its readings [degC], shape (names, k), NaN where missing.
        doubts: sensors on which the forecast does not lean at the end of the log, and why.
        late: s, by which the log goes on behind that end: it is cut where an input is not known any more.
    """

    nodes: dict[str, NodeForecast]
    names: tuple[str, ...]
    time: FloatArray
    temperature: FloatArray
    low: FloatArray
    high: FloatArray
    coverage: float
    window: OperatingPoint
    trust: str
    log: FloatArray
    measured: FloatArray
    doubts: tuple[Doubt, ...] = ()
    late: float = 0.0

    def __repr__(self) -> str:
        nodes = "; ".join(
            f"{node.node} at {node.now:.1f} degC, "
            + (f"{node.time_to_limit:.0f} s" if node.reaches else "never")
            + f" to {node.limit:g} degC"
            for node in self.nodes.values()
        )
        return f"<Forecast: {nodes}>"

    @property
    def soonest(self) -> list[NodeForecast]:
        """The nodes with a limit, the next to reach it first, then the hottest."""
        return sorted(self.nodes.values(), key=lambda one: (one.time_to_limit, one.low, -one.steady))

    def as_json(self) -> dict[str, object]:
        """The forecast as other tools read it: s and degC; what is never reached is null."""
        return {
            "coverage": self.coverage,
            "trust": self.trust,
            "seconds_before_log_end": self.late,
            "window": {
                "seconds": self.window.seconds,
                "cycles": self.window.cycles,
                "gait_period": self.window.period,
                "steady": self.window.steady,
                "why": self.window.why,
            },
            "nodes": {
                name: {"reaches": node.reaches}
                | {key: value if isfinite(value) else None for key, value in asdict(node).items() if key != "node"}
                for name, node in self.nodes.items()
            },
            "not_believed": {doubt.node: {"since": doubt.since, "why": doubt.why} for doubt in self.doubts},
            "path": {"time": self.time.tolist()}
            | {
                key: dict(zip(self.names, getattr(self, key).tolist(), strict=True))
                for key in ("temperature", "low", "high")
            },
        }


# --- Future temperatures at a constant operating point -----------------------------------------------

_FIRST_STEP, _LAST_STEP, _GROWTH = 5.0, 300.0, 1.05  # s; fine at first, where a limit may be near
_TIME_CONSTANTS = 5.0  # of the slowest heat flow, after which less than 1 % of the way is left
_LONGEST = 12 * 3600.0  # s
_RUNAWAY = 500.0  # degC; beyond it nothing more is computed
_SHORTEST = 60.0  # s of log; from less nothing can be said


@one_blas_thread
def forecast(
    model: Model,
    run: Run,
    limits: float | Mapping[str, float],
    cycles: int = 10,
    coverage: float = 0.9,
    fit: Fit | ModelUncertainty | None = None,
    *,
    window: WindowChoice = "steady",
    gait: GaitPeriod | None = None,
) -> Forecast:
    """When each node reaches its limit if the robot goes on as it does at the end of a log.

    The present is estimated from the log; the inputs are averaged over a window, squares where heat goes with the
    square, and held. Gait cycles are a hundred times shorter than any thermal time constant, so holding their
    average is repeating them. The interval holds: errors of the parameters, heat that the model lacks (autocorrelated),
    a cooling that differs from run to run, the present temperatures (noise and steps of the sensors), and
    the scatter of what was averaged. Sensors that are not alive are left out (see `Forecast.doubts`); from where they
    cease to be, the model goes on alone, and the interval is as wide as the filter's covariance then says.

    Args:
        model: the fitted model.
        run: the log so far.
        limits: degC; one for all joints that the log measures, or by node or pattern (`"*_calf"`).
        cycles: gait cycles to average, where `window` is `"cycles"`.
        coverage: of the intervals, between 0 and 1.
        fit: what is known of the model's errors; without it each parameter is taken for 30 % off, and 1 K besides.
        window: `"steady"`, as long as the operating point has been unchanged; `"cycles"`, the last few gait cycles, as
            [QuadrupedLPTN, application 3] does; or seconds.
        gait: of the log, where the run is too coarse to show it.

    Returns:
        Times, temperatures and their intervals.

    Raises:
        InputError: the log is too short, lacks an input, measures no node or has no sensor that is alive; a limit for
            a node that the model lacks.
        ValueError: a coverage, number of cycles or window out of range.

    Source: [QuadrupedLPTN, application 3].

    Example:
        >>> import lptn
        >>> loaded = lptn.load_model("examples/tclab/two_heaters.toml")
        >>> (run,) = loaded.runs(["examples/tclab/log.csv"])
        >>> fitted = lptn.fit(loaded.model, [run])
        >>> ahead = lptn.forecast(fitted.model, run, 70.0, fit=fitted)
        >>> {name: node.reaches for name, node in ahead.nodes.items()}
        {'heater1': False, 'heater2': False}
    """
    if cycles < 1:
        raise ValueError(f"cycles: found {cycles}; expected 1 or more")
    if not 0 < coverage < 1:
        raise ValueError(f"coverage: found {coverage:g}; expected a share between 0 and 1")
    if not (window in ("steady", "cycles") if isinstance(window, str) else window > 0):
        raise ValueError(f"window: found {window!r}; expected steady, cycles or a time above 0 s")
    bound = bind(model, run)
    if len(bound) * run.step < _SHORTEST:
        raise InputError(run.source, "log", f"{len(bound) * run.step:g} s", f"at least {_SHORTEST:g} s")
    limited = _limits_by_node(limits, bound, model)
    uncertainty = ModelUncertainty.of_fit(fit) if isinstance(fit, Fit) else fit
    uncertainty = uncertainty or ModelUncertainty.nothing(model)
    if gait is None:
        speeds = [values for name, values in run.columns.items() if name.startswith("velocity.")]
        gait = find_gait(speeds, run.step)
    point = present_operating_point(bound, model.inputs, window, cycles, gait)
    estimator, doubts = present_by_live_sensors(model, run, uncertainty)
    time, mean, deviation, settles = _held(estimator, point)
    half = float(ndtri(0.5 + coverage / 2)) * deviation
    low, high = mean - half, mean + half
    nodes = {}
    for node, limit in limited.items():
        row = model.places.index(node)
        steady, coldest, hottest = (float(path[row, -1]) if settles else inf for path in (mean, low, high))
        nodes[node] = NodeForecast(
            node=node,
            limit=limit,
            now=float(mean[row, 0]),
            time_to_limit=_crossing(time, mean[row], limit),
            low=_crossing(time, high[row], limit),
            high=_crossing(time, low[row], limit),
            chance=float(ndtr((mean[row] - limit) / np.maximum(deviation[row], 1e-9)).max()),
            steady=steady,
            steady_low=coldest,
            steady_high=hottest,
        )
    return Forecast(
        nodes=nodes,
        names=tuple(model.places),
        time=time,
        temperature=mean,
        low=low,
        high=high,
        coverage=coverage,
        window=point,
        trust=uncertainty.source,
        log=run.time - run.time[-1] - run.step,
        measured=np.pad(bound.measured, ((0, len(model.places) - len(model.nodes)), (0, 0)), constant_values=np.nan),
        doubts=tuple(doubts),
        late=max(run.log_end - float(run.time[-1]) - run.step, 0.0) if isfinite(run.log_end) else 0.0,
    )


def _held(estimator: Estimator, point: OperatingPoint) -> tuple[FloatArray, FloatArray, FloatArray, bool]:
    """Simulate from the present state at a constant operating point.

    The operating point is known as the mean over a window, so its error is one more state; besides, the inputs go
    on to vary as they did in that window.

    Returns:
        s from now, shape (n,), the first 0; expected readings [degC] and their standard deviations [K], shape
        (places, n), of a hottest point its temperature; whether the temperatures settle, or else run away.
    """
    model = estimator.model
    error = replace(estimator.error, inputs=dict.fromkeys(model.inputs, 0.0))
    augmented = AugmentedModel(model, error, estimator.doubtful, np.zeros(len(estimator.doubtful)))
    states, inputs = augmented.layout.states, augmented.layout.inputs
    inside = np.arange(augmented.layout.size)[states][len(model.nodes) : len(model.places)]  # hottest points
    others = np.delete(np.arange(augmented.layout.size), inputs)
    z, covariance = np.zeros(augmented.layout.size), np.zeros((augmented.layout.size,) * 2)
    z[others], covariance[np.ix_(others, others)] = estimator.state()["mean"], estimator.state()["covariance"]
    covariance[inputs, inputs] = point.error
    slowest = float(np.abs(np.linalg.eigvals(augmented.rates(z, point.inputs)[1][states, states]).real).min())
    horizon = min(_TIME_CONSTANTS / max(slowest, 1e-9), _LONGEST)
    step, time, mean, deviation = _FIRST_STEP, [0.0], [], []
    while True:
        readings, by_state = augmented.readings(z)
        readings, by_state = np.append(readings, z[inside]), np.vstack([by_state, np.eye(z.size)[inside]])
        mean.append(readings)
        deviation.append(np.sqrt(np.maximum(np.sum((by_state @ covariance) * by_state, axis=1), 0.0)))
        if time[-1] >= horizon:
            break
        moved = augmented.long_step(z, point.inputs, step)
        z = moved.states
        if not np.isfinite(z).all() or z[states].max() > _RUNAWAY:
            break
        covariance = moved.covariance(covariance)
        by_input = moved.transition[states, inputs]
        covariance[states, states] += by_input @ (point.scatter / step) @ by_input.T
        time.append(time[-1] + step)
        step = min(step * _GROWTH, _LAST_STEP)
    return np.array(time), np.array(mean).T, np.array(deviation).T, time[-1] >= horizon


def _crossing(time: FloatArray, path: FloatArray, limit: float) -> float:
    """When a path first reaches a limit [s], straight between its points; infinite where it never does."""
    above = np.flatnonzero(path >= limit)
    if above.size == 0:
        return inf
    k = int(above[0])
    if k == 0:
        return 0.0
    share = (limit - path[k - 1]) / (path[k] - path[k - 1])
    return float(time[k - 1] + share * (time[k] - time[k - 1]))


def check_limits(limits: Mapping[str, float], model: Model) -> None:
    """Refuse limits that are no temperatures, or of what is no place of a model; "" stands for all joints.

    Raises:
        InputError: one of them is.
    """
    for pattern, limit in limits.items():
        if pattern and not matching(pattern, model.places):
            expected = f"one of {', '.join(model.places)}, or a pattern of them"
            raise InputError("limits", "node", f"'{pattern}'", expected)
        if not isfinite(limit):
            raise InputError("limits", pattern or "all joints", f"{limit}", "a temperature in degC")


def _limits_by_node(limits: float | Mapping[str, float], bound: BoundRun, model: Model) -> dict[str, float]:
    """The limit of each node that has one; the last one said wins."""
    measured = [node for node, row in zip(model.nodes, bound.measured, strict=True) if np.isfinite(row).any()]
    actuated = {
        column.partition(".")[2] for column in model.inputs if column.startswith(("torque.", "current.", "velocity"))
    }
    joints = [node for node in measured if node in actuated] or measured
    if not isinstance(limits, Mapping):
        limits = {"": limits}
    check_limits(limits, model)
    limited: dict[str, float] = {}
    for pattern, limit in limits.items():
        limited |= dict.fromkeys(matching(pattern, model.places) if pattern else joints, float(limit))
    return {place: limited[place] for place in model.places if place in limited}
