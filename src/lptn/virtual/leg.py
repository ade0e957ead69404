"""Make the logs of a three-joint leg with hidden effects."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Literal, get_args

import numpy as np
import pandas as pd

from .events import event_heat, sensor_steps
from .hidden import Hidden
from .protocol import SAMPLES_PER_SECOND, WARM_UP, Run, Signals, draw_runs, draw_signals
from .sensors import Sensor, lagged
from .solve import Network, drive
from .streams import stream
from .truth import COUNT, JOINTS, ROUGH_SCATTER, Array, Leg, draw_leg, roughen
from .writers import Format, write_logs

__all__ = ["RATES", "Format", "Start", "leg_logs", "write_logs"]

Start = Literal["cold", "warm"]

RATES = (10.0, 5.0, 2.0, 1.0)  # Hz: those whose rows hold a whole number of samples
TOO_HOT = 150.0  # degC: beyond it no sum of effects means anything
ROUGH_AMBIENT = 0.5  # K, standard deviation over runs
ROUGH_TORQUE = 0.02  # relative, standard deviation over runs and joints


def leg_logs(
    hidden: Sequence[Hidden] = (),
    *,
    seed: int,
    noise: float = 0.15,
    quantisation: float = 0.0,
    dropouts: float = 0.0,
    rough: bool = False,
    scatter: float = 0.03,
    start: Start = "cold",
    rate: float = 10.0,
) -> dict[str, pd.DataFrame]:
    """Simulate two runs to fit and one to hold out.

    Equal arguments give equal logs. Calls that differ only in ``hidden`` share parameters, movements, noise.

    Args:
        hidden: effects the truth has beyond the baseline.
        seed: 0 or above; draws parameters, movements, events and noise.
        noise: standard deviation of each temperature reading, K.
        quantisation: step the temperature readings are rounded to, K; 0 for none.
        dropouts: share of temperature readings that are missing (NaN).
        rough: add what no model has: a trunk at the hip, weak radiation, an error of the ambient's sensor
            (0.5 K) and of the torque's scale (2 %) in each run, a scatter of at least 10 %.
        scatter: relative half-width of the parameters' scatter.
        start: "cold": joints 0.5 to 2 K above the ambient, hidden masses and sensors with them. "warm": each
            run comes after 15 min of trotting that isn't logged, so hidden masses and sensors lag behind.
        rate: rows a second: 10 for the signed samples themselves; 5, 2 or 1 for RMS torque, mean |velocity|,
            mean |speed| over each row's interval, and the temperature at its beginning, the row's time.

    Returns:
        "fit1", "fit2" and "holdout", each with the columns time (s), torque.<joint> (N·m), velocity.<joint>
        (rad/s), speed.base (m/s), temperature.<joint> and temperature.ambient (degC).

    Raises:
        ValueError: an argument outside its range, or effects so large that the leg passes 150 degC.
    """
    if rate not in RATES:
        raise ValueError(f"rate: found {rate:g}; expected one of {', '.join(f'{r:g}' for r in RATES)} Hz")
    if start not in get_args(Start):
        raise ValueError(f"start: found {start!r}; expected one of {', '.join(get_args(Start))}")
    sensor = Sensor(noise, quantisation, dropouts)
    leg = draw_leg(seed, max(scatter, ROUGH_SCATTER) if rough else scatter)
    if rough:
        roughen(leg)
    for effect in hidden:
        replace(effect, robot="leg").set_in(leg)
    logs = {}
    for name, run in draw_runs(seed).items():
        signals, seen = _happen(leg, name, run, seed, warm=start == "warm")
        table = _reduce(signals, seen, block=round(SAMPLES_PER_SECOND / rate))
        logs[name] = _measure(table, run.ambient, sensor, rough, stream(seed, "sensors", name))
    return logs


def _happen(leg: Leg, name: str, run: Run, seed: int, *, warm: bool) -> tuple[Signals, Array]:
    """Return a run's inputs and what its sensors would show without noise, both at 10 Hz."""
    rng = stream(seed, "movement", name)
    signals = draw_signals(run.segments, rng)
    seconds, before = len(signals.base) // SAMPLES_PER_SECOND, 0
    extra = event_heat(leg, seconds, seed, name)
    whole = signals
    if warm:
        before = WARM_UP.seconds
        whole = _joined(draw_signals((WARM_UP,), rng), signals)
        extra = np.concatenate([np.zeros((before, COUNT)), extra])
    network = Network(leg, run.ambient)
    beginning = network.start(run.ambient + stream(seed, "start", name).uniform(0.5, 2.0, COUNT))
    truth = network.solve(drive(leg, whole, extra.repeat(SAMPLES_PER_SECOND, axis=0)), beginning)[:, :COUNT]
    if not np.all(truth < TOO_HOT):
        raise ValueError(f"hidden: the leg passes {TOO_HOT:g} degC in {name}; expected smaller sizes")
    shown = lagged(truth, leg.lag)[before:] + leg.offset
    time = np.arange(seconds * SAMPLES_PER_SECOND) / SAMPLES_PER_SECOND
    seen = np.column_stack([np.interp(time, np.arange(seconds + 1), column) for column in shown.T])
    return signals, seen + sensor_steps(leg, seconds, seed, name).repeat(SAMPLES_PER_SECOND, axis=0)


def _joined(first: Signals, second: Signals) -> Signals:
    pairs = ((getattr(first, name), getattr(second, name)) for name in ("torque", "velocity", "base"))
    return Signals(*(np.concatenate(pair) for pair in pairs))


def _reduce(signals: Signals, seen: Array, block: int) -> pd.DataFrame:
    """Return the rows of a log without the ambient; signed samples as they are when a row holds only one."""
    torque, velocity, base = signals.torque, signals.velocity, signals.base[:, None]
    if block > 1:
        torque, velocity, base = (
            np.sqrt(_mean(torque**2, block)),
            _mean(abs(velocity), block),
            _mean(abs(base), block),
        )
    columns = {"time": np.arange(len(torque)) * block / SAMPLES_PER_SECOND}
    columns |= {f"torque.{joint}": torque[:, i] for i, joint in enumerate(JOINTS)}
    columns |= {f"velocity.{joint}": velocity[:, i] for i, joint in enumerate(JOINTS)}
    columns["speed.base"] = base[:, 0]
    columns |= {f"temperature.{joint}": seen[::block, i] for i, joint in enumerate(JOINTS)}
    return pd.DataFrame(columns)


def _mean(values: Array, block: int) -> Array:
    means: Array = values.reshape(-1, block, values.shape[1]).mean(axis=1)
    return means


def _measure(
    table: pd.DataFrame, ambient: float, sensor: Sensor, rough: bool, rng: np.random.Generator
) -> pd.DataFrame:
    """Add the sensors' errors and the ambient's column."""
    temperatures = [f"temperature.{joint}" for joint in JOINTS]
    ambient_error, torque_error = (
        ROUGH_AMBIENT * rng.standard_normal(),
        ROUGH_TORQUE * rng.standard_normal(COUNT),
    )
    table[temperatures] = sensor.read(table[temperatures].to_numpy(), rng)
    if rough:
        table[[f"torque.{joint}" for joint in JOINTS]] *= 1 + torque_error
    table["temperature.ambient"] = ambient + ambient_error * rough
    return table
