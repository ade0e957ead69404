"""Ways in which a healthy log goes wrong, each with the channel and the kind that a reader has to say.

A corruption changes a table as a logger, a sensor or a person does, after it was made. `expected` is the kind of
`lptn.logs.issue.Issue`, or `"refused"` where nothing can be read. What stands at `"*"` is said of the whole log.

    python -m tests.hardening.corruptions --seeds 4 5 6

prints for each kind how often it was found, on logs of a leg and of a quadruped with sensors of 0.1 and of 1 K steps;
with `--improve` what `lptn improve` then adds to an exact model of a leg whose logs are spoilt so, and how often
something false is said to be missing with half a probability or more: `--spoilt one` of two fitted logs, or `all`, and
what is held out as well.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from itertools import product
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import numpy.typing as npt
import pandas as pd

from lptn.basics.errors import InputError
from lptn.diagnose.answers import Step
from lptn.logs.issue import Issue
from lptn.logs.reading import read_log
from lptn.logs.run import Run
from lptn.robots.presets import presets
from lptn.study import Study
from lptn.virtual import leg_logs, quadruped_logs
from lptn.virtual.leg import draw_runs
from tests.truth.plans import trial

Log = pd.DataFrame
Rng = np.random.Generator


@dataclass(frozen=True)
class Corruption:
    """One way.

    Args:
        change: alters the log; gets it, the joint that is struck, and a generator of random numbers.
        key: of the channel that is to be named, with `{joint}`; `"time"`, or `"*"` for any.
        expected: kinds of which one is right.
        coarse: whether it shows on a sensor of 1 K steps, too.
        every: s, of a log with fewer rows than the virtual robots write; 0 for all of them.
    """

    change: Callable[[Log, str, Rng], None]
    key: str
    expected: tuple[str, ...]
    coarse: bool = True
    every: float = 0.0


def _seconds(log: Log) -> npt.NDArray[np.float64]:
    return np.asarray(log["time"] - log["time"].iloc[0], dtype=float)


def _stretch(log: Log, rng: Rng, length: float) -> npt.NDArray[np.bool_]:
    """A stretch somewhere in the log, not at its ends."""
    seconds = _seconds(log)
    start = rng.uniform(0.1, 0.9) * (seconds[-1] - length)
    return np.asarray((seconds >= start) & (seconds <= start + length))


def _frozen(key: str, length: float, more: float = 0.0) -> Callable[[Log, str, Rng], None]:
    def change(log: Log, joint: str, rng: Rng) -> None:
        rows, name = _stretch(log, rng, length), key.format(joint=joint)
        log.loc[rows, name] = log.loc[rows, name].iloc[0] + more

    return change


def _frozen_twice(log: Log, joint: str, rng: Rng) -> None:
    for _ in range(2):
        _frozen("temperature.{joint}", 420)(log, joint, rng)


def _frozen_from(share: float, until: float) -> Callable[[Log, str, Rng], None]:
    def change(log: Log, joint: str, _rng: Rng) -> None:
        seconds = _seconds(log)
        rows = (seconds >= share * seconds[-1]) & (seconds <= until * seconds[-1])
        log.loc[rows, f"temperature.{joint}"] = log.loc[rows, f"temperature.{joint}"].iloc[0]

    return change


def _stands_at(value: float, key: str = "temperature.{joint}", length: float = 900) -> Callable[[Log, str, Rng], None]:
    def change(log: Log, joint: str, rng: Rng) -> None:
        log.loc[_stretch(log, rng, length), key.format(joint=joint)] = value

    return change


def _ends_at(value: float) -> Callable[[Log, str, Rng], None]:
    def change(log: Log, joint: str, _rng: Rng) -> None:
        log.loc[_seconds(log) > 0.75 * _seconds(log)[-1], f"temperature.{joint}"] = value

    return change


def _begins_at(value: float) -> Callable[[Log, str, Rng], None]:
    def change(log: Log, joint: str, _rng: Rng) -> None:
        log.loc[_seconds(log) < 200, f"temperature.{joint}"] = value

    return change


def _now_and_then(value: float, share: float = 0.003) -> Callable[[Log, str, Rng], None]:
    def change(log: Log, joint: str, rng: Rng) -> None:
        log.loc[rng.random(len(log)) < share, f"temperature.{joint}"] = value

    return change


def _twice(value: float) -> Callable[[Log, str, Rng], None]:
    def change(log: Log, joint: str, rng: Rng) -> None:
        for row in rng.integers(100, len(log) - 100, 3):
            log.loc[row : row + 1, f"temperature.{joint}"] = value

    return change


def _without_air(change: Callable[[Log, str, Rng], None]) -> Callable[[Log, str, Rng], None]:
    def both(log: Log, joint: str, rng: Rng) -> None:
        del log["temperature.ambient"]
        change(log, joint, rng)

    return both


def _clamped(quantile: float, *, above: bool) -> Callable[[Log, str, Rng], None]:
    def change(log: Log, joint: str, _rng: Rng) -> None:
        name = f"temperature.{joint}"
        limit = np.round(log[name].quantile(quantile))
        log[name] = np.minimum(log[name], limit) if above else np.maximum(log[name], limit)

    return change


def _constant(log: Log, joint: str, _rng: Rng) -> None:
    log[f"temperature.{joint}"] = log[f"temperature.{joint}"].iloc[0]


def _duplicate(log: Log, joint: str, _rng: Rng) -> None:
    others = [name for name in map(str, log) if name.startswith("temperature.") and name != f"temperature.{joint}"]
    log[f"temperature.{joint}"] = log[others[0]]


def _spiky(size: float) -> Callable[[Log, str, Rng], None]:
    def change(log: Log, joint: str, rng: Rng) -> None:
        name, rows = f"temperature.{joint}", rng.choice(np.arange(5, len(log) - 5, 3), 12, replace=False)
        log.loc[rows, name] += np.round(size * rng.choice([-1.0, 1.0], rows.size) * rng.uniform(1, 1.5, rows.size))

    return change


def _scaled(key: str, scale: float, plus: float = 0.0) -> Callable[[Log, str, Rng], None]:
    def change(log: Log, joint: str, _rng: Rng) -> None:
        for name in (
            [key.format(joint=joint)] if key != "temperature.*" else [n for n in map(str, log) if n.startswith("temp")]
        ):
            log[name] = log[name] * scale + plus

    return change


def _counts(log: Log, joint: str, _rng: Rng) -> None:
    log[f"temperature.{joint}"] = np.round(4095 / 125 * log[f"temperature.{joint}"])


def _converted(quantity: str, full: float, per_torque: float) -> Callable[[Log, str, Rng], None]:
    """Counts of a converter of 12 bit, with zero in the middle of its range."""

    def change(log: Log, joint: str, _rng: Rng) -> None:
        values = log[f"torque.{joint}"] * per_torque
        log[f"{quantity}.{joint}"] = np.clip(np.round(2048 + 2048 / full * values), 0, 4095)

    return change


def _zero_throughout(log: Log, joint: str, _rng: Rng) -> None:
    log[f"torque.{joint}"] = 0.0


def _wrapping(log: Log, joint: str, _rng: Rng) -> None:
    log[f"temperature.{joint}"] = (np.round(log[f"temperature.{joint}"] * 2000)) % 65536


def _signed_byte(log: Log, joint: str, _rng: Rng) -> None:
    """Quarters of a degree, which a byte holds up to 31.75 degC."""
    log[f"temperature.{joint}"] = ((np.round(log[f"temperature.{joint}"] * 4) + 128) % 256 - 128) / 4


def _throughout(key: str, value: float) -> Callable[[Log, str, Rng], None]:
    def change(log: Log, joint: str, _rng: Rng) -> None:
        log[key.format(joint=joint)] = value

    return change


def _again_and_again(value: float) -> Callable[[Log, str, Rng], None]:
    def change(log: Log, joint: str, rng: Rng) -> None:
        for length in (400, 30, 150, 90, 20):
            _stands_at(value, length=length)(log, joint, rng)

    return change


def _renamed(old: str, new: str, scale: float = 1.0) -> Callable[[Log, str, Rng], None]:
    def change(log: Log, joint: str, _rng: Rng) -> None:
        log[new.format(joint=joint)] = log.pop(old.format(joint=joint)) * scale

    return change


def _single(key: str, value: float) -> Callable[[Log, str, Rng], None]:
    def change(log: Log, joint: str, rng: Rng) -> None:
        log.loc[int(rng.integers(100, len(log) - 100)), key.format(joint=joint)] = value

    return change


def _current(scale: float) -> Callable[[Log, str, Rng], None]:
    def change(log: Log, joint: str, _rng: Rng) -> None:
        log[f"current.{joint}"] = np.round(log[f"torque.{joint}"] * 2 * scale, 3)

    return change


def _time(scale: float, since: float = 0.0) -> Callable[[Log, str, Rng], None]:
    def change(log: Log, _joint: str, _rng: Rng) -> None:
        log["time"] = (log["time"] + since) * scale

    return change


def _swapped(log: Log, _joint: str, rng: Rng) -> None:
    row = int(rng.integers(100, len(log) - 100))
    log.loc[[row, row + 10], "time"] = log.loc[[row + 10, row], "time"].to_numpy()  # by a few, they would be sorted


def _clock_restarts(log: Log, _joint: str, _rng: Rng) -> None:
    half = len(log) // 2
    log.loc[log.index[half:], "time"] -= log["time"].iloc[half]


def _ambient_follows(log: Log, joint: str, _rng: Rng) -> None:
    air = log["temperature.ambient"]
    log["temperature.ambient"] = air + 0.3 * (log[f"temperature.{joint}"] - air)


# --- Channels that no machine has: sensors that come off, tables that stand, units that change on the way ------------


def _noisy(value: float, noise: float, length: float, times: int = 1) -> Callable[[Log, str, Rng], None]:
    """A broken wire or a short, with a noise of its own."""

    def change(log: Log, joint: str, rng: Rng) -> None:
        for _ in range(times):
            rows = _stretch(log, rng, length)
            log.loc[rows, f"temperature.{joint}"] = np.round(value + noise * rng.standard_normal(rows.sum()), 2)

    return change


def _leaves(target: float | None, constant: float, share: float = 0.6) -> Callable[[Log, str, Rng], None]:
    """A sensor that goes to a number, or to the air's temperature, as through a filter, and stays."""

    def change(log: Log, joint: str, rng: Rng) -> None:
        name, seconds = f"temperature.{joint}", _seconds(log)
        since = seconds - share * seconds[-1]
        rows = since >= 0
        end = log["temperature.ambient"][rows] if target is None else target
        weight = np.exp(-since[rows] / constant)
        start = log.loc[rows, name].iloc[0]
        log.loc[rows, name] = np.round(start * weight + end * (1 - weight) + rng.normal(0, 0.1, rows.sum()), 1)

    return change


