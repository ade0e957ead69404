"""The leg: what it does, sampled at 10 Hz, and the logs of two runs to fit and one to hold out."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import get_args

import numpy as np
import pandas as pd

from .effects import Columns, Hidden, extra_columns
from .heat import Balance, Means, Series, Shared, battery_power, check_temperatures, copper_loss, forcing
from .motion import BODY, Bout
from .robot import LEG_JOINTS, PC_BUSY, PC_IDLE, Array, Robot, check_one_of, draw_leg, stream, wandering
from .runs import Job
from .sensors import Probe, by_place, noise_free_readings, sensor_steps
from .surroundings import ambient, event_heat, fan, sun

SAMPLES = 10  # a second
RATES = (10.0, 5.0, 2.0, 1.0)  # Hz: those whose rows hold a whole number of samples
MODULATION = 0.12  # standard deviation of the slow wandering of torque and speed
COUNT = len(LEG_JOINTS)

# --- what the leg does ---------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class LegActivity:
    """How the leg moves. Joint triples are hip, thigh, calf.

    hold, swing: mean and amplitude of the torque, N·m. sweep: amplitude of the joints' speed at speed 1, rad/s.
    stride: Hz at speed 0, and its growth with speed. travels: whether the speed is the base's, in m/s; else a factor.
    """

    hold: tuple[float, float, float] = (0.0, 0.0, 0.0)
    swing: tuple[float, float, float] = (0.0, 0.0, 0.0)
    sweep: tuple[float, float, float] = (0.0, 0.0, 0.0)
    stride: tuple[float, float] = (0.2, 0.0)
    travels: bool = False


ACTIVITIES = {
    "rest": LegActivity(),
    "stand": LegActivity(hold=(5.0, 5.0, 6.0), swing=(0.5, 0.5, 0.6)),
    "trot": LegActivity((4.0, 3.5, 5.0), (4.0, 4.5, 6.0), (1.5, 5.0, 7.0), (1.4, 0.6), travels=True),
    "walk": LegActivity((5.0, 3.5, 4.5), (3.0, 3.5, 4.0), (1.5, 6.0, 7.0), (0.8, 0.6), travels=True),
    "squat": LegActivity((3.0, 6.0, 6.5), (1.0, 5.0, 5.0), (0.3, 2.5, 4.0), (0.4, 0.0)),
    "leg_sweep": LegActivity(swing=(0.6, 0.6, 0.5), sweep=(8.0, 8.0, 9.0), stride=(0.9, 0.4)),
}

Acts = tuple[tuple[str, float, tuple[float, float], tuple[float, float]], ...]
"""What a run holds: activity, share of its time, range of speed, range of load."""

# The order is drawn, but for the last: a cool-down, which shows the losses alone. The second run is the colder and the
# harder one, so that losses are seen far above the ambient, too: else natural convection can't be told from a larger
# conductance. Its legs sweep slowly and fast, which tells the laws of friction apart.
_FIT1: Acts = (
    ("stand", 1.0, (1, 1), (0, 2)),
    ("trot", 1.2, (0.4, 0.7), (0, 1)),
    ("leg_sweep", 1.1, (0.9, 1.2), (0, 0)),
    ("trot", 1.2, (1.2, 1.5), (2, 4)),
    ("rest", 0.6, (1, 1), (0, 0)),
    ("squat", 0.9, (0.8, 1.2), (0, 2)),
    ("walk", 1.1, (0.3, 0.5), (3, 5)),
    ("trot", 1.1, (1.3, 1.6), (0, 0)),
    ("stand", 0.8, (1, 1), (4, 6)),
    ("rest", 2.4, (1, 1), (0, 0)),
)
_FIT2: Acts = (
    ("squat", 0.9, (0.9, 1.3), (2, 4)),
    ("trot", 1.3, (0.8, 1.1), (6, 7)),
    ("leg_sweep", 1.1, (0.3, 0.45), (0, 0)),
    ("walk", 1.1, (0.4, 0.6), (3, 5)),
    ("stand", 1.2, (1, 1), (8, 9)),
    ("trot", 1.2, (1.4, 1.7), (2, 4)),
    ("stand", 0.8, (1, 1), (0, 1)),
    ("trot", 1.1, (0.4, 0.6), (6, 7)),
    ("leg_sweep", 0.9, (1.4, 1.6), (0, 0)),
    ("rest", 3.0, (1, 1), (0, 0)),
)
_HOLDOUT: Acts = (
    ("walk", 1.2, (0.5, 0.7), (1, 3)),
    ("stand", 0.8, (1, 1), (2, 4)),
    ("trot", 1.4, (1.0, 1.3), (1, 3)),
    ("rest", 0.7, (1, 1), (0, 0)),
    ("leg_sweep", 0.8, (0.7, 1.1), (0, 0)),
    ("trot", 1.2, (0.5, 0.8), (2, 4)),
    ("squat", 0.8, (0.7, 1.1), (1, 3)),
    ("rest", 1.6, (1, 1), (0, 0)),
)
_RUNS = {"fit1": (_FIT1, 2400, 22.0), "fit2": (_FIT2, 2400, 12.0), "holdout": (_HOLDOUT, 1800, 28.0)}


def in_random_order(
    acts: Acts, seconds: int, rng: np.random.Generator
) -> list[tuple[str, int, tuple[float, float], tuple[float, float]]]:
    """Return activity, whole seconds, ranges of speed and load: in random order, but for the last."""
    order = [*rng.permutation(len(acts) - 1), len(acts) - 1]
    share = np.array([acts[i][1] for i in order]) * rng.uniform(0.8, 1.2, len(order))
    ends = np.rint(seconds * np.cumsum(share) / share.sum()).astype(int)
    lengths = np.diff(ends, prepend=0)
    return [(acts[i][0], int(length), *acts[i][2:]) for i, length in zip(order, lengths, strict=True)]


def draw_runs(seed: int) -> dict[str, Job]:
    """Draw the runs "fit1" (40 min, 22 degC), "fit2" (40 min, 12 degC) and "holdout" (30 min, 28 degC)."""
    runs = {}
    for name, (acts, seconds, air) in _RUNS.items():
        rng = stream(seed, "protocol", name)
        segments = [
            Bout(activity, length, float(rng.uniform(*speeds)), float(rng.uniform(*loads)))
            for activity, length, speeds, loads in in_random_order(acts, seconds, rng)
        ]
        runs[name] = Job(tuple(segments), air, cutout=None)
    return runs


@dataclass(frozen=True)
class Signals(Series):
    """Inputs at 10 Hz: torque (N·m) and velocity (rad/s), of shape (samples, joints); base speed (m/s)."""

    torque: Array
    velocity: Array
    base: Array


def draw_signals(segments: Sequence[Bout], rng: np.random.Generator) -> Signals:
    """Draw the inputs of these segments, one after the other."""
    return Signals.joined([_perform(segment, rng) for segment in segments])


def _perform(segment: Bout, rng: np.random.Generator) -> Signals:
    act, speed = ACTIVITIES[segment.activity], segment.speed
    time = np.arange(segment.seconds * SAMPLES) / SAMPLES
    wander = partial(wandering, time[-1], time, MODULATION, 1, rng)  # anew each time
    stride = (act.stride[0] + act.stride[1] * speed) * rng.uniform(0.9, 1.1)
    first, second, moving = (2 * np.pi * (n * stride * time[:, None] + rng.uniform(0, 1, COUNT)) for n in (1, 2, 1))
    # Each segment has its own share of work among the joints: else their heats would go hand in hand.
    effort = rng.uniform(0.75, 1.3, COUNT) * (BODY + segment.load) / BODY * wander()
    torque = effort * (np.array(act.hold) + np.array(act.swing) * (np.sin(first) + 0.3 * np.sin(second)))
    reach = rng.uniform(0.6, 1.2, COUNT) * speed * wander()
    velocity = reach * np.array(act.sweep) * np.sin(moving)
    base = speed * wander()[:, 0] * act.travels
    return Signals(torque, velocity, base)


def mean(values: Array, block: int) -> Array:
    """Average rows over blocks of this many."""
    means: Array = values.reshape(-1, block, values.shape[1]).mean(axis=1)
    return means


def averaged(robot: Robot, signals: Signals, block: int = SAMPLES) -> Means:
    """Average samples, each held until the next, over intervals of ``block`` samples."""
    wind = mean(np.abs(signals.base[:, None]) ** robot.wind_exponent, block)
    return Means.of_samples(signals.torque, signals.velocity, wind, lambda values: mean(values, block))


# --- logs ----------------------------------------------------------------------------------------------------------


def leg_logs(
    hidden: Sequence[Hidden | Callable[[Robot], None]] = (),
    *,
    seed: int,
    noise: float = 0.15,
    quantisation: float = 0.0,
    dropouts: float = 0.0,
    scatter: float = 0.03,
    rate: float = 10.0,
    columns: Columns = "asked",
    runs: Mapping[str, Job] | None = None,
) -> dict[str, pd.DataFrame]:
    """Simulate two runs to fit and one to hold out, or runs of your own; each begins 0.5 to 2 K above the ambient.

    Equal arguments give equal logs. Calls that differ only in ``hidden`` share parameters, movements, noise.

    Args:
        hidden: effects the truth has beyond the baseline, and functions that change the robot in place.
        seed: 0 or above; draws parameters, movements, events and noise.
        noise: standard deviation of each temperature reading, K.
        quantisation: step the temperature readings are rounded to, K; 0 for none.
        dropouts: share of temperature readings that are missing (NaN).
        scatter: relative half-width of the parameters' scatter.
        rate: rows a second: 10 for the signed samples themselves; 5, 2 or 1 for RMS torque, mean |velocity|,
            mean |speed| over each row's interval, and the temperature at its beginning, the row's time.
        columns: "asked": further columns where a hidden effect is driven by them; "all": always, so that they give no
            effect away. Below 10 Hz torque_abs.<joint> (N·m, mean |torque|) and mechanical_power.<joint> (W, mean
            |torque × velocity|); power.pc and power.battery (W), speed.fan (share of full speed), irradiance.global
            (W/m²).
        runs: in place of those three.

    Returns:
        "fit1", "fit2" and "holdout", each with the columns time (s), torque.<joint> (N·m), velocity.<joint>
        (rad/s), speed.base (m/s), temperature.<joint> and temperature.ambient (degC).

    Raises:
        ValueError: an argument outside its range, or effects so large that the leg passes 150 degC.
    """
    check_one_of("rate", rate, RATES, " Hz")
    check_one_of("columns", columns, get_args(Columns))
    sensor, runs = Probe(noise, quantisation, dropouts), draw_runs(seed) if runs is None else runs
    leg = draw_leg(seed, scatter)
    for effect in hidden:
        (replace(effect, robot="leg").set_in if isinstance(effect, Hidden) else effect)(leg)
    leg.check_runs(runs)
    extra, block = extra_columns(leg, columns), round(SAMPLES / rate)
    logs = {}
    for name, run in runs.items():
        signals, true, air, shared = _simulate(leg.in_run(name), name, run, seed)
        torque, velocity, base = signals.torque, signals.velocity, signals.base[:, None]
        moves = {"torque": torque, "velocity": velocity}
        if block > 1:
            moves = {"torque": np.sqrt(mean(torque**2, block)), "velocity": mean(abs(velocity), block)}
            # A reader can't form these from the others once the signs are gone.
            unsigned = {"torque_abs": abs(torque), "mechanical_power": abs(torque * velocity)}
            moves |= {quantity: mean(values, block) for quantity, values in unsigned.items() if quantity in extra}
            base = mean(abs(base), block)
        table = {"time": np.arange(len(base)) * block / SAMPLES}
        for quantity, values in moves.items():
            table |= by_place(quantity, values, LEG_JOINTS)
        table["speed.base"] = base[:, 0]
        for column, values in shared.items():
            if column in extra:
                table[column] = mean(values.repeat(SAMPLES, axis=0), block)[:, 0]
        rng = stream(seed, "sensors", name)
        rng.standard_normal(1 + COUNT)  # a truth with errors of its own in each run draws them here, before the noise
        table |= by_place("temperature", sensor.read(true[::block], rng), LEG_JOINTS)
        table["temperature.ambient"] = air[::block]
        logs[name] = pd.DataFrame(table)
    return logs


def _simulate(leg: Robot, name: str, run: Job, seed: int) -> tuple[Signals, Array, Array, Shared]:
    """Return a run's inputs, its readings without noise and the logged ambient [degC] at 10 Hz; what nodes share."""
    rng, seconds = stream(seed, "movement", name), run.seconds
    signals = draw_signals(run.segments, rng)
    air = ambient(leg, run.ambient, 0.0, 0.0, seconds, seed, name)
    means = averaged(leg, signals)
    computer = PC_IDLE + (PC_BUSY - PC_IDLE) * mean((signals.base[:, None] != 0).astype(float), SAMPLES)
    shared = {"power.pc": computer, "power.battery": battery_power(computer, means)}
    shared |= {"speed.fan": fan(seconds, seed, name), "irradiance.global": sun(seconds, seed, name)}
    acting = forcing(leg, replace(means, shared=shared), event_heat(leg, seconds, seed, name))
    network = Balance(leg, float(air.true[0]))
    start = network.start(network.ambient + stream(seed, "start", name).uniform(0.5, 2.0, COUNT))
    states = network.solve(acting.shifted(air.shift), start)
    check_temperatures(states, "leg", name)
    each_second = noise_free_readings(network, states, copper_loss(leg, means))
    time, at = np.arange(seconds * SAMPLES) / SAMPLES, np.arange(seconds + 1)
    readings = np.column_stack([np.interp(time, at, column) for column in each_second.T])
    readings += sensor_steps(leg, seconds, seed, name).repeat(SAMPLES, axis=0)
    return signals, readings, np.interp(time, at, air.logged), shared
