"""The present of a robot: a filter at the end of a log that leans on no sensor that is not alive."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace
from math import inf, log

import numpy as np

from lptn.basics.arrays import BoolArray, FloatArray
from lptn.basics.errors import InputError
from lptn.basics.parameters import Transform
from lptn.identify.fitting import Fit
from lptn.identify.noise import PLAIN, estimate_noise
from lptn.logs.run import Run
from lptn.logs.silence import silences
from lptn.model.model import Model
from lptn.model.tables import FitTable
from lptn.online.augmented_model import ModelError
from lptn.online.calibration import Calibration, uncalibrated
from lptn.online.estimator import UNKNOWN, Estimator
from lptn.online.fault_bank import KINDS, STEP, Hypothesis, coarsely_bound, faults
from lptn.online.quantisation import SENSOR_ERROR, noise_and_steps
from lptn.simulate.bound_run import BoundRun, bind, default_start
from lptn.simulate.dynamics import zero_order_hold
from lptn.simulate.simulation import simulate, substeps

# --- How far a model is to be trusted -------------------------------------------------------------

_UNKNOWN_ERROR = 1.0  # K; of a model without a stated RMSE
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
        transform, values = Transform(free), model.values[model.free]
        fitted = [table.parameters.get(parameter.name) for parameter in free]
        # What a fit left undetermined stands there without a standard error. Nor does that of a parameter that a bound
        # stopped say how far the data would have moved it.
        errors = np.array([np.nan if one is None or one.error is None else one.error for one in fitted], dtype=float)
        bounds = np.array([parameter.declared.bounds for parameter in free], dtype=float).reshape(-1, 2).T
        away = np.abs(transform.forward(bounds) - transform.forward(values)).min(axis=0, initial=np.inf)
        slope = np.abs(transform.slope(values))
        variance = (_FIT_OVERCONFIDENCE * errors / np.where(slope > 0, slope, 1.0)) ** 2
        variance *= _WIDEST**2 / (variance + _WIDEST**2)
        variance = np.where(np.isnan(errors) | (away < _AT_BOUND), _WIDEST**2, variance)
        error = np.sqrt(np.maximum(table.rmse**2 - floor**2, _LEAST_ERROR**2))
        source, plain = "standard errors and RMSE of the model's fit", table.rmse**2 >= PLAIN * float(floor.max()) ** 2
        if plain:
            source += "; the RMSE exceeds the sensors' noise, so an effect is missing: see lptn diagnose"
        return cls(np.diag(variance), error, source, not plain)

    @classmethod
    def nothing(cls, model: Model) -> ModelUncertainty:
        """Of a model that was never fitted: the usual error of data sheets and presets, and 1 K."""
        source = f"no fit is known; errors of {UNKNOWN:.0%} of each parameter and of {_UNKNOWN_ERROR:g} K are assumed"
        error = np.full(len(model.nodes), _UNKNOWN_ERROR)
        return cls(UNKNOWN**2 * np.eye(len(model.free)), error, source, learns=False)


# --- The present, estimated from the log so far ---------------------------------------------------

MEMORY = 3600.0
"""s of the log that are looked at: some time constants of a joint."""
_HEAT_TIME = 1800.0  # s; correlation time of the heat that a model lacks
_SAMPLED = 50  # steps of a run at which sensitivities to parameters are computed
_AIR = 0.1  # relative error of all conductances to the air in one run: a draught, a load on the back
_HEAT_SCALES = 2.0 ** np.arange(-1, 12)  # of missing heat that are tried, times the size that the fit's errors suggest
_CONSISTENT = 2.0  # mean square of innovations in standard deviations: 1 of a consistent filter, by chance never 2
_WORST_SCALE = 4.0  # up to which missing heat can't be estimated from a log whose sensors may be faulty
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
    white = np.maximum(noise.white / np.sqrt(max(1.0, bound.run.step / run.step)), SENSOR_ERROR)
    of_means = np.hypot(white, noise.step / np.sqrt(12.0))  # which lie between a sensor's steps
    size, given = _missing_heat(model, bound, uncertainty), _given(model, bound, of_means, uncertainty)
    best, chosen, highest = None, 0.0, -inf
    for scale in _HEAT_SCALES.tolist():
        trial = replace(given, error=_error(model, bound, uncertainty, scale * size))
        # A factor of two from the usual scale is one standard deviation.
        posterior = trial.nats() - 0.5 * (log(scale / _USUAL_SCALE) / log(2.0)) ** 2
        if posterior > highest:
            best, chosen, highest = trial.filtered.estimator, scale, posterior
        elif trial.filtered.squares.sum() < _CONSISTENT * np.isfinite(trial.measured).sum():
            break
    if best is None:
        raise RuntimeError("no scale of missing heat gave a likelihood")
    last = dict(zip(model.inputs, bound.inputs[:, -1].tolist(), strict=True))
    best.advance(last, bound.run.step / 2 if bound.run.averaged else bound.run.step)
    return best, chosen


def _missing_heat(model: Model, bound: BoundRun, uncertainty: ModelUncertainty) -> FloatArray:
    """The size that the model's uncertainty suggests [W], during its correlation time, shape (nodes,)."""
    a = model.state_jacobian(default_start(model, bound), bound.inputs.mean(axis=1), model.values).full()
    nodes, (_, integral) = len(model.nodes), zero_order_hold(a, _heat_time(bound, uncertainty))
    capacities = model.values[[model.network.capacities[node] for node in model.nodes]]
    warming = np.linalg.norm(integral[:nodes, :nodes] / capacities, axis=1)  # K/W
    of_fit = np.full(nodes, np.sqrt(np.mean((uncertainty.error / warming) ** 2)))
    if uncertainty.learns:
        return of_fit
    # What parameters that are off leave out, root mean square over the run, by some of its steps.
    some = np.unique(np.linspace(0, len(bound) - 1, min(len(bound), _SAMPLED)).astype(int))
    states, inputs = simulate(model, bound).held[:, some], np.nan_to_num(bound.inputs[:, some])
    rates = model.parameter_jacobian(states, inputs, model.values).full().reshape(len(states), len(some), -1)
    slope = np.abs(Transform([model.parameters[index] for index in model.free]).slope(model.values[model.free]))
    by_coordinate = rates[:nodes, :, model.free] * slope
    variance = np.einsum("nkp,pq,nkq->n", by_coordinate, uncertainty.covariance, by_coordinate) / len(some)
    return np.asarray(np.hypot(of_fit, np.sqrt(variance) * capacities))


