"""Time until a temperature limit, with its uncertainty, from a model and the log so far.

The log is filtered up to its end by the online estimator; from there the present operating point is held. The interval
holds what the fit left uncertain, heat that the model lacks, and the scatter of the operating point.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from math import inf, isfinite, log

import numpy as np
from scipy.special import ndtr, ndtri

from lptn.basics.arrays import BoolArray, FloatArray
from lptn.basics.errors import InputError
from lptn.basics.parameters import ParameterInstance, Transform
from lptn.basics.places import matching
from lptn.basics.processes import one_blas_thread
from lptn.identify.fitting import Fit
from lptn.identify.noise import PLAIN, estimate_noise
from lptn.logs.run import Run
from lptn.model.model import Model
from lptn.model.tables import FitTable
from lptn.online.augmented_model import AugmentedModel, ModelError
from lptn.online.believed import Doubt, not_alive, refuse_none, without
from lptn.online.calibration import uncalibrated
from lptn.online.estimator import UNKNOWN, Estimator, run_filter
from lptn.online.fault_bank import LEAST_NOISE, STEP, Suspicion, coarsely_bound, faults, heat_of_doubt
from lptn.online.operating_point import Gait, OperatingPoint, WindowChoice, find_gait, present_operating_point
from lptn.online.quantisation import coarse_noise
from lptn.simulate.bound_run import BoundRun, bind, default_start
from lptn.simulate.dynamics import zero_order_hold
from lptn.simulate.simulation import substeps

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
    """Temperatures to come with the operating point held.

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


# --- How far a model is to be trusted -------------------------------------------------------------

_UNKNOWN_ERROR = 1.0  # K; of a model of which nobody says how well it fitted
_LEAST_ERROR = 0.1  # K; no model is better on a run that it never saw
_FIT_OVERCONFIDENCE = 2.0  # times the standard errors: of another activity a fit knows less than of those that it saw
_AT_BOUND = 1e-3  # in the fit's coordinates; nearer to a bound than this a parameter is at it
_WIDEST = 0.5  # in the fit's coordinates; a derivative says nothing of what lies further away


@dataclass(frozen=True)
class ModelUncertainty:
    """How far a model is to be trusted.

    Args:
        covariance: of the free parameters in the fit's coordinates (logarithms of positive ones, else shares of
            the typical size), shape (free, free).
        error: how far a free-running simulation strays from noise-free readings, root mean square [K], shape (nodes,).
        source: where this is from, in words.
        learns: whether the log may move its parameters: not those of a fit that misses its readings plainly, and not
            those that nobody fitted. What their errors do is heat that the model lacks.
    """

    covariance: FloatArray
    error: FloatArray
    source: str
    learns: bool = True

    @classmethod
    def of_fit(cls, fit: Fit) -> ModelUncertainty:
        """Of a fit in memory: the same that its model file keeps."""
        return cls.of_table(fit.model, fit.table(), fit.noise.floor)

    @classmethod
    def of_table(cls, model: Model, table: FitTable, floor: FloatArray) -> ModelUncertainty:
        """Of the `[fit]` table of a model file: standard errors, and the RMSE less what the sensors leave.

        Correlations are left out, though a fit knows them: they say how well the fitted runs hold combinations of
        parameters together if the model is right. For the same reason standard errors are doubled: of virtual
        trots' times to a limit, all joints, 90 % intervals then held 94 %, else 86 %.

        Args:
            model: the model.
            table: as the model file holds it; without a fit, a model error of 1 K is assumed.
            floor: RMSE that noise and steps of the sensors leave [K], shape (nodes,).
        """
        if table.rmse is None:
            return cls.nothing(model)
        free = [model.parameters[index] for index in model.free]
        slope = np.abs(Transform(free).slope(np.array([parameter.value for parameter in free], dtype=float)))
        # What a fit left undetermined stands there without a standard error.
        errors = np.full(len(free), np.nan)
        for row, parameter in enumerate(free):
            fitted = table.parameters.get(parameter.name)
            if fitted is not None and fitted.error is not None:
                errors[row] = fitted.error
        variance = (_FIT_OVERCONFIDENCE * errors / np.where(slope > 0, slope, 1.0)) ** 2
        variance *= _WIDEST**2 / (variance + _WIDEST**2)
        variance = np.where(np.isnan(errors) | _at_bound(free), _WIDEST**2, variance)
        error = np.sqrt(np.maximum(table.rmse**2 - floor**2, _LEAST_ERROR**2))
        source, plain = "standard errors and RMSE of its fit", table.rmse**2 >= PLAIN * float(floor.max()) ** 2
        if plain:
            source += ", which is worse than the sensors' noise: something is missing, see lptn diagnose"
        return cls(np.diag(variance), error, source, not plain)

    @classmethod
    def nothing(cls, model: Model) -> ModelUncertainty:
        """Of a model that nobody fitted: so far off are data sheets and presets, and 1 K besides."""
        source = f"no fit is known; errors of {UNKNOWN:.0%} of each parameter and of {_UNKNOWN_ERROR:g} K are assumed"
        error = np.full(len(model.nodes), _UNKNOWN_ERROR)
        return cls(UNKNOWN**2 * np.eye(len(model.free)), error, source, learns=False)


