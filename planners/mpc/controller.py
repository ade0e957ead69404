"""Thermal model-predictive control: the closest currents to those requested that keep every node below its limit."""

from __future__ import annotations

import ctypes
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, get_args

import numpy as np
import pandas as pd
from scipy.special import ndtri

from lptn.basics.arrays import FloatArray
from lptn.basics.errors import InputError
from lptn.basics.files import write_folder
from lptn.basics.tables import Tabular
from lptn.model.model import Model
from lptn.online.living_sensors import LEAST

from ..compiled import c_files
from ..heating import Request, heating
from ..values import Each, Values, in_order
from .c_code import python_library, settings_header, sources, structs, surroundings, unsure
from .settings import SLACK_PRICES, LostSensor, Settings

_MEANING = {
    4: "a request is no number; taken as zero",
    64: "a condition is no number; the last good one, else zero, stands in for it; under a power limit a joint whose "
    "speed is not known yet gets no more than its floor",
    8: "a request lies above the current limit and is cut to it",
    256: "the joints' power is above its limit: floors, slow rates, or 3 % of each request, the least that is planned",
    32: "the solver did not converge; this is the best plan that it met, not proven to be the best there is",
}
_INSTEAD = {
    "model": "the model stands in for it",
    "derate": "its joint gets what holds the limit",
    "stop": "its joint gets no more than its floor",
}
_MISSING, _STANDS, _CONTRADICTS = 1, 2, 3  # of a sensor, as in `c/lptn_mpc.h`
_ESTIMATE = 3  # of the filters, as there
_NO_CUT = 5e-4  # of a request; a smaller cut is none to a person
_SHORTCUT, _TOO_HOT, _NOT_BEST, _NOT_ALIVE = 1, 16, 32, 128


@dataclass(frozen=True, repr=False)
class Plan(Tabular):
    """One step's answer.

    Args:
        joints: names, in order.
        unit: of the requests, N*m or A.
        asked: of the coming period, in that unit, shape (joints,).
        admitted: for the coming period, in the request's unit, shape (joints,).
        currents: planned for each stage, in the request's unit, shape (stages, joints).
        temperatures: expected at the n + 1 ends of the stages [degC], shape (states, stages + 1).
        slack: by how much each limit less its margin is passed at the end of each stage [K], shape (stages, limited
            nodes); where a sensor is lost, the course on which its node comes to that.
        margin: what is kept below each limit for what is not known, beside a fixed one [K], shape (limited nodes,).
        cost: 0 for all that was requested, 1 for nothing.
        iterations: of the solver, 0 where the full request stays cool.
        status: bits of `c/lptn_mpc.h`.
        limited: names of the limited nodes.
        untrusted: nodes whose sensor is not alive, and why its reading is not believed; the prediction stands in.
        unread: nodes of which there is no reading, or an absurd one; the prediction stands in.
        doubted: nodes that are planned hotter than their sensor says, by how much [K]; from 1 K on.
        lost_sensor: what a joint gets whose node has lost its sensor.
        error: largest change at the last linearisation: of a stage's end [K], or of its power as a share of
            `power_limit`; the solver wants both below the same number.
        power: of all joints together at the supply [W], shape (stages,); NaN without a limit.
    """

    joints: tuple[str, ...]
    unit: str
    asked: FloatArray
    admitted: FloatArray
    currents: FloatArray
    temperatures: FloatArray
    slack: FloatArray
    margin: FloatArray
    cost: float
    iterations: int
    status: int
    limited: tuple[str, ...]
    untrusted: Mapping[str, str]
    unread: tuple[str, ...]
    doubted: Mapping[str, float]
    lost_sensor: LostSensor
    error: float
    power: FloatArray

    @property
    def full(self) -> bool:
        """Whether the full request stays cool, so that nothing had to be solved."""
        return bool(self.status & _SHORTCUT)

    @property
    def converged(self) -> bool:
        """Whether this is the optimum, not only the best plan that was met."""
        return not self.status & _NOT_BEST

    @property
    def given_up(self) -> tuple[str, ...]:
        """In words, what could not be had; empty where all limits and inputs were good."""
        margins = dict(zip(self.limited, self.margin, strict=True))
        reasons = dict(self.untrusted) | dict.fromkeys(self.unread, "has no reading")
        sentences = []
        for node, why in reasons.items():
            instead = _INSTEAD["model" if node in self.unread else self.lost_sensor]
            below = f", {margins[node]:.2g} K below the limit" if node in margins else ""
            sentences.append(f"{node} {why}; {instead}{below}")
        sentences += [
            f"{node} reads colder than the model expects, and has not shown that it follows the heat; "
            f"planned {hotter:.2g} K hotter"
            for node, hotter in self.doubted.items()
        ]
        sentences += [text for bit, text in _MEANING.items() if self.status & bit]
        if self.status & _TOO_HOT:
            worst = self.slack.max(axis=0)
            where = ", ".join(
                f"{node} by {over:.2g} K"
                for node, over in zip(self.limited, worst, strict=True)
                if over > 1e-3  # K; less is the solver's own
            )
            sentences.insert(0, f"a limit less its margin can't be met: {where}")
        return tuple(sentences)

    @property
    def shares(self) -> FloatArray:
        """What is admitted as a share of what is asked, shape (joints,); NaN where nothing is asked."""
        asked = np.abs(self.asked)
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(np.where(asked > 0, np.abs(self.admitted) / asked, np.nan))

    @property
    def summary(self) -> str:
        """How much is admitted, and what could not be had, in one line."""
        shares = pd.Series(self.shares, index=self.joints).dropna()
        if shares.empty:
            admitted = "no joint is asked for anything"
        elif shares.min() >= 1 - _NO_CUT:
            admitted = "all that is asked is admitted"
        else:
            cut = int((shares < 1 - _NO_CUT).sum())
            admitted = f"{cut} of {len(self.joints)} joints cut, {shares.idxmin()} most, to {shares.min():.0%}"
        return "; ".join([admitted, *self.given_up])

    def to_pandas(self) -> pd.DataFrame:
        """A row for each joint: what is asked and what is admitted for the coming period, and its share."""
        columns = {"joint": self.joints, f"asked [{self.unit}]": self.asked, f"admitted [{self.unit}]": self.admitted}
        return pd.DataFrame(columns | {"share": self.shares})


