"""Two logs of one run with clocks of their own, `a.csv+b.csv`, joined by the onset of heating.

One log has the temperatures, the other what heats: a motor that warms says when its heat was switched on.
"""

from __future__ import annotations

import hashlib
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path

import numpy as np

from lptn.basics.arrays import FloatArray
from lptn.basics.errors import InputError
from lptn.logs.channels import Channels
from lptn.logs.clock import FEWEST_ROWS, check_time, in_order
from lptn.logs.columns import AMBIENT, ColumnSource, place_of, quantity_of
from lptn.logs.scatter import off_their_neighbours, white_noise
from lptn.logs.tables import Source, Table, column_sources, table_of_sources
from lptn.logs.units import suspect_unit

# --- Two logs made one table -----------------------------------------------------------------------

SECOND_TIME = "time.2"
"""What the second log's time column is mapped as."""
_HEAT = {"power": 1, "current": 2, "current_abs": 2, "torque": 2, "torque_abs": 2}  # exponent that makes it a heat
_APART = 5.0  # s, beyond which shifts that other columns give are worth a word


def join(
    path: Path, first: Table, second: Table, shift: float | None, columns: Mapping[str, ColumnSource]
) -> tuple[Table, dict[str, ColumnSource]]:
    """Join two logs, the second on the clock of the first; each keeps its own rate.

    Args:
        path: what the user wrote.
        first: one log.
        second: the other; where both have a column of one name, this one's is called `NAME:2`.
        shift: s to add to the second's clock; `None` to find it from the onset of heating.
        columns: where the quantities stand in either; `time.2` is the second's time.

    Returns:
        the table, whose time is in s, and the mapping without the time columns.

    Raises:
        InputError: a log has no usable time, or there is no onset of heating.
    """
    rest = {key: source for key, source in columns.items() if key not in {"time", SECOND_TIME}}
    time_key = {key: columns[key] for key in ("time",) if key in columns}
    one = _Timed(first, column_sources(first, time_key).get("time"), "time")
    own = columns.get(SECOND_TIME) or column_sources(second, time_key).get("time")
    other = _Timed(second, own, SECOND_TIME)
    seconds, note = shift, f"{second.path.name}: its clock set forward by {shift or 0:.6g} s, as given."
    if seconds is None:
        seconds, note = _aligned(path, one, other, rest)
    taken = set(first.names)
    renamed = {name: f"{name}:2" if name in taken else name for name in second.names if name != other.column}
    kept = [name for name in first.names if name not in {one.column, "time"}]
    notes = [note, *first.notes, *second.notes]
    doubled = [name for name, new in renamed.items() if new != name]
    if doubled:
        notes.append(f"{', '.join(doubled)}: in both files; the second's is called {renamed[doubled[0]]}.")

    def sources(wanted: Sequence[str]) -> list[Source]:
        mine = {name: name for name in wanted if name != "time" and name not in renamed.values()}
        others = {name: new for name, new in renamed.items() if new in wanted}
        return [one.columns(mine, 0.0), other.columns(others, seconds)]

    table = table_of_sources(
        path,
        ("time", *kept, *renamed.values()),
        sources,
        f"{first.kind} joined with {second.kind}",
        units={name: first.units[name] for name in kept if name in first.units}
        | {new: second.units[name] for name, new in renamed.items() if name in second.units},
        defaults=dict(second.defaults) | dict(first.defaults),
        notes=notes,
        digest=lambda: hashlib.sha256(f"{first.digest()} {second.digest()}".encode()).hexdigest(),
    )
    return table, rest


class _Timed:
    """A log with its times, s, and the rows that have one of their own."""

    def __init__(self, table: Table, source: ColumnSource | None, key: str) -> None:
        self.table = table
        if source is None or not set(source.columns) <= set(table.names):
            problem = f"no such column; the log has: {table.listing}"
            raise InputError(table.path, f"column {key}", problem, f"a line in [columns] / --map {key}=YOURNAME")
        self.column = source.columns[0]
        numbers = table.numbers(source.columns)
        time = source.values("time", numbers)
        for issue in suspect_unit(Channels({"time": time}, {"time": source}, numbers, table.units), "time"):
            if issue.certain:
                remedy = issue.remedy.replace('"time=', f'"{key}=').replace("write time =", f'write "{key}" =')
                raise InputError(table.path, f"column '{issue.column}'", issue.problem, remedy)
        order = in_order(time)
        order = np.arange(time.size) if order is None else order
        self.rows = order[check_time(table, key, source, time[order])[0]]
        self.time = time[self.rows]

    def columns(self, names: Mapping[str, str], shift: float) -> Source:
        """Times moved by a shift, (n,) s, and some columns under their new names, (n,) each."""
        numbers = self.table.numbers(names)
        return self.time + shift, {new: numbers[name][self.rows] for name, new in names.items()}

    def values(self, columns: Mapping[str, ColumnSource], quantities: Collection[str]) -> dict[str, FloatArray]:
        """The columns of some quantities that this log has, (n,) each; the air's temperature is none of a robot."""
        found = {
            key: source.values(key, self.table.numbers(source.columns))[self.rows]
            for key, source in column_sources(self.table, columns).items()
            if quantity_of(key) in quantities and key != AMBIENT and set(source.columns) <= set(self.table.names)
        }
        return {key: values for key, values in found.items() if np.isfinite(values).sum() > FEWEST_ROWS}