def _at_bound(free: Sequence[ParameterInstance]) -> BoolArray:
    """Parameters that a bound stopped: their standard errors don't say how far the data would have moved them."""
    transform = Transform(free)
    bounds = transform.forward(
        np.array([parameter.declared.bounds for parameter in free], dtype=float).reshape(-1, 2).T
    )
    values = transform.forward(np.array([parameter.value for parameter in free], dtype=float))
    return np.asarray(np.abs(bounds - values).min(axis=0, initial=np.inf) < _AT_BOUND)


# --- The present, estimated from the log so far ---------------------------------------------------

_MEMORY = 3600.0  # s of the log that are looked at: some time constants of a joint
_HEAT_TIME = 1800.0  # s over which the heat that a model lacks stays alike
_AIR = 0.1  # relative error of all conductances to the air in one run: a draught, a load on the back
_SCALES = 2.0 ** np.arange(-1, 12)  # of missing heat that are tried, times the size that the fit's errors suggest
_CONSISTENT = 2.0  # mean square of innovations in standard deviations: 1 of a consistent filter, by chance never 2
_WORST_SCALE = 4.0  # up to which missing heat is not told by a log whose sensors may be at fault
_USUAL_SCALE = 1.5  # on a run that it never saw a model is that much worse than where it was fitted


def present(model: Model, run: Run, uncertainty: ModelUncertainty) -> tuple[Estimator, float]:
    """An estimator at the end of a log, and the size of the heat that the model lacks, as a multiple of the expected.

    The parameters and the draught are estimated along, from what the fit leaves open: a trot says more of its own
    friction than an identification with few trots. Not so for a model that lacks something, such as a second mass: it
    would bend them to suit the log so far, so their errors only widen the uncertainty. Missing heat is of the size
    that the fit's errors suggest, times a factor that makes this log likeliest. What a fit absorbed in its own runs
    comes back in another one, so that factor may be large; too small a one lets the parameters take the errors up and
    the filter diverge, whose likelihood then says nothing. So ever larger factors are tried until one is worse though
    its filter is consistent.

    Raises:
        InputError: the log lacks an input, or measures none of the model's nodes.
    """
    bound, noise = coarsely_bound(model, run, STEP), estimate_noise([bind(model, run)], model.nodes)
    white = np.maximum(noise.white / np.sqrt(max(1.0, bound.run.step / run.step)), LEAST_NOISE)
    size = _missing_heat(model, bound, uncertainty)
    best, chosen, highest = None, 0.0, -inf
    for scale in _SCALES.tolist():
        estimator = _estimator(model, white, noise.step, uncertainty, _error(model, scale * size), watch=False)
        # A factor of two from the usual scale is one standard deviation.
        posterior, square, readings = -0.5 * (log(scale / _USUAL_SCALE) / log(2.0)) ** 2, 0.0, 0
        for _ in run_filter(estimator, bound):
            if estimator.last is not None:
                posterior += estimator.last.log_likelihood
                square += estimator.last.normalised_square
                readings += estimator.last.innovation.size
        if posterior > highest:
            best, chosen, highest = estimator, scale, posterior
        elif square < _CONSISTENT * readings:
            break
    if best is None:
        raise RuntimeError("no scale of missing heat gave a likelihood")
    last = dict(zip(model.inputs, bound.inputs[:, -1].tolist(), strict=True))
    best.advance(last, bound.run.step / 2 if bound.run.averaged else bound.run.step)
    return best, chosen