class TorqueMPC:
    r"""The closest admissible torques or currents, every control period, in about a millisecond.

    .. math:: \min \sum_k h_k \sum_j w_j (I_{kj} - I^\mathrm{req}_{kj})^2 \quad
        \text{so that } T_i(t_k) \le T_i^\mathrm{max} + e_{ki},\; |I_{kj}| \le I_j^\mathrm{max}

    with slack e at a linear and quadratic price so high that it is zero wherever the limits can be met. The
    unknowns are heat scales :math:`s = (I/I^\mathrm{req})^2`: cost and limits are convex in them, and nothing that is
    linearised depends on the step from one to the next. An interior-point method in C solves it, the dynamics
    linearised anew on the way down; each stage is the exact exponential of its linearisation. The same C code runs on a
    robot (`emit`). Where the full request stays cool nothing is solved.

    What the model lacks is estimated from the readings by an extended Kalman filter of its parameters and a heat of
    each node, so that the limits are kept by a model that is wrong.

    Args:
        model: the model, at the values to use.
        limits: degC, by node or pattern, or one for all nodes.
        request: `"torque"` [N*m] or `"current"` [A]; by default what the model's log columns hold.
        current_limits: of the joints [A].
        period: of the controller [s].
        horizon: how far it looks [s].
        stages: of the horizon, growing from `period` on.
        weights: of a squared deviation, by joint.
        rates: largest change of a joint's torque or current in a second, 0 for none. It acts on the coming period; a
            request that falls faster is followed.
        floors: torque [N*m] or current [A] that a joint gets whatever gets hot, where so much is asked (and the
            current limit allows it): what holds the robot up. It comes before the temperature limits, without end.
        priorities: whole numbers, by joint: a joint gives way by a hundredth of the share by which one a level lower
            does. From -2 to 2.
        recovery: time constant τ [s] of a node above its limit: it comes down by dT/dt = −(T − limit)/τ, which is
            the same course at every step. By default τ = 10 K / (the node's cooling at its limit, without load,
            in air of 25 degC [K/s]): its heat falls from what holds the limit to none at 10 K above it. 0: as fast as
            can be, and everything that warms it, be it ever so little, is cut to next to nothing meanwhile.
        smoothing: time constant [s] with which a joint's share of its request rises while the same is asked; it falls
            at once. Less ripple at a limit, and no more of what is above it: never is more admitted than without.
        level: probability with which a node that is held at its limit is to be below it. The margin for it follows
            from the covariance of the estimate, one period on, and the odds that a sensor drifts; `Plan.margin` tells
            it.
        margin: K that is kept beside it.
        noise: standard deviation of a reading [K], its rounding aside.
        resolution: step to which readings are rounded [K]: 1 where a drive tells whole degrees.
        model_error: what the model's heat flows may be off by, relative; half of it each parameter. 0 where
            temperatures come from an estimator of your own: then readings are taken as they are, with an error of
            `noise`.
        standard_errors: of the model's parameters by name; they add to `model_error`. By default those of the table
            `[fit]` of its file, where there is one.
        lost_sensor: what a joint gets whose node has lost its sensor: `"model"`, what the model allows, with the
            margin that it needs without the sensor; `"derate"`, what would hold the node if it were at its limit;
            `"stop"`, its floor.
        power_limit: of all joints together at the supply [W]: what they heat, and |torque x speed| at the
            `velocity.<joint>` among the conditions; of a bus current its voltage times as much. It bounds the mean
            over a stage, and braking joints give nothing back.

    Raises:
        InputError: an unknown place, a number that can't be used, or a model without currents or torques.
        OSError: no C compiler.

    Source: interior point with Riccati elimination [Rao1998], predictor and corrector [Mehrotra1992].
    """

    def __init__(
        self,
        model: Model,
        limits: Each,
        *,
        request: Request | None = None,
        current_limits: Each = float("inf"),
        period: float = 5.0,
        horizon: float = 300.0,
        stages: int = 16,
        weights: Each = 1.0,
        rates: Each = 0.0,
        floors: Each = 0.0,
        priorities: Each = 0.0,
        recovery: float | None = None,
        smoothing: float = 0.0,
        level: float = 0.95,
        margin: float = 0.0,
        noise: float = 0.1,
        resolution: float = 0.0,
        model_error: float = 0.2,
        standard_errors: Mapping[str, float] | None = None,
        lost_sensor: LostSensor = "model",
        power_limit: float = math.inf,
    ) -> None:
        self.model, limited_power = model, math.isfinite(power_limit)
        self.heating = heating(model, request, limited_power)
        self.settings = Settings(
            self.heating, limits, period=period, horizon=horizon, stages=stages, margin=margin, weights=weights,
            current_limits=current_limits, rates=rates, floors=floors, priorities=priorities, recovery=recovery,
            smoothing=smoothing, noise=noise, resolution=resolution, level=level, model_error=model_error,
            standard_errors=model.standard_errors if standard_errors is None else standard_errors,
            lost_sensor=lost_sensor, power_limit=power_limit,
        )  # fmt: skip
        self.joints, self.conditions = self.heating.joints, self.heating.conditions
        count, limited = len(self.settings.stages), len(self.settings.limits)
        self.sources = sources(self.heating, limited, count, limited_power)
        self._library: Any = python_library(self.sources)
        self._library.lptn_mpc_step.restype = None
        self._library.lptn_mpc_sizes.restype = ctypes.c_longlong
        kinds = structs(self.sources)
        kept = [kinds[f"lptn_mpc_{name}"] for name in ("settings", "state", "result")]
        sizes, expected = [ctypes.sizeof(kind) for kind in kept], list(map(self._library.lptn_mpc_sizes, range(4)))
        if sizes != expected[:3]:
            raise RuntimeError(f"structs of {sizes} bytes in Python, {expected[:3]} in C")
        self._settings, self._state, self._result = (kind() for kind in kept)
        self._fill_settings()
        self._work = ctypes.create_string_buffer(int(expected[3]) + 64)
        self._measured, self._request = np.empty(len(model.nodes)), np.empty((count, len(self.joints)))
        self._conditions, self._applied = np.empty((count, len(self.conditions))), np.empty(len(self.joints))

    def step(
        self,
        measured: Values,
        request: Values | FloatArray,
        conditions: Values | FloatArray = (),
        applied: Values | None = None,
    ) -> Plan:
        """One control period.

        Args:
            measured: temperatures [degC] by node, or in the order of `model.nodes`; NaN or left out where there is
                none.
            request: torque [N*m] or current [A] by joint, or in the order of `joints`; or RMS values of each stage,
                shape (stages, joints).
            conditions: the model's other inputs (`speed.base`, `temperature.ambient`) by column, or in the order of
                `conditions`; or their means over each stage, shape (stages, conditions).
            applied: what was applied on average (RMS) since the last call, where it is not what was admitted.

        Returns:
            What to apply, the plan behind it, and what was given up.

        Raises:
            InputError: an unknown name, or a wrong number of values. Values that are no numbers are no reason to raise:
                the plan says what stood in for them.
        """
        self._measured[:] = in_order(measured, self.model.nodes, "measured", np.nan)
        fill(self._request, request, self.joints, "request")
        if isinstance(conditions, Mapping):
            # Only a mechanical power among them means another speed in each stage.
            stages = self._request[: 1 if conditions.keys().isdisjoint(self.heating.decided) else None]
            rows = [self.heating.conditions_from(conditions, asked) for asked in stages]
            self._conditions[:] = rows
        else:
            fill(self._conditions, conditions, self.conditions, "conditions")
        if applied is not None:
            self._applied[:] = in_order(applied, self.joints, "applied", np.nan)
        settings, state, result = map(ctypes.byref, (self._settings, self._state, self._result))
        given = (self._measured.ctypes, self._request.ctypes, self._conditions.ctypes,
                 None if applied is None else self._applied.ctypes)  # fmt: skip
        self._library.lptn_mpc_step(settings, state, self._work, *given, result)
        return self._answer()

    def reset(self) -> None:
        """Forget the estimate and the last plan."""
        ctypes.memset(ctypes.byref(self._state), 0, ctypes.sizeof(self._state))

    @property
    def estimate(self) -> dict[str, float]:
        """Estimated temperature of each state [degC]."""
        return dict(zip(self.model.states, self._estimated, strict=False))

    @property
    def bias(self) -> dict[str, float]:
        """Heat that the model lacks, as a rate of each node [K/s]."""
        return dict(zip(self.model.nodes, self._estimated[len(self.model.states) :], strict=False))

    @property
    def parameters(self) -> dict[str, float]:
        """Values of the model's parameters as the readings tell them, by name."""
        names, values = [parameter.name for parameter in self.model.parameters], np.array(self.model.values)
        own = unsure(self.heating)
        values[own] += self._off[: len(own)]
        return dict(zip(names, values.tolist(), strict=True))

    @property
    def air(self) -> dict[str, float]:
        """By how much what surrounds the robot is warmer than told [K], by column, as the readings tell it."""
        around = surroundings(self.heating)
        return {self.conditions[row]: off for row, off in zip(around, self._off[-len(around) :].tolist(), strict=False)}

    @property
    def _off(self) -> FloatArray:
        """By how much parameters and what surrounds the robot differ from what is told, in their units."""
        off = self._estimated[len(self.model.states) + len(self.model.nodes) :]
        return np.asarray(self.settings.units * np.expm1(off))

    @property
    def _estimated(self) -> FloatArray:
        return np.array(self._state.filter[_ESTIMATE].z)

    def emit(self, folder: Path | str, start: FloatArray, asked: FloatArray, conditions: FloatArray) -> list[Path]:
        """Write the controller as C files for a robot: solver, model, settings and a small program that runs it.

        Args:
            folder: where to; made where it is missing.
            start: temperatures of the example [degC], shape (states,).
            asked: requests of the example, shape (steps, joints).
            conditions: the model's other inputs in the example, shape (steps, conditions).

        Returns:
            The files, in the order in which a person reads them.

        Raises:
            InputError: the folder can't be written.
        """
        model = self.model
        names = [f"temperature.{node} [degC]" for node in model.nodes]
        names += [f"{self.heating.request}.{joint} [{self.heating.unit}]" for joint in self.joints]
        names += list(self.conditions)
        rows = [[*start[: len(model.nodes)], *row, *around] for row, around in zip(asked, conditions, strict=True)]
        content = {
            **c_files("mpc", ("main.c", "loop.c")),  # that run the emitted step, and the loop of short ticks about it
            "settings.h": settings_header(self._settings),
            "names.txt": "\n".join([*names, ""]),
            "example.txt": "\n".join([*(" ".join(f"{value:.10g}" for value in row) for row in rows), ""]),
            **self.sources,
        }
        return write_folder(Path(folder), content)

    def _answer(self) -> Plan:
        result = self._result
        return Plan(
            self.joints,
            self.heating.unit,
            np.array(self._state.asked),
            np.array(result.admitted),
            np.array(result.plan),
            np.array(result.x).T,
            np.array(result.slack),
            np.array(result.margin),
            result.cost,
            result.iterations,
            result.status,
            tuple(self.settings.limits),
            self._untrusted() if result.status & _NOT_ALIVE else {},
            tuple(node for node, sensor in zip(self.model.nodes, result.sensor, strict=True) if sensor == _MISSING),
            {
                node: hotter
                for node, hotter, sensor in zip(self.model.nodes, result.doubt, result.sensor, strict=True)
                if hotter >= LEAST and sensor not in (_STANDS, _CONTRADICTS)
            },
            self.settings.lost_sensor,
            result.error,
            np.array(result.power),
        )

    def _untrusted(self) -> dict[str, str]:
        sensors, untrusted = self._state.sensors, {}
        for number, node in enumerate(self.model.nodes):
            if self._result.sensor[number] == _STANDS:
                lasting = sensors.clock - sensors.since[number]
                untrusted[node] = f"has read {sensors.last[number]:.6g} degC, bit for bit, for {lasting:.0f} s"
            elif self._result.sensor[number] == _CONTRADICTS:
                untrusted[node] = f"reads {sensors.last[number]:.6g} degC, which the heat put in contradicts"
            if node in untrusted and (hotter := self._result.doubt[number]) >= LEAST:
                untrusted[node] += f", and may be {hotter:.2g} K hotter than expected"
        return untrusted

    def _fill_settings(self) -> None:
        """Write the settings into their struct; one that `c/lptn_mpc.h` has and this lacks is a KeyError."""
        own = self.settings
        linear, quadratic = SLACK_PRICES
        parameters, around = len(self.model.values), len(surroundings(self.heating))
        grain = own.resolution / math.sqrt(12)  # K, standard deviation of a reading's rounding
        values: dict[str, Any] = {
            "stage": own.stages, "limit": own.planned_limits,
            "node": [self.model.places.index(node) for node in own.limits], "owner": self.model.owners,
            "weight": own.weights, "most": own.currents, "rate": own.rates, "floor": own.floors,
            "p": [*self.model.values, *np.zeros(around + 1)],
            "unsure": [*unsure(self.heating), *range(parameters, parameters + around)], "unit": own.units,
            "recovery": own.recovery, "smoothing": own.smoothing, "linear": linear, "quadratic": quadratic,
            "noise": math.hypot(own.noise, grain), "grain": grain, "sigmas": float(ndtri(own.level)),
            "error": own.errors, "learns": own.model_error > 0, "settles": own.settles,
            "tolerance": 1e-6,  # on the duality gap; the cost of admitting nothing is 1
            "iterations": 100, "warm": 50,  # at most; so many from the last plan, the others for a cold start
            "lost_sensor": get_args(LostSensor).index(own.lost_sensor), "power": own.power,
        }  # fmt: skip
        for name, _ in self._settings._fields_:
            if np.ndim(values[name]):
                np.ctypeslib.as_array(getattr(self._settings, name))[...] = values[name]
            else:
                setattr(self._settings, name, values[name])


def fill(to: FloatArray, values: Values | FloatArray, names: Sequence[str], what: str) -> None:
    """Write values into each stage: the same ones by name or in order, or a row for each stage."""
    array = np.asarray(values, dtype=float) if not isinstance(values, Mapping) else None
    if array is not None and array.ndim == 2:
        if array.shape != to.shape:
            raise InputError(what, "values", f"shape {array.shape}", f"shape {to.shape}")
        to[:] = array
        return
    to[:] = in_order(values, names, what, np.nan)