def _aligned(path: Path, one: _Timed, other: _Timed, columns: Mapping[str, ColumnSource]) -> tuple[float, str]:
    """The shift of the second log's clock, by each temperature that the heat in the other log explains; and a note."""
    for warm, hot in ((one, other), (other, one)):
        temperatures, inputs = warm.values(columns, {"temperature"}), hot.values(columns, _HEAT)
        if temperatures and inputs:
            break
    else:
        problem = "no temperature in one of the logs, or no torque, current or power in the other"
        raise InputError(path, "join", problem, f"lines in [columns] for them, or the shift: {path}@SECONDS")
    heats = {key: np.abs(values) ** _HEAT[quantity_of(key)] for key, values in inputs.items()}
    kind = next(quantity for quantity in _HEAT if any(key.startswith(f"{quantity}.") for key in heats))
    total = np.sum([np.nan_to_num(values) for key, values in heats.items() if key.startswith(f"{kind}.")], axis=0)
    shifts, reasons = dict[str, tuple[float, float]](), list[str]()
    for key, readings in temperatures.items():
        own = next((name for quantity in _HEAT if (name := f"{quantity}.{place_of(key)}") in heats), "")
        heat = heats.get(own, total)
        read, fed = np.isfinite(readings), np.isfinite(heat)
        try:
            shift, error = shift_of(warm.time[read], readings[read], hot.time[fed], heat[fed])
            shifts[f"{key} against {own or f'all {kind}s'}"] = shift if warm is one else -shift, error
        except NoOnsetError as reason:
            reasons.append(str(reason))
    if not shifts:
        expected = f"logs that begin before the heating does, or the shift: {path}@SECONDS"
        raise InputError(path, "join", f"no onset of heating to align on ({reasons[0]})", expected)
    best = min(shifts, key=lambda name: shifts[name][1])
    seconds, error = shifts[best]
    note = f"{other.table.path.name}: its clock set forward by {seconds:.2f} ± {error:.2g} s, so that the onset of "
    note += f"heating fits ({best}); a sensor's own lag is in it."
    apart = [f"{name} {shift:.1f} s" for name, (shift, _) in shifts.items() if abs(shift - seconds) > _APART]
    return seconds, note + f" Others say otherwise: {', '.join(apart)}." * bool(apart)


# --- The shift between two clocks, from the onset of heating: heat in one log, what it warms in the other ---

# When the heat begins, in shares of its high level, its 95th percentile.
_EARLY = 2.0  # s, of the heat's log
_REST = 0.25  # the mean heat in the first seconds of a log that begins before the heating does
_LOW = 0.2  # above, a controller that logs from its start on is no longer at rest
_ON = 0.3  # above, the heat is on
_CLEAR = 1.25  # times the most before, what the heat then stays above, for 2.5 times the early seconds

# Which of the temperature's readings the heat is fitted to.
_RISE = 8.0  # K: the first of the rise, before what else is warm matters
_SHARE = 0.35  # of the whole rise, where that is less
_FEWEST = 12  # readings
_LEAST_RISE = 1.0  # K
_LEAST_RISE_OVER_NOISE = 10.0
_CLEAR_OF_NOISE = 5.0  # times the noise, by which a reading is above the rest

# The shift of least cost.
_COARSE, _FINE, _REFINEMENTS = 800, 41, 3  # shifts tried at first, and between the neighbours of the best, so often
_MISFIT = 0.1  # of the temperature's scatter: the heat does not explain it if more is left
_WIDTH = 9.0  # rise of the cost, in its own scatter, at three standard errors
_LARGEST_ERROR = 10.0  # s, standard error beyond which the shift is left open


class NoOnsetError(ValueError):
    """There is no onset of heating to align on; its text says why."""