def _missing_heat(model: Model, bound: BoundRun, uncertainty: ModelUncertainty) -> FloatArray:
    """The size that the model's uncertainty suggests [W], for as long as it stays alike, shape (nodes,)."""
    a = model.state_jacobian(default_start(model, bound), bound.inputs.mean(axis=1), model.values).full()
    nodes, (_, integral) = len(model.nodes), zero_order_hold(a, _HEAT_TIME)
    capacities = model.values[[model.network.capacities[node] for node in model.nodes]]
    warming = np.linalg.norm(integral[:nodes, :nodes] / capacities, axis=1)  # K/W
    of_fit = np.sqrt(np.mean((uncertainty.error / warming) ** 2))
    left_open = np.zeros(nodes) if uncertainty.learns else heat_of_doubt(model, bound, uncertainty.covariance)
    return np.asarray(np.hypot(of_fit, left_open))


def _error(model: Model, heat: FloatArray) -> ModelError:
    return ModelError(heat=dict(zip(model.nodes, heat.tolist(), strict=True)), heat_time=_HEAT_TIME, air=_AIR)


def _estimator(
    model: Model, white: FloatArray, step: FloatArray, uncertainty: ModelUncertainty, error: ModelError, *, watch: bool
) -> Estimator:
    """An estimator with what the fit leaves open; readings are means, or are taken one by one and watched."""
    # What is exact would make each step slower as a state.
    learns = uncertainty.learns and bool(uncertainty.covariance.any())
    learn = [model.parameters[index].name for index in model.free] if learns else []
    return Estimator(
        model,
        noise=dict(zip(model.nodes, white.tolist(), strict=True)),
        step=dict(zip(model.nodes, step.tolist(), strict=True)),
        error=error,
        learn=dict.fromkeys(learn, 0.0),
        covariance=uncertainty.covariance if learns else None,
        learn_air=uncertainty.learns,
        rounding="cell" if watch else "white",  # means over blocks lie between a sensor's steps
        watch=watch,
    )


# --- Sensors that are alive -----------------------------------------------------------------------

_FAULT = 6.0
"""Standard deviations of an offset, drift or lag that is called: chance among some thousand onsets at some ten sensors,
times one faulty sensor in a thousand logs, is met by 5.5."""
_MISSING = 60.0  # s without a reading at the end of a log, that is worth a word


def present_by_live_sensors(model: Model, run: Run, uncertainty: ModelUncertainty) -> tuple[Estimator, list[Doubt]]:
    """An estimator at the end of a log that leans on no sensor that is not alive, and the sensors that are not then.

    Raises:
        InputError: no sensor is alive, or the model is much faster than the log.
    """
    run = run.slice(float(run.time[-1]) - _MEMORY, float("inf"))
    bound, nodes = bind(model, run), tuple(model.nodes)
    substeps(model, bound, model.values, default_start(model, bound))  # refuses what no filter would come to an end of
    noise, size = estimate_noise([bound], nodes), _missing_heat(model, bound, uncertainty)
    own = [coarse_noise([bound], row, step) if step > 0 else noise.white[row] for row, step in enumerate(noise.step)]
    # Sensors of one step are of one kind: one that stands shows no noise, one that dwells between two steps too much.
    usual = np.array([np.median(np.array(own)[noise.step == step]) for step in noise.step])
    white = np.maximum(np.where(noise.step > 0, usual, np.maximum(usual, noise.white)), LEAST_NOISE)
    # Sensors are judged by a model as good as usual. Where those that nobody doubts then say that it is worse, all are
    # judged again: else the healthy sensor of a joint of which the model knows little would be left out.
    scale = _USUAL_SCALE
    for _ in range(2):
        watching = _estimator(model, white, noise.step, uncertainty, _error(model, scale * size), watch=True)
        left_out, doubts = not_alive(watching, bound)
        rest = without(run, nodes, left_out)
        refuse_none(rest, nodes, doubts)
        estimator, needed = present(model, rest, uncertainty)
        if not doubts or needed <= scale:
            break
        scale = needed
    faulty = _faulty(model, rest, uncertainty, _error(model, min(needed, max(scale, _WORST_SCALE)) * size))
    for doubt in faulty:
        left_out[nodes.index(doubt.node)] |= run.time >= doubt.since
    if faulty:
        doubts += [doubt for doubt in faulty if doubt.node not in {earlier.node for earlier in doubts}]
        estimator, _ = present(model, without(run, nodes, left_out), uncertainty)
    return estimator, doubts