def _heat_time(bound: BoundRun, uncertainty: ModelUncertainty) -> float:
    """Correlation time of the heat that a model lacks [s].

    A model that lacks something may lack a mass, and a winding that is warm before its housing looks like heat for a
    minute or two: what was seen of it for so long is not known to last for longer.
    """
    return _HEAT_TIME if uncertainty.learns else min(_HEAT_TIME, len(bound) * bound.run.step)


def _error(model: Model, bound: BoundRun, uncertainty: ModelUncertainty, heat: FloatArray) -> ModelError:
    of_nodes = dict(zip(model.nodes, heat.tolist(), strict=True))
    return ModelError(heat=of_nodes, heat_time=_heat_time(bound, uncertainty), air=_AIR)


def _given(model: Model, bound: BoundRun, noise: FloatArray, uncertainty: ModelUncertainty) -> Hypothesis:
    """A run with what the fit leaves open; what is exact would make each step slower as a state."""
    learns = uncertainty.learns and bool(uncertainty.covariance.any())
    covariance = uncertainty.covariance if learns else None
    return Hypothesis(model, bound, bound.measured, noise, ModelError(), covariance, uncertainty.learns)


# --- Sensors that are not used ----------------------------------------------------------------

_FAULT = 6.0
"""Standard deviations of an offset, drift or lag that is called: chance among some thousand onsets at some ten sensors,
times one faulty sensor in a thousand logs, is met by 5.5."""
_MISSING = 60.0  # s without a reading at the end of a log, that is worth a word


@dataclass(frozen=True)
class Doubt:
    """A sensor that is not used.

    Args:
        node: whose sensor.
        since: s of the log's clock; readings from then on are left out.
        why: in words.
    """

    node: str
    since: float
    why: str

    def __str__(self) -> str:
        return f"{self.node}: {self.why}"