def _settles(size: float, constant: float) -> Callable[[Log, str, Rng], None]:
    """A filter that begins elsewhere when the power comes on."""

    def change(log: Log, joint: str, _rng: Rng) -> None:
        log[f"temperature.{joint}"] += np.round(size * np.exp(-_seconds(log) / constant), 1)

    return change


def _from_the_middle(
    scale: float, low: float, high: float, keys: tuple[str, ...] = ("temperature.",)
) -> Callable[[Log, str, Rng], None]:
    """Numbers multiplied, and shifted by a size of each column's own, from some row on."""

    def change(log: Log, joint: str, rng: Rng) -> None:
        rows = _seconds(log) > rng.uniform(0.4, 0.7) * _seconds(log)[-1]
        for key in keys:
            for name in [name for name in map(str, log) if name.startswith(key.format(joint=joint))]:
                log.loc[rows, name] = np.round(log.loc[rows, name] * scale + rng.uniform(low, high), 1)

    return change


def _copied(log: Log, joint: str, rng: Rng) -> None:
    _duplicate(log, joint, rng)
    log[f"temperature.{joint}"] = np.round(log[f"temperature.{joint}"] + rng.normal(0, 0.1, len(log)), 2)


def _torque_of_another(log: Log, joint: str, _rng: Rng) -> None:
    others = [name for name in map(str, log) if name.startswith("torque.") and name != f"torque.{joint}"]
    log[f"torque.{joint}"] = log[others[-1]]