def _faulty(model: Model, run: Run, uncertainty: ModelUncertainty, error: ModelError) -> list[Doubt]:
    """Sensors whose faults explain the readings better than the model's errors do, and better than a wrong input.

    None is called unless most of the sensors agree with the model: of one sensor and one model nothing says which is
    wrong. A model that lacks something, or that nobody fitted, is taken for as wrong as `lptn.monitor` guesses.
    """
    bound, guess = coarsely_bound(model, run, STEP), uncalibrated(model, [run], float(uncertainty.error.max()))
    if uncertainty.learns:
        guess = replace(guess, error=error, limits=np.full_like(guess.limits, _FAULT))
    given = Suspicion(model, bound, bound.measured, bound.measured, guess.noise, guess.error)
    alarms, _ = faults(given, guess.limits, model.inputs, taught=False)
    end, doubts = float(run.time[-1]) + run.step, dict[str, Doubt]()
    for alarm in alarms:
        if not alarm.channel and alarm.node not in doubts:
            why = f"{alarm.words}, as it seems, for {end - alarm.onset:.0f} s"
            doubts[alarm.node] = Doubt(alarm.node, alarm.onset - STEP, why)
    seen = np.isfinite(bound.measured).any(axis=1).sum()
    return list(doubts.values()) if 2 * len(doubts) <= seen else []


def _without_readings(bound: BoundRun, model: Model, doubts: Sequence[Doubt]) -> list[Doubt]:
    """Sensors that the log measures, but not at its end."""
    missing, doubted = [], {doubt.node for doubt in doubts}
    for node, readings in zip(model.nodes, bound.measured, strict=True):
        finite = np.flatnonzero(np.isfinite(readings))
        last = int(finite[-1]) + 1 if finite.size else 0
        seconds = (readings.size - last) * bound.run.step
        if bound.run.has(f"temperature.{node}") and seconds >= _MISSING and node not in doubted:
            since = float(bound.run.time[min(last, readings.size - 1)])
            missing.append(Doubt(node, since, f"has no reading to be believed in the last {seconds:.0f} s"))
    return missing


# --- The operating point held: temperatures to come -----------------------------------------------

_FIRST_STEP, _LAST_STEP, _GROWTH = 5.0, 300.0, 1.05  # s; fine at first, where a limit may be near
_TIME_CONSTANTS = 5.0  # of the slowest heat flow, after which less than 1 % of the way is left
_LONGEST = 12 * 3600.0  # s
_HOTTEST = 500.0  # degC; beyond it nothing more is computed
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
    gait: Gait | None = None,
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
    _check(cycles, coverage, window)
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
    doubts += _without_readings(bound, model, doubts)
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
    """Carry the present forwards with the operating point held.

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
    slowest = float(np.abs(np.linalg.eigvals(augmented.rates_by_state(z, point.inputs)).real).min())
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
        if not np.isfinite(z).all() or z[states].max() > _HOTTEST:
            break
        covariance = moved.transition @ covariance @ moved.transition.T + moved.added
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


def _limits_by_node(limits: float | Mapping[str, float], bound: BoundRun, model: Model) -> dict[str, float]:
    """The limit of each node that has one; the last one said wins."""
    measured = [node for node, row in zip(model.nodes, bound.measured, strict=True) if np.isfinite(row).any()]
    actuated = {
        column.partition(".")[2] for column in model.inputs if column.startswith(("torque.", "current.", "velocity"))
    }
    joints = [node for node in measured if node in actuated] or measured
    if not isinstance(limits, Mapping):
        limits = {"": limits}
    limited: dict[str, float] = {}
    for pattern, limit in limits.items():
        nodes = matching(pattern, model.places) if pattern else joints
        if not nodes:
            expected = f"one of {', '.join(model.places)}, or a pattern of them"
            raise InputError("limits", "node", f"'{pattern}'", expected)
        if not isfinite(limit):
            raise InputError("limits", pattern or "all joints", f"{limit}", "a temperature in degC")
        limited |= dict.fromkeys(nodes, float(limit))
    return {place: limited[place] for place in model.places if place in limited}


def _check(cycles: int, coverage: float, window: WindowChoice) -> None:
    if cycles < 1:
        raise ValueError(f"cycles: found {cycles}; expected 1 or more")
    if not 0 < coverage < 1:
        raise ValueError(f"coverage: found {coverage:g}; expected a share between 0 and 1")
    if isinstance(window, str) and window not in ("steady", "cycles"):
        raise ValueError(f"window: found '{window}'; expected steady, cycles or a number of seconds")
    if not isinstance(window, str) and not window > 0:
        raise ValueError(f"window: found {window:g} s; expected a time above 0 s")
