"""`kind = "firmware"` for `lptn plan`: numbers for the simple limiters of drives, safe for whatever they admit.

Two limiters: i²t, which knows no temperature and is safe alone, and a trip with warning and restart on one sensor, safe
in place of a joint's own i²t, beside that of the other joints.
`worst_case` has the bounds that they stand on.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from math import inf, isfinite
from pathlib import Path
from typing import TYPE_CHECKING

import casadi as ca
import numpy as np
import pandas as pd
from scipy.integrate import solve_ivp
from scipy.special import ndtri
from scipy.stats import qmc

from lptn.basics.arrays import FloatArray, IntArray
from lptn.basics.errors import InputError
from lptn.basics.files import write_folder

from ..compiled import c_files
from ..tasks import Kind
from ..values import LONGEST
from .firmware_file import FirmwareFile, FirmwareTask
from .worst_case import (
    SHARES,
    Responses,
    accumulated,
    constant_squares,
    delayed,
    excess,
    responses,
    shared_thresholds,
    time_constant,
)  # fmt: skip

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_COLDER = 5.0  # K below the coldest air, or its sensor's error: no motor is as cold, and a broken thermistor reads so
_ROUNDS = 6  # in which the temperatures of places without a limit settle, to a hundredth of a kelvin
_DRAWS = 64  # of the parameters; the 95 % that are safe are known to 3 %
_UNITS = {
    "peak": "A", "time_constant": "s", "threshold": "A^2", "continuous": "A", "peak_time": "s", "kept": "1",
    "sensor": "", "warning": "degC", "trip": "degC", "restart": "degC", "hysteresis": "K", "rest": "s",
}  # fmt: skip
_SHORT = {"time_constant": "tau [s]", "continuous": "cont. [A]", "peak_time": "peak [s]", "kept": "kept",
          "warning": "warn [C]", "trip": "trip [C]", "restart": "start [C]"}  # fmt: skip


@dataclass(frozen=True)
class FirmwareAnswer:
    """What is typed into the drives.

    Args:
        task: what it is for.
        numbers: a row a joint. Of i²t: peak current, time constant, threshold and its root, for how long the peak
            current is given from rest, and how much of the constant current that the model would bear from rest, the
            others at their thresholds, is kept at the duration with the least. Of the sensor: warning, trip, restart,
            their difference, and the longest rest between both of a drive that has i²t, too; NaN where no trip
            protects alone at the peak current, or no restart leaves the burst.
        curves: by joint durations [s], the constant current that i²t admits for them from rest, and the largest that
            the model bears [A], shape (3, n).
        margin: K that the standard errors cost the place that they cost most; NaN where the model file has none.
    """

    task: FirmwareTask
    numbers: pd.DataFrame
    curves: dict[str, FloatArray]
    margin: float

    def table(self) -> pd.DataFrame:
        """A row a joint."""
        heads = {key: f"{key} [{unit}]" for key, unit in _UNITS.items() if unit}
        return self.numbers.rename(columns=heads).rename_axis("joint").reset_index()

    def figure(self) -> Figure:
        """Constant current from rest over its duration: of i²t, and dashed what the model bears."""
        from lptn.basics.style import SMALL, dress, new_figure, plain

        figure = new_figure(3.2)
        ax = figure.subplots()
        for joint, (t, admitted, most) in self.curves.items():
            (line,) = ax.semilogx(t, admitted, label=plain(joint))
            ax.semilogx(t, most, "--", color=line.get_color(), linewidth=0.8)
        ax.set_ylim(0, None)
        ax.set_xlabel("duration from rest [s]", size=SMALL)
        ax.set_ylabel("current [A]; dashed: what the model bears", size=SMALL)
        figure.legend(loc="outside upper center", ncols=6, fontsize=SMALL, frameon=False)
        dress(ax)
        return figure

    def as_json(self) -> dict[str, object]:
        """By joint; null where there is no such number."""
        table = self.task.table
        return {"kind": "firmware", "name": table.name, "air": table.air, "level": table.level, "margin": self.margin,
                "joints": self.numbers.to_dict("index")}  # fmt: skip

    def text(self) -> str:
        """What does not protect, the numbers, the margin."""
        trip, restart = self.numbers["trip"], self.numbers["restart"]
        missing = {
            "trip": (
                trip.isna(),
                "no reading protects at the peak current: the sensor is too late or too far off, or "
                "no limited node is the joint's own; i2t protects",
            ),
            "restart": (trip.notna() & restart.isna(), "in the hottest air no reading leaves the burst"),
        }
        lines = [f"No {what} of {', '.join(self.numbers.index[rows])}: {why}."
                 for what, (rows, why) in missing.items() if rows.any()]  # fmt: skip
        shown = self.numbers.drop(columns=["threshold", "hysteresis"]).rename(columns=_SHORT | {"peak": "peak [A]"})
        numbers = shown.rename(columns={"rest": "rest [s]"}).to_string(na_rep="none", float_format="%.3g")
        if not isfinite(self.margin):
            return "\n".join(
                ["Safe for these parameters alone: the model has no standard errors, give a margin.", *lines, numbers]
            )
        return "\n".join([*lines, numbers, f"{self.margin:.3g} K are kept for the model's standard errors."])


class _Limits:
    """Bounds of one task: `hot` the hottest states [degC], `constants` and `squares` of i²t [s, A²]."""

    def __init__(self, task: FirmwareTask) -> None:
        self.task, self.model, self.joints = task, task.heating.model, task.heating.joints
        self.limited = np.flatnonzero(np.isfinite(task.limits))
        self.hot = np.minimum(task.limits, task.limits[self.limited].max())
        self.squares, self.constants = task.nominal / 2, np.ones(len(self.joints))
        at = self.at(self.model.values)
        for number, joint in enumerate(self.joints):
            self.constants[number], self.squares[number] = time_constant(
                at.t, at.heated[:, self.limited, number], self.room(at), task.peak[number], task.constants.get(joint)
            )
        self.squares = alone = np.minimum(self.squares, task.nominal)
        for _ in range(_ROUNDS):
            at = self.at(self.model.values)
            p, q = self.accumulated(at)
            self.squares = shared_thresholds(p[self.limited], q[self.limited], self.room(at), alone, task.nominal)
            worst = at.rest + p @ self.squares + q.sum(axis=1)
            self.hot = np.where(np.isfinite(task.limits), task.limits, worst)

    def at(self, p: FloatArray, end: int = 1) -> Responses:
        """Responses at parameters, in the coldest or the hottest air."""
        return responses(self.task.heating, p, self.task.ends[end], self.hot, self.squares)

    def room(self, at: Responses) -> FloatArray:
        """How far each limited place may rise [K].

        Raises:
            InputError: not at all.
        """
        room = np.asarray((self.task.limits - at.rest)[self.limited])
        if room.min() <= 0:
            place = self.limited[int(room.argmin())]
            found = f"{self.task.limits[place]:.6g} degC, less the margin"
            expected = f"more than the {self.idle[place]:.6g} degC that it has without any current in the hottest air"
            raise InputError(self.task.origin, f"limits.{self.model.places[place]}", found, expected)
        return room

    def accumulated(self, at: Responses, rows: slice | IntArray = slice(None)) -> tuple[FloatArray, FloatArray]:
        """P and V Q of states by the joints, shape (rows, joints), at the bursts that are best at the squares."""
        p, q = accumulated(at.t, at.heated[:, rows], self.constants)
        q *= self.task.peak
        best = np.argmin(p * self.squares + q, axis=0)[None]
        return np.take_along_axis(p, best, 0)[0], np.take_along_axis(q, best, 0)[0]

    def share(self, p: FloatArray) -> float:
        """Which share of the thresholds is safe at other parameters."""
        at = self.at(p)
        by_square, fixed = self.accumulated(at, self.limited)
        room = (self.task.limits - at.rest)[self.limited] - fixed.sum(axis=1)
        return float((room / np.maximum(by_square @ self.squares, 1e-30)).min())

    @cached_property
    def idle(self) -> FloatArray:
        """States without any current in the hottest air [degC], by Newton's method from above."""
        x, none = self.hot, np.zeros(len(self.joints))
        for _ in range(_ROUNDS):
            x = responses(self.task.heating, self.model.values, self.task.ends[1], x, none).rest
        return np.asarray(x)

    @cached_property
    def _read(self) -> ca.Function:
        x, _, p, _, y = self.model.symbols
        return ca.Function("read", [x, p], [y, ca.jacobian(y, x)])

    def readings_at(self, x: FloatArray) -> FloatArray:
        """Of the joints' sensors [degC]."""
        readings = np.asarray(self._read(x, self.model.values)[0].full(), dtype=float)
        return np.asarray(readings[self.task.sensors, 0])

    def sensed(self, at: Responses, p: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Responses of states, and of the joints' readings, times the largest inputs; these readings at rest [degC]."""
        rest, slope = (np.asarray(value.full())[self.task.sensors] for value in self._read(at.rest, p))
        states = np.concatenate([at.heated * self.task.peak, at.missing], axis=2)
        return states, np.einsum("ij,njk->nik", slope, states), rest.ravel()

    def readings(self, p: FloatArray) -> FloatArray:
        """Trip, warning and restart [degC] of each joint, in the air for which they are lowest, shape (3, joints).

        Up to its trip a joint's own heat is bounded by its reading, which others only raise; theirs by their i²t.
        """
        table, count, ends = self.task.table, len(self.joints), []
        for end in (0, 1):
            at = self.at(p, end)
            states, reads, rest = self.sensed(at, p)
            by_square, fixed = self.accumulated(at, self.limited)
            # A place is kept by the sensor of the joint whose heat it feels most.
            owner = states[:, self.limited, :count].max(axis=0).argmax(axis=1)
            rises = np.full((3, count), np.nan)
            for joint in range(count):
                k, own = delayed(at.t, reads[:, joint], table.delay), [joint, *range(count, states.shape[2])]
                for owned_by, place, of_squares, of_bursts in zip(owner, self.limited, by_square, fixed, strict=True):
                    if owned_by != joint:
                        continue
                    of_others = of_squares * self.squares + of_bursts
                    over = excess(at.t, states[:, place, own], k[:, own]) + np.delete(of_others, joint).sum()
                    trip = ((self.task.limits[place] - at.rest[place] - over) / SHARES).max()
                    rises[0, joint] = np.nanmin([rises[0, joint], trip, self.task.limits[place] - rest[joint]])
                for row, seconds in ((1, table.warning), (2, table.burst)):
                    over = excess(at.t, k, delayed(at.t, k, seconds))
                    rises[row, joint] = min(rises[0, joint], ((rises[0, joint] - over) / SHARES).max())
            ends.append(rest + rises)
        return np.asarray(np.min(ends, axis=0) - table.sensor_error)

    def rest(self, joint: int, restart: float) -> float:
        """From all limits at once to the restart without any current, in the hottest air [s]."""
        rates, given = self.task.heating.rate_function(), (self.task.ends[1], self.model.values)

        def cooling(_: float, x: FloatArray) -> FloatArray:
            return np.asarray(rates(x, np.zeros(len(self.joints)), *given).full()).ravel()

        t = np.concatenate([[0.0], np.geomspace(0.1, LONGEST, 1000)])
        course = solve_ivp(cooling, (0.0, LONGEST), self.hot, method="LSODA", t_eval=t)
        below = [float(self.readings_at(x)[joint]) <= restart for x in course.y.T]
        return float(t[below.index(True)]) if any(below) else inf


@lru_cache(1)  # both the answer and the C code ask for it
def solved(task: FirmwareTask) -> FirmwareAnswer:
    """The numbers of all joints, safe with the task's level of the parameters within their standard errors."""
    limits, table = _Limits(task), task.table
    model = limits.model
    values, safe = model.values, 1 - table.level
    errors = np.array([model.standard_errors.get(parameter.name, 0.0) for parameter in model.parameters])
    unsure = np.flatnonzero(errors)
    drawn = np.tile(values, (_DRAWS if len(unsure) else 1, 1))
    if len(unsure):  # what has a sign keeps it: lognormal, with the value as the median
        normal, size = ndtri(qmc.Sobol(len(unsure), seed=1).random(_DRAWS)), np.abs(values[unsure])
        scaled = values[unsure] * np.exp(normal * np.sqrt(np.log1p((errors[unsure] / np.maximum(size, 1e-12)) ** 2)))
        drawn[:, unsure] = np.where(size > 0, scaled, normal * errors[unsure])
    kept = min(1.0, max(0.0, float(np.quantile([limits.share(p) for p in drawn], safe))))
    if kept == 0.0:
        found = "no current that is safe within the model file's standard errors"
        raise InputError(task.origin, "task.level", found, "a lower one, or a model that is fitted better")
    tripped = np.array([limits.readings(p) for p in drawn])
    trip = np.quantile(tripped[:, 0], safe, axis=0)
    gaps = np.quantile(tripped[:, :1] - tripped[:, 1:], table.level, axis=0)
    at = limits.at(values)
    idle, room = limits.readings_at(limits.idle), limits.room(at)
    rows, curves = {}, {}
    for number, joint in enumerate(limits.joints):
        tau, theta, most = limits.constants[number], kept * limits.squares[number], task.peak[number]
        admitted = np.sqrt(np.minimum(most, theta / -np.expm1(-at.t[1:] / tau)))
        others = np.where(np.arange(len(limits.joints)) == number, 0.0, kept * limits.squares)
        bears = np.sqrt(constant_squares(at.t, at.heated[:, limits.limited], number, others, room, most))
        curves[joint] = np.array([at.t[1:], admitted, bears])
        trips = trip[number] if trip[number] > idle[number] else np.nan
        warning, restart = trips - gaps[:, number]
        restart = restart if restart > idle[number] else np.nan
        cells = (
            np.sqrt(most), tau, theta, np.sqrt(theta), -tau * np.log1p(-theta / most) if theta < most else inf,
            (admitted / bears).min(), model.nodes[task.sensors[number]], warning, trips, restart, trips - restart,
            limits.rest(number, restart) if isfinite(restart) else np.nan,
        )  # fmt: skip
        rows[joint] = dict(zip(_UNITS, (cell if isinstance(cell, str) else float(cell) for cell in cells), strict=True))
    margin = float(np.max(room * (1 - kept))) if len(unsure) else np.nan
    return FirmwareAnswer(task, pd.DataFrame.from_dict(rows, orient="index"), curves, margin)


def _emit(task: FirmwareTask, folder: Path) -> list[Path]:
    """The limiters as C files for a drive: a row of numbers a joint."""
    columns = ["peak", "time_constant", "threshold", "warning", "trip", "restart"]
    numbers = solved(task).numbers
    rows = [
        f"    {{{', '.join(repr(value) if isfinite(value) else '-HUGE_VAL' for value in row)}}}, /* {joint} */"
        for joint, row in zip(numbers.index, numbers[columns].to_numpy(dtype=float).tolist(), strict=True)
    ]
    coldest = min(task.table.air) - max(_COLDER, task.table.sensor_error)
    return write_folder(folder, {
        **c_files("limiter", ("drive.h", "drive.c")),
        "drive_numbers.h": "\n".join([
            "/* By joint: peak current [A], time constant [s] and threshold [A^2] of i2t; warning, trip and",
            " * restart [degC]. Without a trip (-HUGE_VAL) no reading is looked at; without a restart the drive",
            " * rests until it is started anew. */",
            "static const lptn_drive_number lptn_drive_numbers[] = {", *rows, "};", "",
            "/* degC: no reading of a sound sensor is below. */",
            f"static const double lptn_drive_coldest = {coldest!r};",
            "",
        ]),
    })  # fmt: skip


firmware_kind = Kind(FirmwareFile, FirmwareTask, solved, _emit, "the drives' limiters in C")