def _held(length: float, times: int) -> Callable[[Log, str, Rng], None]:
    """All columns but the clock stand: what the logger had last."""

    def change(log: Log, _joint: str, rng: Rng) -> None:
        names = [name for name in map(str, log) if name != "time"]
        for _ in range(times):
            rows = _stretch(log, rng, length)
            log.loc[rows, names] = log.loc[rows, names].iloc[0].to_numpy()

    return change


def _turning(share: float) -> Callable[[Log, str, Rng], None]:
    """A counter of 1/64 K whose range ends below the highest readings, and begins again at 0."""

    def change(log: Log, joint: str, _rng: Rng) -> None:
        values = log[f"temperature.{joint}"]
        turn = np.round(values.min() + share * (values.max() - values.min()))
        log[f"temperature.{joint}"] = np.round(values * 64) / 64 % turn

    return change


def _falls(value: float, length: float, every: float) -> Callable[[Log, str, Rng], None]:
    def change(log: Log, joint: str, _rng: Rng) -> None:
        log.loc[_seconds(log) % every > every - length, f"temperature.{joint}"] = value

    return change


def _bytes(offset: float, key: str = "temperature.{joint}") -> Callable[[Log, str, Rng], None]:
    """Whole numbers with an offset, of sensors but not of the air."""

    def change(log: Log, joint: str, _rng: Rng) -> None:
        for name in map(str, log):
            if name.startswith(key.format(joint=joint)) and name != "temperature.ambient":
                log[name] = np.round(log[name]) + offset

    return change


# --- Siblings of these: what firmware, buses, spreadsheets and people do to one column -------------------------------


def _lines(key: str, length: float) -> Callable[[Log, str, Rng], None]:
    """A gap that somebody filled in, of one column or of all."""

    def change(log: Log, joint: str, rng: Rng) -> None:
        names = [name for name in map(str, log) if name != "time" and key in ("*", name.replace(joint, "{joint}"))]
        rows = np.flatnonzero(_stretch(log, rng, length))
        for name in names:
            log.loc[rows, name] = np.interp(rows, rows[[0, -1]], log.loc[rows[[0, -1]], name])

    return change


def _bits(flip: float, always: int = 0) -> Callable[[Log, str, Rng], None]:
    """Sixteenths of a degree, of which some rows have a bit turned, or all have one set."""

    def change(log: Log, joint: str, rng: Rng) -> None:
        counts = np.array(np.round(log[f"temperature.{joint}"] * 16), dtype=np.int64) | always
        rows = np.flatnonzero(rng.random(counts.size) < flip)
        counts[rows] ^= 1 << rng.integers(5, 13, rows.size)
        log[f"temperature.{joint}"] = counts / 16

    return change