def without(run: Run, nodes: tuple[str, ...], left_out: BoolArray) -> Run:
    """A run without the readings that are `left_out`, shape (nodes, n)."""
    columns = dict(run.columns)
    for node, rows in zip(nodes, left_out, strict=True):
        if rows.any():
            columns[f"temperature.{node}"] = np.where(rows, np.nan, columns[f"temperature.{node}"])
    return replace(run, columns=columns)


def not_alive(estimator: Estimator, bound: BoundRun) -> tuple[BoolArray, list[Doubt]]:
    """Readings of sensors that are not alive, shape (nodes, n); and the sensors that are not at the end.

    Args:
        estimator: fresh, one that watches its sensors.
        bound: the run.
    """
    time, left_out = bound.run.time, np.zeros(bound.measured.shape, dtype=bool)
    if not estimator.watch:
        raise ValueError("estimator: found one that does not watch its sensors; expected watch=True")
    doubted = [(False, False)] * len(left_out)  # whether each was lost, and stood, before
    for k in estimator.run(bound):
        for row, sensor in enumerate(estimator.sensors):
            lost, stood = doubted[row]
            if (sensor.lost and not lost) or (sensor.stands and not stood):
                # No reading of a sensor that was never alive was one; of one that stands the first was.
                since = sensor.since - sensor.clock + time[k] if sensor.stands else time[k]
                left_out[row, : k + 1] |= (time[: k + 1] > since) | (not sensor.once_trusted)
            left_out[row, k] |= sensor.lost
            doubted[row] = sensor.lost, sensor.stands
    doubts = []
    for node, why in estimator.estimate.untrusted.items():
        kept = np.flatnonzero(~left_out[estimator.model.nodes.index(node)])
        doubts.append(Doubt(node, float(time[min(kept[-1] + 1, time.size - 1)] if kept.size else time[0]), why))
    return left_out, doubts


def judge_of_sensors(
    model: Model, bound: BoundRun, uncertainty: ModelUncertainty, false_inputs: Collection[str] = ()
) -> Estimator:
    """A fresh filter that watches its sensors, as `present_by_live_sensors` judges them first.

    Args:
        model: the model.
        bound: the run so far, which tells the sensors' noise and the heat that the model lacks.
        uncertainty: how far the model is to be trusted.
        false_inputs: loads of joints that say nothing of their heat.
    """
    heat = _USUAL_SCALE * _missing_heat(model, bound, uncertainty)
    return _judge(model, bound, uncertainty, heat, false_inputs, repeats=True)


def _judge(
    model: Model,
    bound: BoundRun,
    uncertainty: ModelUncertainty,
    heat: FloatArray,
    false_inputs: Collection[str] = (),
    *,
    repeats: bool,
) -> Estimator:
    noise, step = noise_and_steps(estimate_noise([bound], model.nodes))
    given = replace(_given(model, bound, noise, uncertainty), error=_error(model, bound, uncertainty, heat))
    for column in false_inputs:
        given = given.with_unknown_input(column)
    return given.estimator(step, watch=True, repeats=repeats)


