"""Make the logs of a three-joint leg with hidden effects."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from typing import Literal, get_args

import numpy as np
import pandas as pd

from .events import event_heat, sensor_steps
from .forcing import Common, Means, act, averaged, battery_power, copper_loss, mean
from .further import Columns, common, wanted
from .hidden import Hidden
from .protocol import SAMPLES_PER_SECOND, WARM_UP, Run, Signals, draw_runs, draw_signals
from .quadruped_truth import PC_BUSY, PC_IDLE
from .sensors import Sensor
from .shown import shown
from .solve import Network
from .streams import stream
from .surroundings import ambient, fan, sun
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
    columns: Columns = "asked",
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
        columns: "asked": further columns where a hidden effect is driven by them; "all": always, so that they give no
            effect away. Below 10 Hz torque_abs.<joint> (N·m, mean |torque|) and mechanical_power.<joint> (W, mean
            |torque × velocity|); power.pc and power.battery (W), speed.fan (share of full speed), irradiance.global
            (W/m²).

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
    if columns not in get_args(Columns):
        raise ValueError(f"columns: found {columns!r}; expected one of {', '.join(get_args(Columns))}")
    sensor, runs = Sensor(noise, quantisation, dropouts), draw_runs(seed)
    leg = draw_leg(seed, max(scatter, ROUGH_SCATTER) if rough else scatter)
    if rough:
        roughen(leg)
    for effect in hidden:
        replace(effect, robot="leg").set_in(leg)
    leg.check_runs(runs)
    further = wanted(leg, every=columns == "all")
    logs = {}
    for name, run in runs.items():
        happened = _happen(leg.in_run(name), name, run, seed, warm=start == "warm")
        table = _reduce(happened, round(SAMPLES_PER_SECOND / rate), further)
        logs[name] = _measure(table, sensor, rough, stream(seed, "sensors", name))
    return logs


@dataclass(frozen=True)
class _Happened:
    """One run at 10 Hz: inputs, what the sensors would show without noise, and the logged ambient, degC.

    common: what the nodes share, once a second.
    """

    signals: Signals
    seen: Array
    ambient: Array
    common: Common


def _happen(leg: Leg, name: str, run: Run, seed: int, *, warm: bool) -> _Happened:
    """Let one run happen."""
    rng = stream(seed, "movement", name)
    signals = draw_signals(run.segments, rng)
    seconds = len(signals.base) // SAMPLES_PER_SECOND
    whole, before = signals, 0
    if warm:
        whole, before = _joined(draw_signals((WARM_UP,), rng), signals), WARM_UP.seconds
    air = ambient(leg, run.ambient, 0.0, 0.0, seconds, seed, name)
    network = Network(leg, float(air.true[0]))
    means = averaged(leg, whole, SAMPLES_PER_SECOND)
    shared = _common(whole, means, before, (sun(seconds, seed, name), fan(seconds, seed, name)))
    # Before the log begins, no events, no change of the air.
    extra = np.pad(event_heat(leg, seconds, seed, name), ((before, 0), (0, 0)))
    shift = None if air.shift is None else np.pad(air.shift, (before, 0))
    beginning = network.start(network.ambient + stream(seed, "start", name).uniform(0.5, 2.0, COUNT))
    truth = network.solve(act(leg, replace(means, common=shared), extra).shifted(shift), beginning)
    if not np.all(truth[:, :COUNT] < TOO_HOT):
        raise ValueError(f"hidden: the leg passes {TOO_HOT:g} degC in {name}; expected smaller sizes")
    seen = shown(network, truth, copper_loss(leg, means), before)
    time, at = np.arange(seconds * SAMPLES_PER_SECOND) / SAMPLES_PER_SECOND, np.arange(seconds + 1)
    finer = np.column_stack([np.interp(time, at, column) for column in seen.T])
    finer += sensor_steps(leg, seconds, seed, name).repeat(SAMPLES_PER_SECOND, axis=0)
    return _Happened(signals, finer, np.interp(time, at, air.logged), _since(shared, before))


def _common(signals: Signals, means: Means, before: int, around: tuple[Array, Array]) -> Common:
    """Return what the joints share; sun and fan of ``around`` begin with the log, ``before`` s after the rest."""
    travels = mean((signals.base[:, None] != 0).astype(float), SAMPLES_PER_SECOND)
    computer = PC_IDLE + (PC_BUSY - PC_IDLE) * travels
    light, blown = (np.pad(one, ((before, 0), (0, 0))) for one in around)
    return Common(computer, battery_power(computer, means), blown, light)


def _since(shared: Common, before: int) -> Common:
    return Common(shared.computer[before:], shared.battery[before:], shared.fan[before:], shared.sun[before:])


def _joined(first: Signals, second: Signals) -> Signals:
    pairs = ((getattr(first, name), getattr(second, name)) for name in ("torque", "velocity", "base"))
    return Signals(*(np.concatenate(pair) for pair in pairs))


def _reduce(happened: _Happened, block: int, further: Collection[str]) -> pd.DataFrame:
    """Return the rows of a log without the ambient; signed samples as they are when a row holds only one."""
    torque, velocity, base = happened.signals.torque, happened.signals.velocity, happened.signals.base[:, None]
    unsigned = {}
    if block > 1:
        unsigned = {"torque_abs": mean(abs(torque), block), "mechanical_power": mean(abs(torque * velocity), block)}
        torque, velocity, base = (
            np.sqrt(mean(torque**2, block)),
            mean(abs(velocity), block),
            mean(abs(base), block),
        )
    columns = {"time": np.arange(len(torque)) * block / SAMPLES_PER_SECOND}
    # A reader can't form the last ones from the others once the signs are gone.
    moves = {"torque": torque, "velocity": velocity} | {name: v for name, v in unsigned.items() if name in further}
    for quantity, values in moves.items():
        columns |= {f"{quantity}.{joint}": values[:, i] for i, joint in enumerate(JOINTS)}
    columns["speed.base"] = base[:, 0]
    for name, shared in common(happened.common).items():
        if name in further:
            columns[name] = mean(shared.repeat(SAMPLES_PER_SECOND, axis=0), block)[:, 0]
    columns |= {f"temperature.{joint}": happened.seen[::block, i] for i, joint in enumerate(JOINTS)}
    columns["temperature.ambient"] = happened.ambient[::block]
    return pd.DataFrame(columns)


def _measure(table: pd.DataFrame, sensor: Sensor, rough: bool, rng: np.random.Generator) -> pd.DataFrame:
    """Add the sensors' errors."""
    temperatures = [f"temperature.{joint}" for joint in JOINTS]
    ambient_error, torque_error = (
        ROUGH_AMBIENT * rng.standard_normal(),
        ROUGH_TORQUE * rng.standard_normal(COUNT),
    )
    table[temperatures] = sensor.read(table[temperatures].to_numpy(), rng)
    if rough:
        table[[f"torque.{joint}" for joint in JOINTS]] *= 1 + torque_error
    table["temperature.ambient"] += ambient_error * rough
    return table