def _each(rows: int, more: float) -> Callable[[Log, str, Rng], None]:
    def change(log: Log, joint: str, _rng: Rng) -> None:
        log.loc[np.arange(len(log)) % rows == 7, f"temperature.{joint}"] += more

    return change


def _resets(log: Log, joint: str, rng: Rng) -> None:
    for row in rng.integers(200, len(log) - 200, 4):
        log.loc[row : row + int(rng.integers(1, 4)), f"temperature.{joint}"] = 85.0


def _with_torque(size: float) -> Callable[[Log, str, Rng], None]:
    """A voltage along a wire that the sensor shares with the motor."""

    def change(log: Log, joint: str, _rng: Rng) -> None:
        torque = log[f"torque.{joint}"].abs()
        log[f"temperature.{joint}"] = np.round(log[f"temperature.{joint}"] + size * torque / torque.quantile(0.95), 1)

    return change


def _pasted(length: float) -> Callable[[Log, str, Rng], None]:
    """A block of rows, but for their times, over the one behind it."""

    def change(log: Log, _joint: str, rng: Rng) -> None:
        rows = round(length / float(log["time"].iloc[1] - log["time"].iloc[0]))
        first, names = int(rng.integers(rows, len(log) - 3 * rows)), [name for name in map(str, log) if name != "time"]
        log.loc[first + rows : first + 2 * rows - 1, names] = log.loc[first : first + rows - 1, names].to_numpy()

    return change


def _sampled(every: float) -> Callable[[Log, str, Rng], None]:
    def change(log: Log, joint: str, _rng: Rng) -> None:
        log[f"torque.{joint}"] = log.groupby(np.floor(_seconds(log) / every))[f"torque.{joint}"].transform("first")

    return change


