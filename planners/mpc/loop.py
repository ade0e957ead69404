"""The controller in a robot's fast loop: a short update at every tick, the thermal problem once a control period."""

from __future__ import annotations

import ctypes
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any

import numpy as np

from lptn.basics.arrays import FloatArray
from lptn.basics.errors import InputError

from ..values import Values, in_order
from .controller import Plan, TorqueMPC, fill

_WAITING, _LATE, _OVER, _BLIND = 1, 2, 4, 8
_MEANING = {
    _LATE: "the thermal problem has had no answer for two control periods; the last plan goes on",
    _OVER: "nor for its whole horizon; nothing but floors is admitted",
    _BLIND: "a measured torque or current is missing, absurd or stands; the scaled request stands in for it",
}


class ControlLoop:
    """Scales for the torques or currents of a robot's fast loop, 1 kHz say.

    `update` sums squares of what is asked and done; once a control period `TorqueMPC` solves for the next one with
    their RMS values, and the scales are those of its plan. It is the C code of `lptn_loop.h`, which `TorqueMPC.emit`
    writes for a robot.

    Args:
        mpc: the controller; the loop is its only user from here on.
        tick: time between two updates [s].
        background: solve in a thread, so that no update waits; else the update at a period's end does it.

    Raises:
        InputError: a tick shorter than a microsecond, or longer than the controller's period.
    """

    def __init__(self, mpc: TorqueMPC, tick: float = 0.001, *, background: bool = False) -> None:
        period = float(mpc.settings.stages[0])
        shortest = 1e-6  # s; ticks are counted in 32 bits
        if not shortest <= tick <= period:
            expected = f"at least {shortest:g} s, at most {period:g} s"
            raise InputError(mpc.model.network.origin, "tick", f"{tick:g} s", expected)
        self.mpc, self.status = mpc, 0
        library: Any = mpc._library
        self._loop = ctypes.create_string_buffer(int(library.lptn_mpc_sizes(4)) + 64)
        library.lptn_loop_begin(ctypes.byref(mpc._settings), self._loop, ctypes.c_double(tick))
        self._c_update, self._c_think = library.lptn_loop_update, library.lptn_loop_think
        joints = len(mpc.joints)
        self._asked, self._applied, self._scale = np.empty(joints), np.empty(joints), np.ones(joints)
        self._temperatures, self._conditions = np.empty(len(mpc.model.nodes)), np.empty(max(1, len(mpc.conditions)))
        arrays = (self._asked, self._applied, self._temperatures, self._conditions, self._scale)
        self._pointers = [ctypes.c_void_p(array.ctypes.data) for array in arrays]
        self._ahead: list[FloatArray | None] = [None, None]
        self._pool = ThreadPoolExecutor(1, "thermal controller") if background else None
        self._solving: Future[None] | None = None
        self.plan: Plan | None = None
        """The last answer of the thermal problem, `None` before the first."""

    @property
    def scale(self) -> FloatArray:
        """Of the last tick, shape (joints,)."""
        return self._scale.copy()

    @property
    def given_up(self) -> tuple[str, ...]:
        """In words, what could not be had at the last tick, and by the last plan."""
        own = tuple(text for bit, text in _MEANING.items() if self.status & bit)
        return own + (self.plan.given_up if self.plan is not None else ())

    def update(
        self, asked: Values, temperatures: Values, conditions: Values = (), applied: Values | None = None
    ) -> FloatArray:
        """One tick.

        Args:
            asked: torque [N*m] or current [A] that each joint is asked for now, by name or in the order of
                `mpc.joints`.
            temperatures: readings [degC] by node, or in the order of `model.nodes`; NaN or left out where there is
                none. The last one of a control period counts.
            conditions: the model's other inputs now, by column or in the order of `mpc.conditions`; signed speeds
                will do.
            applied: what the drives measured, where they do.

        Returns:
            Factors for what is asked, 0 to 1, shape (joints,). The array is written over by the next update.

        Raises:
            InputError: an unknown name, or a wrong number of values. Numbers that are missing are no reason to raise.
        """
        mpc = self.mpc
        self._asked[:] = in_order(asked, mpc.joints, "asked", np.nan)
        self._temperatures[:] = in_order(temperatures, mpc.model.nodes, "temperatures", np.nan)
        self._conditions[: len(mpc.conditions)] = mpc.heating.conditions_from(conditions, self._asked)
        to_asked, to_applied, *others = self._pointers
        if applied is not None:
            self._applied[:] = in_order(applied, mpc.joints, "applied", np.nan)
        self.status = self._c_update(self._loop, to_asked, None if applied is None else to_applied, *others)
        if self.status & _WAITING:
            if self._pool is None:
                self._think()
            elif self._solving is None or self._solving.done():
                self._solving = self._pool.submit(self._think)
        return self._scale

    def foresee(
        self, request: Values | FloatArray | None = None, conditions: Values | FloatArray | None = None
    ) -> None:
        """Say what is known of the coming stages, `mpc.settings.stages` long from the next control period on.

        It counts in each period until it is said anew: say it once a period where it changes with time.

        Args:
            request: RMS torque or current of each stage, shape (stages, joints), or by name or in order for all stages.
            conditions: means of the model's other inputs over each stage, shape (stages, conditions), or by column or
                in order.

        What is `None`, left out by name or NaN is as over the last period, measured anew each time.

        Raises:
            InputError: an unknown name, or a wrong number of values.
        """
        ahead: list[FloatArray | None] = [None, None]
        known = (request, self.mpc.joints, "request"), (conditions, self.mpc.conditions, "conditions")
        for number, (values, names, what) in enumerate(known):
            if values is not None:
                ahead[number] = rows = np.empty((len(self.mpc.settings.stages), len(names)))
                fill(rows, values, names, what)
        self._ahead = ahead  # at once, for the solver may run in its thread

    def close(self) -> None:
        """End the thread, if there is one."""
        if self._pool is not None:
            self._pool.shutdown()

    def _think(self) -> None:
        mpc, ahead = self.mpc, self._ahead
        known = [None if rows is None else rows.ctypes for rows in ahead]
        settings, state, result = map(ctypes.byref, (mpc._settings, mpc._state, mpc._result))
        if self._c_think(settings, self._loop, state, mpc._work, *known, result):
            self.plan = mpc._answer()
