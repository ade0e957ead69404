"""The shift between two clocks, from the onset of heating: heat in one log, what it warms in the other."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lptn.arrays import FloatArray

_RISE = 8.0  # K: the first of the rise, before what else is warm matters
_SHARE = 0.35  # of the whole rise, where that is less
_FEWEST = 12  # readings in the window
_EARLY = 2.0  # s
_REST, _ON, _LOW = (
    0.25,
    0.3,
    0.2,
)  # shares of the high level of heat: below, at the beginning, it is rest; above it is on
_WIDTH = 9.0  # rise of the cost, in its own scatter, at three standard errors
_MOST = 10.0  # s, standard error beyond which nothing is known
_COARSE = 800  # shifts tried at first


class NoOnsetError(ValueError):
    """There is no onset of heating to align on; its text says why."""


@dataclass(frozen=True)
class Shift:
    """What to add to the heat's clock to have the temperature's, with its standard error, s."""

    seconds: float
    error: float


def shift_of(warm_time: FloatArray, temperature: FloatArray, heat_time: FloatArray, heat: FloatArray) -> Shift:
    """The shift at which the first kelvins of a rise follow from the heat that was put in by then.

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
    on = _begun(heat_time, heat)
    found = _fitted(on, warm_time, temperature, heat_time, heat, 1.0)
    try:
        half = _fitted(on, warm_time, temperature, heat_time, heat, 0.5)
    except NoOnsetError:  # too noisy for half the rise
        return Shift(found.seconds, 2 * found.error)
    # What the equation leaves out shows in how far half the rise says otherwise.
    return Shift(found.seconds, float(np.hypot(found.error, half.seconds - found.seconds)))


def _fitted(
    on: float, warm_time: FloatArray, temperature: FloatArray, heat_time: FloatArray, heat: FloatArray, share: float
) -> Shift:
    """The shift from a share of the first rise."""
    window = _first_rise(temperature, share)
    time, readings = warm_time[:window], temperature[:window]
    energy = np.concatenate(([0.0], np.cumsum(heat[:-1] * np.diff(heat_time))))
    lost = np.concatenate(([0.0], np.cumsum(0.5 * (energy[1:] + energy[:-1]) * np.diff(heat_time))))

    def cost(shift: float) -> float:
        own = time - shift
        put_in = np.interp(own, heat_time, energy)
        # Behind the log's last row the energy stays.
        gone = np.interp(own, heat_time, lost) + energy[-1] * np.maximum(0.0, own - heat_time[-1])
        return _residual(readings, put_in, gone)

    tried = np.linspace(time[0] - on, time[-1] - on, _COARSE)
    costs = np.array([cost(shift) for shift in tried])
    for _ in range(3):
        best = int(costs.argmin())
        low, high = tried[max(best - 2, 0)], tried[min(best + 2, tried.size - 1)]
        more = np.linspace(low, high, 41)
        order = np.argsort(np.concatenate([tried, more]))
        costs = np.concatenate([costs, [cost(shift) for shift in more]])[order]
        tried = np.concatenate([tried, more])[order]
    return _judged(tried, costs, readings, time, heat_time)


def _judged(
    tried: FloatArray, costs: FloatArray, readings: FloatArray, time: FloatArray, heat_time: FloatArray
) -> Shift:
    """The shift of least cost and how far it may be off, if that can be said."""
    best = int(costs.argmin())
    flat = float(np.sum((readings - readings.mean()) ** 2))
    if costs[best] > 0.1 * flat:
        raise NoOnsetError("the temperature does not rise as the heat would have it")
    # Model error makes neighbouring residuals alike; one a second, at most, counts as its own.
    count = max(3.0, min(float(readings.size), float(time[-1] - time[0])) - 4.0)
    floor = max(costs[best], 1e-12 * flat)
    inside = tried[costs <= floor * (1 + _WIDTH / count)]
    if inside[0] <= tried[0] or inside[-1] >= tried[-1]:
        raise NoOnsetError("the temperature's log begins too late, or shows too little of the rise")
    spread = (inside[-1] - inside[0]) / 6
    periods = (float(np.median(np.diff(each))) for each in (time, heat_time))
    error = float(np.sqrt(spread**2 + sum(period**2 / 12 for period in periods)))
    if error > _MOST:
        raise NoOnsetError(f"the rise is too gradual: the shift is known to ± {error:.2g} s only")
    return Shift(float(tried[best]), error)


def _residual(readings: FloatArray, put_in: FloatArray, gone: FloatArray) -> float:
    """Sum of squares that a level, the heat put in and what is lost of it leave; of the level alone if heat cools."""
    basis = [np.ones_like(readings), put_in, gone]
    scales = [float(np.abs(column).max()) or 1.0 for column in basis]
    scaled = np.column_stack([column / scale for column, scale in zip(basis, scales, strict=True)])
    for columns in (3, 2):
        matrix = scaled[:, :columns]
        found = np.linalg.lstsq(matrix, readings, rcond=None)[0]
        if found[1] > 0 and (columns == 2 or found[2] <= 0):
            return float(np.sum((readings - matrix @ found) ** 2))
    return float(np.sum((readings - readings.mean()) ** 2))


def _begun(time: FloatArray, heat: FloatArray) -> float:
    """When heating begins, s.

    Raises:
        NoOnsetError: there is no heat, or it is on from the first row.
    """
    high = float(np.percentile(heat, 95))
    if not high > 0:
        raise NoOnsetError("no heat")
    early = heat[time <= time[0] + _EARLY]
    # A controller that logs from its start on has a few low rows; a swinging torque is low again and again.
    low = int((heat > _LOW * high).argmax())
    soon = heat[low:][time[low:] <= time[low] + 2.5 * _EARLY]
    starts = low > 0 and float(soon.min()) > 1.25 * float(heat[:low].max())
    if float(early.mean()) > _REST * high and not starts:
        raise NoOnsetError("the heat is on from the first row")
    return float(time[int((heat > _ON * high).argmax())])


def _first_rise(temperature: FloatArray, share: float) -> int:
    """How many readings, from the first, hold the rest and a share of the first of the rise.

    Raises:
        NoOnsetError: nothing rises.
    """
    smooth = np.convolve(temperature, np.ones(3) / 3, mode="valid")
    rest = float(np.median(temperature[:_FEWEST]))
    noise = 1.4826 * float(np.median(np.abs(np.diff(temperature, 2)))) / np.sqrt(6.0) if temperature.size > 3 else 0.0
    whole = float(smooth.max() - rest) if smooth.size else 0.0
    if whole < max(1.0, 10 * noise):
        raise NoOnsetError("no temperature rises by 1 K and ten times its noise")
    reached = smooth > rest + max(share * min(_RISE, _SHARE * whole), 5 * noise)
    return max(int(reached.argmax()) + 2, min(_FEWEST, temperature.size))