def present_by_live_sensors(model: Model, run: Run, uncertainty: ModelUncertainty) -> tuple[Estimator, list[Doubt]]:
    """An estimator at the end of a log that leans on no sensor that is not alive, and the sensors that are not then.

    Raises:
        InputError: no sensor is alive, or the model is much faster than the log.
    """
    whole, nodes = bind(model, run), tuple(model.nodes)
    still, silent = _silent(whole, nodes)
    recent = without(run, nodes, still).slice(float(run.time[-1]) - MEMORY, inf)
    bound = bind(model, recent)
    substeps(model, bound, model.values, default_start(model, bound))  # refuses what no filter would come to an end of
    # A model is wrong for minutes on end, so that readings of each second say no more than their means.
    bound = coarsely_bound(model, recent, STEP)
    run, size = bound.run, _missing_heat(model, bound, uncertainty)
    # Sensors are judged by a model as good as usual. Where those that nobody doubts then say that it is worse, all are
    # judged again: else the healthy sensor of a joint of which the model knows little would be left out.
    scale = _USUAL_SCALE
    for _ in range(2):
        judging = _judge(model, bound, uncertainty, scale * size, repeats=False)
        left_out, doubts = not_alive(judging, bound)
        if not (np.isfinite(bound.measured) & ~left_out).any():
            said = "; ".join(map(str, [*silent, *doubts]))
            raise InputError(run.source, "temperature columns", said, "a sensor that is alive")
        rest = without(run, nodes, left_out)
        estimator, needed = present(model, rest, uncertainty)
        if not doubts or needed <= scale:
            break
        scale = needed
    guess = uncalibrated(model, [recent], float(uncertainty.error.max()))
    if uncertainty.learns:
        error = _error(model, bound, uncertainty, min(needed, max(scale, _WORST_SCALE)) * size)
        guess = guess.model_copy(update={"limits": dict.fromkeys(KINDS, _FAULT), "model_error": error})
    faulty = _faulty(model, rest, uncertainty, guess)
    for doubt in faulty:
        left_out[nodes.index(doubt.node)] |= run.time >= doubt.since
    if faulty:
        estimator, _ = present(model, without(run, nodes, left_out), uncertainty)
    for node, readings in zip(nodes, whole.measured, strict=True):
        last = int(np.flatnonzero(np.isfinite(readings)).max(initial=-1)) + 1
        seconds = (readings.size - last) * whole.run.step
        if whole.run.has(f"temperature.{node}") and seconds >= _MISSING:
            since = float(whole.run.time[min(last, readings.size - 1)])
            silent.append(Doubt(node, since, f"has no valid reading in the last {seconds:.0f} s"))
    first = dict[str, Doubt]()
    for doubt in [*silent, *doubts, *faulty]:
        first.setdefault(doubt.node, doubt)
    return estimator, list(first.values())


def _silent(bound: BoundRun, nodes: tuple[str, ...]) -> tuple[BoolArray, list[Doubt]]:
    """Readings that repeat one number for longer than their sensor can, (nodes, n); the sensors that do up to the end.

    A log's file was read without them; a table from elsewhere may hold some.
    """
    time, still, doubts = bound.run.time, np.zeros(bound.measured.shape, dtype=bool), list[Doubt]()
    for node, readings, rows in zip(nodes, bound.measured, still, strict=True):
        for one in silences(time, readings, resolution=bound.run.resolution.get(f"temperature.{node}", 0.0)):
            rows |= one.rows
            if one.stop >= time[np.isfinite(readings)][-1]:
                seconds = one.stop - one.start
                doubts.append(
                    Doubt(node, one.start, f"has read {one.value:.6g} degC, bit for bit, for {seconds:.0f} s")
                )
    return still, doubts


def _faulty(model: Model, run: Run, uncertainty: ModelUncertainty, usual: Calibration) -> list[Doubt]:
    """Sensors whose faults explain the readings better than the model's errors do, and better than a wrong input.

    None is called unless most of the sensors agree with the model: of one sensor and one model nothing says which is
    wrong. A model that lacks something, or that nobody fitted, is taken for as wrong as `lptn.monitor` guesses; and
    what it lacks may be a mass, behind which a sound sensor lags.
    """
    given = Hypothesis.of(model, run, usual.noise, usual.model_error)
    end, doubts = float(run.time[-1]) + run.step, dict[str, Doubt]()
    known = uncertainty.covariance if uncertainty.learns else None
    ambiguous = {"undecided"} if uncertainty.learns else {"undecided", "lag"}
    for alarm in faults(given, usual.limits, (), covariance=known, taught=uncertainty.learns):
        if not alarm.channel and alarm.kind not in ambiguous and alarm.node not in doubts:
            why = f"{alarm.words}, as it seems, for {end - alarm.onset:.0f} s"
            doubts[alarm.node] = Doubt(alarm.node, alarm.onset - STEP, why)
    seen = np.isfinite(given.measured).any(axis=1).sum()
    return list(doubts.values()) if 2 * len(doubts) <= seen else []