def shift_of(
    warm_time: FloatArray, temperature: FloatArray, heat_time: FloatArray, heat: FloatArray
) -> tuple[float, float]:
    """The shift at which the first kelvins of a rise follow from the heat that was put in by then, and its error [s].

    .. math:: T(t) = T_0 + k E(t - s) - m \\int E(t - s)

    with E the heat put in so far; the last term is what is lost already. Cost is the sum of squares over the rise's
    first 8 K, and s that at which it is least.

    Args:
        warm_time: (n,) s, increasing, by the temperature's clock.
        temperature: (n,) degC.
        heat_time: (m,) s, increasing, by the heat's clock.
        heat: (m,) in proportion to the heat, held from sample to sample.

    Raises:
        NoOnsetError: heating begins before one of the logs does, or nothing warms, or the shift is left open.
    """
    from scipy.optimize import nnls  # here, since most logs are one

    on = _begun(heat_time, heat)
    energy = np.concatenate(([0.0], np.cumsum(heat[:-1] * np.diff(heat_time))))
    lost = np.concatenate(([0.0], np.cumsum(0.5 * (energy[1:] + energy[:-1]) * np.diff(heat_time))))

    def fitted(share: float) -> tuple[float, float]:
        """The same from a share of the first rise."""
        window = _first_rise(temperature, share)
        time, readings = warm_time[:window], temperature[:window] - temperature[:window].mean()

        def cost(shift: float) -> float:
            own = time - shift
            # Behind the log's last row the energy stays.
            gone = np.interp(own, heat_time, lost) + energy[-1] * np.maximum(0.0, own - heat_time[-1])
            basis = np.column_stack([np.interp(own, heat_time, energy), -gone])  # what warms, and what cools
            basis -= basis.mean(axis=0)
            basis /= np.maximum(np.abs(basis).max(axis=0), np.finfo(float).tiny)
            return float(nnls(basis, readings)[1] ** 2)

        tried = np.linspace(time[0] - on, time[-1] - on, _COARSE)
        costs = np.array([cost(shift) for shift in tried])
        for _ in range(_REFINEMENTS):
            best = int(costs.argmin())
            more = np.linspace(tried[max(best - 2, 0)], tried[min(best + 2, tried.size - 1)], _FINE)
            order = np.argsort(np.concatenate([tried, more]))
            costs = np.concatenate([costs, [cost(shift) for shift in more]])[order]
            tried = np.concatenate([tried, more])[order]
        best, flat = int(costs.argmin()), float(np.sum(readings**2))
        if costs[best] > _MISFIT * flat:
            raise NoOnsetError("the temperature does not rise as the heat would have it")
        # What the equation leaves out correlates neighbouring errors; one a second, at most, counts as its own. Three
        # coefficients and the shift are fitted to them.
        count = max(3.0, min(float(readings.size), float(np.ptp(time))) - 4.0)
        inside = tried[costs <= max(costs[best], 1e-12 * flat) * (1 + _WIDTH / count)]
        if inside[0] <= tried[0] or inside[-1] >= tried[-1]:
            raise NoOnsetError("the temperature's log begins too late, or shows too little of the rise")
        spread = (inside[-1] - inside[0]) / 6  # from three standard errors below to three above
        # A stamp is uniform in its period.
        stamps = sum(float(np.median(np.diff(clock))) ** 2 / 12 for clock in (time, heat_time))
        if (error := float(np.sqrt(spread**2 + stamps))) > _LARGEST_ERROR:
            raise NoOnsetError(f"the rise is too gradual: the shift is known to ± {error:.2g} s only")
        return float(tried[best]), error

    seconds, error = fitted(1.0)
    try:
        # What the equation leaves out shows in how far half the rise says otherwise.
        error = float(np.hypot(error, fitted(0.5)[0] - seconds))
    except NoOnsetError:  # too noisy for half the rise
        error = 2 * error
    if error > _LARGEST_ERROR:
        raise NoOnsetError(f"the rise is too gradual: the shift is known to ± {error:.2g} s only")
    return seconds, error


def _begun(time: FloatArray, heat: FloatArray) -> float:
    """When heating begins [s]; refused where there is no heat, or it is on from the first row."""
    high = float(np.percentile(heat, 95))
    if not high > 0:
        raise NoOnsetError("no heat")
    early = heat[time <= time[0] + _EARLY]
    # A controller that logs from its start on has a few low rows; a swinging torque is low again and again.
    low = int((heat > _LOW * high).argmax())
    soon = heat[low:][time[low:] <= time[low] + 2.5 * _EARLY]
    starts = low > 0 and float(soon.min()) > _CLEAR * float(heat[:low].max())
    if float(early.mean()) > _REST * high and not starts:
        raise NoOnsetError("the heat is on from the first row")
    return float(time[int((heat > _ON * high).argmax())])


def _first_rise(temperature: FloatArray, share: float) -> int:
    """How many readings, from the first, hold the rest and a share of the first of the rise; refused without one."""
    smooth = np.convolve(temperature, np.ones(3) / 3, mode="valid")
    rest = float(np.median(temperature[:_FEWEST]))
    noise = white_noise(off_their_neighbours(np.arange(temperature.size, dtype=float), temperature))
    whole = float(smooth.max() - rest) if smooth.size else 0.0
    if whole < max(_LEAST_RISE, _LEAST_RISE_OVER_NOISE * noise):
        raise NoOnsetError("no temperature rises by 1 K and ten times its noise")
    reached = smooth > rest + max(share * min(_RISE, _SHARE * whole), _CLEAR_OF_NOISE * noise)
    return max(int(reached.argmax()) + 2, min(_FEWEST, temperature.size))
