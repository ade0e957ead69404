"""Thermal model-predictive control: the closest currents to those requested that keep every node below its limit."""

from __future__ import annotations

import ctypes
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from lptn.basics.arrays import FloatArray
from lptn.basics.errors import InputError
from lptn.model.model import Model

from .build import python_library, sources
from .heat import Request, heating
from .plan import Plan
from .settings import Each, settle
from .structs import structs

Values = Mapping[str, float] | Sequence[float] | FloatArray
"""Numbers by name, or in order."""


class TorqueMPC:
    r"""The closest admissible torques or currents, every control period, in about a millisecond.

    .. math:: \min \sum_k h_k \sum_j w_j (I_{kj} - I^\mathrm{req}_{kj})^2 \quad
        \text{so that } T_i(t_k) \le T_i^\mathrm{max} + e_{ki},\; |I_{kj}| \le I_j^\mathrm{max}

    with slack e at a linear and quadratic price so high that it is zero wherever the limits can be met. The
    unknowns are heat scales :math:`s = (I/I^\mathrm{req})^2`: cost and limits are convex in them, and nothing that is
    linearised depends on the step from one to the next. An interior-point method in C solves it, the dynamics
    linearised anew on the way down; each stage is the exact exponential of its linearisation. The same C code runs on a
    robot (`emit`). Where the full request stays cool nothing is solved.

    What the model lacks is estimated from the readings, for each node a heat and a relative error of its controlled
    heat, so that the limits are kept by a model that is wrong.

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
        recovery: s that a node above its limit may take to come down to it. 0: as fast as can be, and everything
            that warms it, be it ever so little, is cut to next to nothing meanwhile. It counts anew from each step,
            so in closed loop the node comes down like an exponential of that time.
        margin: K by which the plan stays below the limits.
        noise: standard deviation of a reading [K].
        model_error: what the model's heat flows may be off by, relative. 0 where temperatures come from an estimator of
            your own: then readings are taken as they are.

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
        recovery: float = 0.0,
        margin: float = 0.15,
        noise: float = 0.1,
        model_error: float = 0.2,
    ) -> None:
        self.model = model
        self.heating = heating(model, requested_by(model) if request is None else request)
        self.settings = settle(
            self.heating, limits, period=period, horizon=horizon, stages=stages, margin=margin, weights=weights,
            current_limits=current_limits, rates=rates, recovery=recovery, noise=noise, model_error=model_error,
        )  # fmt: skip
        self.joints, self.conditions = self.heating.joints, self.heating.conditions
        count, limited = len(self.settings.stages), len(self.settings.limits)
        self.sources = sources(self.heating, limited, count)
        loaded = ctypes.CDLL(str(python_library(self.sources)))
        self._step: Any = loaded.lptn_mpc_step
        self._step.restype = None
        loaded.lptn_mpc_sizes.restype = ctypes.c_longlong
        kinds = structs(self.heating, limited, count)
        sizes = [ctypes.sizeof(kind) for kind in kinds]
        expected = [loaded.lptn_mpc_sizes(number) for number in range(4)]
        if sizes != expected[:3]:
            raise RuntimeError(f"structs of {sizes} bytes in Python, {expected[:3]} in C")
        self._settings = kinds.settings()
        self._fill(self._settings)
        self._state, self._result = kinds.state(), kinds.result()
        self._work = ctypes.create_string_buffer(int(expected[3]) + 64)
        self._measured, self._request = np.empty(len(model.nodes)), np.empty((count, len(self.joints)))
        self._conditions, self._applied = np.empty((count, max(1, len(self.conditions)))), np.empty(len(self.joints))
        if not self.conditions:
            self._conditions = np.empty((count, 0))

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
        _fill(self._request, request, self.joints, "request")
        _fill(self._conditions, conditions, self.conditions, "conditions")
        given = None
        if applied is not None:
            self._applied[:] = in_order(applied, self.joints, "applied", np.nan)
            given = self._applied.ctypes.data
        self._step(
            ctypes.byref(self._settings),
            ctypes.byref(self._state),
            self._work,
            ctypes.c_void_p(self._measured.ctypes.data),
            ctypes.c_void_p(self._request.ctypes.data),
            ctypes.c_void_p(self._conditions.ctypes.data),
            ctypes.c_void_p(given),
            ctypes.byref(self._result),
        )
        return Plan.of(self, self._result)

    def reset(self) -> None:
        """Forget estimate, bias and the last plan."""
        ctypes.memset(ctypes.byref(self._state), 0, ctypes.sizeof(self._state))

    @property
    def filled(self) -> ctypes.Structure:
        """The settings as the C step reads them."""
        return self._settings

    @property
    def estimate(self) -> dict[str, float]:
        """Estimated temperature of each state [degC]."""
        return dict(zip(self.model.states, self._state.x, strict=True))

    @property
    def bias(self) -> dict[str, float]:
        """Heat that the model lacks, as a rate of each node [K/s]."""
        return dict(zip(self.model.nodes, self._state.bias, strict=False))

    @property
    def gain(self) -> dict[str, float]:
        """Relative error found in the controlled heat of each node."""
        return dict(zip(self.model.nodes, self._state.gain, strict=False))

    def _fill(self, to: Any) -> None:
        told, model = self.settings, self.model
        to.stage[:] = told.stages.tolist()
        to.limit[:] = told.planned_limits.tolist()
        to.node[:] = [model.nodes.index(node) for node in told.limits]
        to.owner[:] = list(model.owners)
        to.weight[:], to.most[:], to.rate[:] = told.weights.tolist(), told.currents.tolist(), told.rates.tolist()
        to.p[:] = [*model.values.tolist(), 0.0]
        to.recovery = told.recovery
        to.linear, to.quadratic = told.prices
        to.noise, to.doubt[:], to.gain_doubt = told.noise, told.doubt.tolist(), told.model_error
        to.tolerance, to.iterations = told.tolerance, told.iterations


def requested_by(model: Model) -> Request:
    """What a model's log columns hold."""
    return "current" if any(column.startswith("current.") for column in model.inputs) else "torque"


def in_order(values: Values, names: Sequence[str], what: str, missing: float) -> FloatArray:
    """Values in the order of their names, `missing` for those left out.

    Raises:
        InputError: an unknown name, or a wrong number of values.
    """
    if isinstance(values, Mapping):
        unknown = set(values) - set(names)
        if unknown:
            raise InputError(what, sorted(unknown)[0], "an unknown name", f"one of {', '.join(names)}")
        return np.array([values.get(name, missing) for name in names], dtype=float)
    found = np.asarray(values, dtype=float)
    if found.shape != (len(names),):
        raise InputError(what, "values", f"shape {found.shape}", f"{len(names)} values: {', '.join(names)}")
    return found


def _fill(to: FloatArray, values: Values | FloatArray, names: Sequence[str], what: str) -> None:
    found = np.asarray(values, dtype=float) if not isinstance(values, Mapping) else None
    if found is not None and found.ndim == 2:
        if found.shape != to.shape:
            raise InputError(what, "values", f"shape {found.shape}", f"shape {to.shape}")
        to[:] = found
        return
    to[:] = in_order(values, names, what, np.nan)