def _rolled(log: Log, joint: str, _rng: Rng) -> None:
    log[f"temperature.{joint}"] = np.roll(log[f"temperature.{joint}"].to_numpy(), len(log) // 3)


def _unsigned(key: str, scale: float, turn: float, plus: float = 0.0) -> Callable[[Log, str, Rng], None]:
    """Counts below 0 read as if they had no sign; `plus` makes them so."""

    def change(log: Log, joint: str, _rng: Rng) -> None:
        for name in [name for name in map(str, log) if name.startswith(key.format(joint=joint))]:
            log[name] = np.round((log[name] + plus) * scale) % turn / scale

    return change


def _air_of_a_motor(log: Log, joint: str, rng: Rng) -> None:
    log[_AIR] = np.round(log[f"temperature.{joint}"] - 2 + rng.normal(0, 0.2, len(log)), 1)


def _milliamperes(log: Log, joint: str, rng: Rng) -> None:
    _current(1.0)(log, joint, rng)
    log.loc[_seconds(log) > rng.uniform(0.4, 0.7) * _seconds(log)[-1], f"current.{joint}"] *= 1000


def _summer_ends(log: Log, _joint: str, rng: Rng) -> None:
    log.loc[_seconds(log) > rng.uniform(0.4, 0.7) * _seconds(log)[-1], "time"] -= 3600


_SENSOR, _TORQUE, _SPEED = "temperature.{joint}", "torque.{joint}", "velocity.{joint}"
_AIR = "temperature.ambient"
_STILL = ("frozen", "clamped")  # at an end of the range the one is the other
_UNIT = ("unit", "refused")
_OFF = ("disconnected", "dead", "code", "spike")  # no reading, for however long

CORRUPTIONS: dict[str, Corruption] = {
    "a sensor freezes for 20 min": Corruption(_frozen(_SENSOR, 1200), _SENSOR, _STILL, coarse=False),
    "a sensor freezes for 7 min": Corruption(_frozen(_SENSOR, 420), _SENSOR, _STILL, coarse=False),
    "a sensor freezes twice": Corruption(_frozen_twice, _SENSOR, _STILL, coarse=False),
    "a sensor wakes late": Corruption(_frozen_from(0.0, 0.4), _SENSOR, (*_STILL, "dead"), coarse=False),
    "a sensor freezes to the end": Corruption(_frozen_from(0.6, 1.0), _SENSOR, _STILL, coarse=False),
    "a sensor gives one number": Corruption(_constant, _SENSOR, _STILL),
    "a sensor gives 0 for 15 min": Corruption(_stands_at(0.0), _SENSOR, ("dead", "code")),
    "a sensor gives 0 to the end": Corruption(_ends_at(0.0), _SENSOR, ("dead", "code")),
    "a sensor begins at 0": Corruption(_begins_at(0.0), _SENSOR, ("dead", "code")),
    "a sensor gives full scale": Corruption(_stands_at(125.0), _SENSOR, ("dead", "code")),
    "a sensor gives full scale to the end": Corruption(_ends_at(125.0), _SENSOR, ("dead", "code")),
    "a sensor gives −40 for 15 min": Corruption(_stands_at(-40.0), _SENSOR, ("dead", "code")),
    "a code −127 now and then": Corruption(_now_and_then(-127.0), _SENSOR, ("code",)),
    "a code −127 in two readings in a row": Corruption(_twice(-127.0), _SENSOR, ("code",)),
    "a code 255 now and then": Corruption(_now_and_then(255.0), _SENSOR, ("code",)),
    "a code 85 at power-up": Corruption(_single(_SENSOR, 85.0), _SENSOR, ("code", "spike")),
    "a single 0": Corruption(_single(_SENSOR, 0.0), _SENSOR, ("code", "spike")),
    "firmware clamps the upper third": Corruption(_clamped(0.67, above=True), _SENSOR, _STILL, coarse=False),
    "firmware clamps the upper half": Corruption(_clamped(0.5, above=True), _SENSOR, _STILL, coarse=False),
    "firmware clamps below": Corruption(_clamped(0.5, above=False), _SENSOR, _STILL, coarse=False),
    "two columns of one sensor": Corruption(_duplicate, "*", ("duplicate",)),
    "spikes of 20 K": Corruption(_spiky(20.0), _SENSOR, ("spike", "code")),
    "spikes of 8 K": Corruption(_spiky(8.0), _SENSOR, ("spike",)),
    "kelvin": Corruption(_scaled("temperature.*", 1.0, 273.15), "*", _UNIT),
    "kelvin, and no column for the air": Corruption(_without_air(_scaled("temperature.*", 1.0, 273.15)), "*", _UNIT),
    "one sensor in kelvin": Corruption(_scaled(_SENSOR, 1.0, 273.15), _SENSOR, _UNIT),
    "Fahrenheit": Corruption(_scaled("temperature.*", 1.8, 32.0), "*", _UNIT),
    "Fahrenheit, and no column for the air": Corruption(_without_air(_scaled("temperature.*", 1.8, 32.0)), "*", _UNIT),
    "tenths of a degree": Corruption(_scaled(_SENSOR, 10.0), _SENSOR, _UNIT),
    "hundredths of a degree": Corruption(_scaled(_SENSOR, 100.0), _SENSOR, _UNIT),
    "thousandths of a degree": Corruption(_scaled(_SENSOR, 1000.0), _SENSOR, _UNIT),
    "counts of a 12 bit converter": Corruption(_counts, _SENSOR, _UNIT),
    "a counter of 16 bit that wraps": Corruption(_wrapping, _SENSOR, ("wrap", *_UNIT)),
    "the air's sensor gives 0": Corruption(
        _stands_at(0.0, "temperature.ambient"), "temperature.ambient", ("dead", "code")
    ),
    "the air in kelvin": Corruption(_scaled("temperature.ambient", 1.0, 273.15), "temperature.ambient", _UNIT),
    "the air in Fahrenheit": Corruption(_scaled("temperature.ambient", 1.8, 32.0), "temperature.ambient", _UNIT),
    "the air's sensor hangs at a motor": Corruption(_ambient_follows, "temperature.ambient", ("follows",)),
    "a torque freezes": Corruption(_frozen(_TORQUE, 900, 1.0), _TORQUE, _STILL),
    "a torque dies while the joint moves": Corruption(_stands_at(0.0, _TORQUE, 900), _TORQUE, ("frozen", "dead")),
    "one torque of 18,000 N·m": Corruption(_single(_TORQUE, 18_000.0), _TORQUE, ("size", "refused")),
    "torque in mN·m": Corruption(_scaled(_TORQUE, 1000.0), _TORQUE, ("size", *_UNIT)),
    "torque in mN·m, named so": Corruption(_renamed(_TORQUE, "torque.{joint}_mNm", 1000.0), "*", _UNIT),
    "a torque in counts of a converter": Corruption(_converted("torque", 60.0, 1.0), _TORQUE, ("counts",)),
    "a torque that nobody measures": Corruption(_zero_throughout, _TORQUE, ("frozen",)),
    "an infinite torque": Corruption(_single(_TORQUE, np.inf), _TORQUE, ("refused",)),
    "current in mA": Corruption(_current(1000.0), "current.{joint}", _UNIT),
    "a current in counts of a converter": Corruption(_converted("current", 100.0, 2.0), "current.{joint}", ("counts",)),
    # Of slow joints no number tells: at 86 times its speed a hip of 3 N·m still has a power that joints have.
    "speed in rpm of the motor": Corruption(_scaled(_SPEED, 30 / np.pi * 9), _SPEED, _UNIT),
    "a speed freezes": Corruption(_frozen(_SPEED, 900, 0.1), _SPEED, _STILL),
    "time in ms since 1970": Corruption(_time(1e3, 1.7e9), "time", _UNIT),
    "time in ns since 1970": Corruption(_time(1e9, 1.7e9), "time", _UNIT),
    "time in µs": Corruption(_time(1e6), "time", _UNIT),
    "two rows swapped": Corruption(_swapped, "time", ("refused",)),
    "the clock starts again": Corruption(_clock_restarts, "time", ("refused",)),
    "a code −1 now and then": Corruption(_now_and_then(-1.0, 0.02), _SENSOR, ("code",)),
    "a code 65535 now and then": Corruption(_now_and_then(65535.0, 0.02), _SENSOR, ("code",)),
    "a plug that comes loose, again and again": Corruption(_again_and_again(127.0), _SENSOR, ("dead",)),
    "a signed byte that wraps": Corruption(_signed_byte, _SENSOR, ("wrap",), coarse=False),
    "the air's sensor gives nothing but 0": Corruption(_throughout(_AIR, 0.0), _AIR, ("dead",)),
    "the air's sensor gives nothing but −127": Corruption(_throughout(_AIR, -127.0), _AIR, ("dead",)),
    "−300 degC once": Corruption(_single(_SENSOR, -300.0), _SENSOR, ("refused",)),
    "a thermistor opens, with noise": Corruption(_noisy(-94.6, 0.3, 700), _SENSOR, _OFF),
    "a Pt100 opens, with noise": Corruption(_noisy(850.0, 3.0, 400), _SENSOR, _OFF),
    "a Pt100 is shorted, with noise": Corruption(_noisy(-88.6, 2.0, 700), _SENSOR, _OFF),
    "a wire opens for 5 s, again and again": Corruption(_noisy(-94.6, 0.3, 5, 8), _SENSOR, _OFF),
    "a reference fails: 15 K for 300 s": Corruption(_noisy(15.0, 0.2, 300), _SENSOR, _OFF),
    "a thermistor opens slowly": Corruption(_leaves(-50.0, 20.0), _SENSOR, _OFF),
    "a filter begins 117 K above": Corruption(_settles(117.0, 20.0), _SENSOR, _OFF),
    "a filter begins 60 K below": Corruption(_settles(-60.0, 15.0), _SENSOR, _OFF),
    "a sensor comes loose, to the air's temperature": Corruption(_leaves(None, 100.0, 0.5), _SENSOR, _OFF),
    "all temperatures jump": Corruption(_from_the_middle(1.0, 27.0, 32.0), "*", ("jump", *_OFF)),
    "all temperatures jump by 6 to 9 K": Corruption(_from_the_middle(1.0, 6.0, 9.0), "*", ("jump", *_OFF)),
    "one sensor jumps by 9 K": Corruption(_from_the_middle(1.0, 9.0, 9.0, (_SENSOR,)), _SENSOR, ("jump", *_OFF)),
    "Fahrenheit from the middle on": Corruption(_from_the_middle(1.8, 32.0, 32.0), "*", ("jump", *_OFF, *_UNIT)),
    "one sensor in Fahrenheit from the middle on": Corruption(
        _from_the_middle(1.8, 32.0, 32.0, (_SENSOR,)), _SENSOR, ("jump", *_OFF, *_UNIT)
    ),
    "two columns of one sensor, a noise of its own": Corruption(_copied, "*", ("duplicate",)),
    "two columns of one torque": Corruption(_torque_of_another, "*", ("duplicate",)),
    "all columns stand for 5 s, ten times": Corruption(_held(5.0, 10), "*", ("held",), coarse=False),
    "all columns stand for 30 s": Corruption(_held(30.0, 2), "*", ("held", *_STILL), coarse=False),
    "firmware clamps the upper tenth": Corruption(_clamped(0.9, above=True), _SENSOR, _STILL, coarse=False),
    "a counter of 1/64 K that turns": Corruption(_turning(0.8), _SENSOR, ("wrap", *_OFF)),
    "a sensor falls to 25.0 for 20 s now and then": Corruption(_falls(25.0, 20, 300), _SENSOR, _OFF),
    "a sensor falls to 30.0 for 3 s now and then": Corruption(_falls(30.0, 3, 120), _SENSOR, _OFF),
    "a byte with an offset of 40": Corruption(_bytes(40.0), _SENSOR, ("offset",)),
    "all bytes with an offset of 30": Corruption(_bytes(30.0, "temperature."), "*", ("offset",)),
    "a thermistor opens, a row in 5 s": Corruption(_noisy(-94.6, 0.3, 700), _SENSOR, _OFF, every=5.0),
    "falls to 25.0 now and then, a row in 5 s": Corruption(_falls(25.0, 20, 300), _SENSOR, _OFF, every=5.0),
    "all temperatures jump, a row in 5 s": Corruption(
        _from_the_middle(1.0, 27.0, 32.0), "*", ("jump", *_OFF), every=5.0
    ),
    "a torque turns into amperes": Corruption(
        _from_the_middle(0.4, 0.0, 0.0, (_TORQUE,)), _TORQUE, _UNIT, coarse=False
    ),
    "a straight line in a sensor": Corruption(_lines(_SENSOR, 600), _SENSOR, ("interpolated",), coarse=False),
    "a straight line in a torque": Corruption(_lines(_TORQUE, 600), _TORQUE, ("interpolated",)),
    "straight lines in all columns": Corruption(_lines("*", 300), "*", ("interpolated",), coarse=False),
    "85 for some rows, after resets": Corruption(_resets, _SENSOR, ("code", "spike")),
    "a failed checksum: 4095.94": Corruption(_now_and_then(4095.9375), _SENSOR, ("code",)),
    "each 60th reading 4 K high": Corruption(_each(60, 4.0), _SENSOR, ("spike",)),
    "bits that turn": Corruption(_bits(0.003), _SENSOR, ("code", "spike")),
    "a bit that is always set": Corruption(_bits(0.0, 128), _SENSOR, _OFF),
    "a voltage of 6 K with the torque": Corruption(_with_torque(6.0), _SENSOR, _OFF),
    "a block of 300 s pasted twice": Corruption(_pasted(300), "*", _OFF, coarse=False),
    "a torque each 10 s": Corruption(_sampled(10), _TORQUE, ("held",)),
    "a column that begins a third later": Corruption(_rolled, _SENSOR, _OFF),
    "a torque whose sign is lost in 16 bit": Corruption(_unsigned(_TORQUE, 100, 65536), _TORQUE, ("wrap",)),
    "a torque with its gear from the middle on": Corruption(
        _from_the_middle(9.0, 0.0, 0.0, (_TORQUE,)), _TORQUE, _UNIT, coarse=False
    ),
    "a current in mA from the middle on": Corruption(_milliamperes, "current.{joint}", _UNIT),
    "frost in a byte without a sign": Corruption(_unsigned("temperature.", 1, 256, -32), "*", ("wrap", *_UNIT)),
    "the air is a motor's, less 2 K": Corruption(_air_of_a_motor, _AIR, ("follows",)),
    "the air jumps by 11 K": Corruption(_from_the_middle(1.0, 11.0, 11.0, (_AIR,)), _AIR, ("jump", *_OFF)),
    "time in hours": Corruption(_time(1 / 3600), "time", _UNIT),
    "time in days, as of a spreadsheet": Corruption(_time(1 / 86400, 46_000 * 86400.0), "time", _UNIT),
    "summer time ends": Corruption(_summer_ends, "time", ("refused",)),
}


# --- Asked of the program ---------------------------------------------------------------------------


ROBOTS, STEPS = ("leg", "quadruped"), (0.1, 1.0)


@cache
def _healthy(robot: str, seed: int, steps: float) -> Log:
    if robot == "leg":
        only = {"fit1": draw_runs(seed)["fit1"]}
        logs = leg_logs([], seed=seed, noise=0.1, quantisation=steps, columns="all", runs=only)
    else:
        logs = quadruped_logs(seed=seed, runs=trial(seed, fitted=1800), noise=0.1, quantisation=steps)
    return logs["fit1"].reset_index(drop=True)


def healthy(robot: str, seed: int, steps: float) -> Log:
    """A log in which nothing is wrong, to be changed."""
    return _healthy(robot, seed, steps).copy()


def _runs_in(log: Log) -> list[Run]:
    """The runs of a log, none where it is refused."""
    try:
        return list(read_log(log, strict=False))
    except InputError:
        return []


def issues_in(log: Log) -> list[Issue] | None:
    """What is said of a log, `None` where it is refused."""
    runs = _runs_in(log)
    return list(runs[0].issues) if runs else None  # all runs of a log have the same


@dataclass(frozen=True)
class Answer:
    """What was said of a corrupted log.

    Args:
        found: whether the corruption was.
        blamed: other channels of which something was said.
        believed: share of the readings that the corruption made false by `_FALSE` or more, and that a fit would take.
    """

    found: bool
    blamed: frozenset[str]
    believed: float = 0.0


def ask(kind: str, robot: str, seed: int, steps: float) -> Answer:
    """Corrupt a log, and read it."""
    corruption = CORRUPTIONS[kind]
    log, rng = healthy(robot, seed, steps), np.random.default_rng([seed, list(CORRUPTIONS).index(kind)])
    joints = [name.removeprefix("torque.") for name in map(str, log) if name.startswith("torque.")]
    joint = joints[int(rng.integers(len(joints)))]
    if corruption.every:
        rows = np.diff(np.floor(_seconds(log) / corruption.every), prepend=-1.0) > 0
        log = log[rows].reset_index(drop=True)
    true = log.copy()
    corruption.change(log, joint, rng)
    runs, key = _runs_in(log), corruption.key.format(joint=joint)
    if not runs:
        return Answer("refused" in corruption.expected, frozenset())
    named = [issue for issue in runs[0].issues if key in ("*", issue.key)]
    others = frozenset(issue.key for issue in runs[0].issues if issue not in named)
    return Answer(any(issue.kind in corruption.expected for issue in named), others, _believed(runs, log, true))


_FALSE = 2.0  # K


def _believed(runs: list[Run], log: Log, true: Log) -> float:
    """The time for which a run has false readings of joints' sensors, as a share of that in the log; once, at most."""
    false = taken = 0.0
    every = float(np.median(np.diff(true["time"])))
    for name in [name for name in map(str, true) if name.startswith("temperature.") and name in log]:
        false += every * int((np.abs(log[name] - true[name]) > _FALSE).sum())
        for run in (run for run in runs if run.has(name)):
            truth = np.interp(run.time, true["time"], true[name])
            taken += run.step * int((np.abs(run.columns[name] - truth) > _FALSE).sum())
    return min(taken / false, 1.0) if false else 0.0


_TRUE_NAMES = {"offset": "sensor_offset", "disconnected": "sensor_loose"}
"""The effect that is what was done to the log, by the kind of what is said of it."""


@dataclass(frozen=True)
class Improvement:
    """What the program adds to a model that lacks nothing, where logs are spoilt: in words, and whether it is false."""

    words: str
    false: bool


def improved(kind: str, seed: int, spoilt: str) -> Improvement:
    """Spoil one of two fitted logs of a leg, or `all` and the one held out, and look for what its model lacks."""
    corruption, joint = CORRUPTIONS[kind], "FR_calf"
    logs = {name: log.reset_index(drop=True) for name, log in leg_logs([], seed=seed, noise=0.1, columns="all").items()}
    rng = np.random.default_rng([seed, list(CORRUPTIONS).index(kind)])
    for name in ["fit2"] if spoilt == "one" else list(logs):
        corruption.change(logs[name], joint, rng)
    with TemporaryDirectory() as name:
        folder = Path(name)
        model = presets()["leg"]
        if "temperature.ambient" not in logs["fit2"]:
            logs = {run: log.drop(columns="temperature.ambient", errors="ignore") for run, log in logs.items()}
            model = model.replace('ambient = "temperature.ambient"', 'ambient = "start"')
        (folder / "leg.toml").write_text(model, encoding="utf-8")
        for run, log in logs.items():
            log.to_parquet(folder / f"{run}.parquet")
        fitted = [folder / "fit1.parquet", folder / "fit2.parquet"]
        try:
            history = Study(folder / "leg.toml", fit=fitted, holdout=folder / "holdout.parquet").improve(3).selection()
        except InputError as error:
            return Improvement(f"refused: {error.found}", false=False)
    steps = history.steps[1:]
    added = ", ".join(f"{step.effect} at {step.at} ({100 * step.probability:.0f} %)" for step in steps)
    true = {name for expected, name in _TRUE_NAMES.items() if expected in corruption.expected}
    false = any(step.likely and not true.intersection(_names(step)) for step in steps)
    return Improvement(f"{history.verdict}{': ' * bool(added)}{added}", false)


def _names(step: Step) -> set[str]:
    """The effects that a step may be, as far as its data can tell."""
    return {effect for effect, _ in (step.key, *step.indistinguishable)}


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, nargs="+", default=[4, 5, 6])
    parser.add_argument("--improve", action="store_true")
    parser.add_argument("--spoilt", choices=("one", "all"), default="one", help="with --improve: which of the logs")
    parser.add_argument("--kinds", default="", help="those whose words hold this")
    asked = parser.parse_args()
    seeds: list[int] = asked.seeds
    chosen = {kind: corruption for kind, corruption in CORRUPTIONS.items() if asked.kinds in kind}
    if asked.improve:
        print("| what is wrong | seed | what is added |\n| --- | --- | --- |")
        false = 0
        for kind, seed in product(chosen, seeds):
            improvement = improved(kind, seed, asked.spoilt)
            false += improvement.false
            print(f"| {kind} | {seed} | {'**FALSE** ' * improvement.false}{improvement.words} |", flush=True)
        print(f"\nfalse, with half a probability or more: {false} of {len(chosen) * len(seeds)}")
        return
    clean = [issues_in(healthy(robot, seed, steps)) for robot in ROBOTS for seed in seeds for steps in STEPS]
    print(f"{len(clean)} healthy logs, something said of {sum(1 for issues in clean if issues != [])}\n")
    print("| what is wrong | found | of | other channels named | false readings believed |")
    print("| --- | --- | --- | --- | --- |")
    total, wrong = np.zeros(3, dtype=int), list[str]()
    for kind, corruption in chosen.items():
        logs = list(product(ROBOTS, seeds, STEPS if corruption.coarse else STEPS[:1]))
        answers = [ask(kind, *log) for log in logs]
        row = np.array(
            [sum(reply.found for reply in answers), len(answers), sum(len(reply.blamed) for reply in answers)]
        )
        for (robot, seed, steps), answer in zip(logs, answers, strict=True):
            said = [*["missed"] * (not answer.found), *(f"{key} named" for key in sorted(answer.blamed))]
            wrong += [f"{kind}, {robot}, seed {seed}, {steps:g} K: {', '.join(said)}"] * bool(said)
        believed = np.mean([reply.believed for reply in answers])
        print(f"| {kind} | {row[0]} | {row[1]} | {row[2]} | {believed:.0%} |", flush=True)
        total += row
    print(f"| all {len(chosen)} | {total[0]} | {total[1]} | {total[2]} | |")
    print(*wrong, sep="\n")


if __name__ == "__main__":
    main()
