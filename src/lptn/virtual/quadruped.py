"""The quadruped's logs: its runs simulated one after the other, and what its sensors show of them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import get_args

import numpy as np
import pandas as pd

from .effects import Columns, Hidden, extra_columns
from .heat import Balance, Exponential, Forcing, check_temperatures, copper_loss, forcing
from .motion import SAMPLES, Bout, Motion, draw_motion
from .robot import (
    PC,
    QUADRUPED_JOINTS,
    QUADRUPED_NODES,
    Array,
    Level,
    Physics,
    Robot,
    check_one_of,
    draw_quadruped,
    draw_run_errors,
    stream,
)
from .runs import Job, Plan, plan
from .sensors import Probe, by_place, noise_free_readings, sensor_steps
from .surroundings import Ambient, ambient, event_heat, fan, sun

RATES = (1.0, 100.0)  # Hz
CHUNK = 600  # s of 100 Hz rows at a time, which bounds the memory
TORQUE_NOISE = 0.02  # relative, of each second and joint

Effects = Sequence[Hidden | tuple[str, str] | tuple[str, str, float] | tuple[str, str, float, str]]

# --- what happens --------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Record:
    """What happened in one run.

    robot: with this run's hidden errors. states: degC at 0, 1, … s, of shape (seconds + 1, states), as ``network``
    orders them.
    """

    name: str
    run: Job
    robot: Robot
    network: Balance
    ambient: Ambient
    motion: Motion
    states: Array

    @property
    def sensed(self) -> Array:
        """The true temperatures at the sensors, degC, of shape (seconds + 1, nodes with a sensor)."""
        temperatures: Array = self.states[:, self.network.sensed]
        return temperatures

    def truth(self) -> pd.DataFrame:
        """Return what no log holds, once a second.

        Columns: time, temperature.<node> without noise (the winding's), housing.<joint> where it is a mass of its own,
        temperature.trunk where there is one, temperature.ambient as it really was.
        """
        states, nodes = self.states[:-1], self.robot.nodes
        columns = {"time": np.arange(len(states), dtype=float)}
        columns |= {f"temperature.{node}": states[:, k] for node, k in zip(nodes, self.network.copper, strict=True)}
        columns |= {f"housing.{nodes[k]}": states[:, k] for k in self.network.wound}
        columns["temperature.ambient"] = self.ambient.true[:-1].copy()
        return pd.DataFrame(columns)


def simulate_runs(robot: Robot, runs: Mapping[str, Job], seed: int, level: Level) -> Iterator[Record]:
    """Simulate the runs, one after the other; each carries its temperatures over to the next that asks for them.

    Raises:
        ValueError: effects so large that the robot passes 150 degC.
    """
    state: Array | None = None
    for name, run in runs.items():
        own, error = draw_run_errors(robot.in_run(name), level, seed, name)
        air = ambient(own, run.ambient, error, run.swing, run.seconds, seed, name)
        network = Balance(own, float(air.true[0]))
        solver = Exponential(network)
        if state is None or not run.carried:
            start = network.ambient if run.start is None else run.start
            state = network.start(np.full(len(own.nodes), start))
        elif run.gap:
            gap = Job((Bout("rest", run.gap),), cutout=None)
            state = _with_cutouts(solver, gap, draw_motion(gap.segments, stream(seed, "gap", name)), state)[1][-1]
        if run.lead:
            lead = Job(run.lead, cutout=run.cutout)
            state = _with_cutouts(solver, lead, draw_motion(lead.segments, stream(seed, "lead", name)), state)[1][-1]
        motion = draw_motion(run.segments, stream(seed, "movement", name))
        motion = replace(motion, fan=fan(run.seconds, seed, name), sun=sun(run.seconds, seed, name))
        events = event_heat(own, run.seconds, seed, name)
        motion, states = _with_cutouts(solver, run, motion, state, events, air.shift)
        check_temperatures(states, "robot", name)
        state = states[-1]
        yield Record(name, run, own, network, air, motion, states)


def _with_cutouts(
    solver: Exponential, run: Job, motion: Motion, start: Array, events: Array | float = 0.0, shift: Array | None = None
) -> tuple[Motion, Array]:
    """Return the movement with the run's cut-outs in it, and the states.

    ``events``: their heat, W, of shape (seconds, nodes). ``shift``: the ambient's, K, at 0, 1, … s.
    """
    robot, on = solver.network.robot, np.ones(run.seconds)

    def acting(motion: Motion) -> Forcing:
        heat = np.zeros((run.seconds, len(robot.nodes))) + events
        heat[:, robot.nodes.index(PC)] += motion.pc
        return forcing(robot, motion.means(robot.wind_exponent), heat).shifted(shift)

    moving, resting = acting(motion), acting(motion.only(0 * on))
    off_at = np.inf if run.cutout is None else run.cutout
    on_at = -np.inf if run.resume is None else run.resume
    pieces, done = [start[None]], 0
    while done < run.seconds:
        if on[done]:
            piece = solver.solve(moving.since(done), pieces[-1][-1], above=off_at)
        else:
            piece = solver.solve(resting.since(done), pieces[-1][-1], below=on_at)
        pieces.append(piece[1:])
        done += len(piece) - 1
        on[done:] = 1 - on[done - 1]
    return motion.only(on), np.concatenate(pieces)


# --- what is logged ------------------------------------------------------------------------------------------------


def rows(record: Record, sensor: Probe, seed: int, rate: float, columns: Columns = "asked") -> Iterator[pd.DataFrame]:
    """Yield a run's log in pieces, whole seconds each: all of it at 1 Hz, 10 min at a time at 100 Hz.

    Args:
        record: the run.
        sensor: of the temperatures.
        seed: of the noise.
        rate: 1 or 100 Hz.
        columns: as for ``quadruped_logs``.
    """
    motion, means = record.motion, record.motion.means()
    seconds = record.run.seconds
    true = noise_free_readings(record.network, record.states, copper_loss(record.robot, means))
    steps = sensor_steps(record.robot, seconds, seed, record.name)[:, : len(QUADRUPED_NODES)]
    noise = stream(seed, "torque", record.name).standard_normal((seconds, len(QUADRUPED_JOINTS)))
    gain = 1 + TORQUE_NOISE * noise
    extra = extra_columns(record.robot, columns)
    shared = {name: values for name, values in motion.shared(means).items() if name in extra}

    def table(time: Array, moves: Mapping[str, Array], readings: Array, piece: str) -> pd.DataFrame:
        second = time.astype(int)
        readings = sensor.read(readings, stream(seed, "sensors", record.name, piece))
        columns = {"time": time}
        for quantity, values in moves.items():
            columns |= by_place(quantity, values, QUADRUPED_JOINTS)
        columns["speed.base"] = motion.base[second]
        columns |= by_place("powered", motion.powered[second], QUADRUPED_JOINTS)
        columns["power.pc"] = motion.pc[second]
        columns |= {name: values[second, 0] for name, values in shared.items()}
        columns |= by_place("temperature", readings, QUADRUPED_NODES)
        columns["temperature.ambient"] = np.interp(time, np.arange(seconds + 1), record.ambient.logged)
        return pd.DataFrame(columns)

    if rate == 1:
        moves = {
            "torque": np.sqrt(means.torque2) * gain,
            "velocity": means.speed,
            "velocity_rms": np.sqrt(means.speed2),
        }
        # A reader can't form these from the others once the signs are gone.
        unsigned = {"torque_abs": means.torque1 * gain, "mechanical_power": means.power * gain}
        moves |= {name: values for name, values in unsigned.items() if name in extra}
        yield table(np.arange(seconds, dtype=float), moves, true[:-1] + steps, "slow")
        return
    part = (np.arange(SAMPLES) / SAMPLES)[None, :, None]
    for begin in range(0, seconds, CHUNK):
        end = min(begin + CHUNK, seconds)
        time = np.arange(begin * SAMPLES, end * SAMPLES) / SAMPLES
        torque, velocity = motion.samples(begin, end)
        torque *= gain[begin:end].repeat(SAMPLES, axis=0)
        now, then = true[begin:end, None, :], true[begin + 1 : end + 1, None, :]
        readings = (now + part * (then - now) + steps[begin:end, None, :]).reshape(len(time), -1)
        piece = table(time, {"torque": torque, "velocity": velocity}, readings, str(begin))
        # Half the size, and finer than any sensor; only time would lose.
        yield piece.astype({name: np.float32 for name in piece if name != "time"})


# --- logs of whole plans -------------------------------------------------------------------------------------------


class Logs(dict[str, pd.DataFrame]):
    """Logs by the name of their run, in the order in which they happened.

    Args:
        robot: the true parameters, without what differs from run to run.
        truth: by the same names, what no log holds, once a second. Columns: time, temperature.<node> at the sensor but
            without its errors, housing.<joint> where that is a mass of its own, temperature.trunk where there is one,
            temperature.ambient as it really was.
    """

    def __init__(self, robot: Robot) -> None:
        super().__init__()
        self.robot = robot
        self.truth: dict[str, pd.DataFrame] = {}


def quadruped_logs(
    hidden: Effects = (),
    *,
    seed: int,
    runs: Plan | Mapping[str, Job] = "protocol",
    level: Level | None = None,
    physics: Physics = "full",
    noise: float = 0.15,
    quantisation: float = 1.0,
    dropouts: float = 0.0,
    scatter: float = 1.0,
    rate: float = 1.0,
    columns: Columns = "asked",
) -> Logs:
    """Simulate runs of the quadruped [QuadrupedLPTN].

    Equal arguments give equal logs. Calls that differ only in ``hidden`` share parameters and noise, and movements too
    where no cut-out comes between. At 100 Hz half an hour takes 40 MB.

    Args:
        hidden: effects beyond the physics: ``Hidden`` or tuples (effect, place), (effect, place, size) or (effect,
            place, size, run).
        seed: 0 or above; draws parameters, movements, events and noise.
        runs: a plan's name: "protocol" ([QuadrupedLPTN, table 1]: 25 runs) or "tests" (table 3 and the multi-gait test:
            7 runs); or runs of your own by name.
        level: "none", "default" or "strong": hidden errors of each run, of the ambient's sensor, of the joints'
            conductances to air and of the battery's heat. ``None``: "default" for full physics, "none" for plain.
        physics: "full" has more than any model under test; "plain" is a baseline of one mass a joint, the computer,
            copper loss, drive heat and links, to which ``hidden`` adds.
        noise: standard deviation of each temperature reading, K.
        quantisation: step the temperature readings are rounded to, K; 0 for none.
        dropouts: share of temperature readings that are missing (NaN).
        scatter: multiplies the scatter of the parameters over the legs; 0 for the nominal robot.
        rate: rows a second: 100 for signed samples, in single precision but for the time; 1 for RMS torque, mean
            |velocity| and RMS velocity over the second that follows the row's time, the temperatures at that time.
        columns: "asked": further columns where a hidden effect is driven by them; "all": always, so that they give no
            effect away. At 1 Hz torque_abs.<joint> (N·m, mean |torque|) and mechanical_power.<joint> (W, mean
            |torque × velocity|); power.battery (W), speed.fan (share of full speed), irradiance.global (W/m²).

    Returns:
        By name of the run, tables with the columns time (s), torque.<joint> (N·m), velocity.<joint> (rad/s),
        at 1 Hz also velocity_rms.<joint>, speed.base (m/s), powered.<joint> (0 or 1), power.pc (W),
        temperature.<joint>, temperature.pc and temperature.ambient (degC).

    Raises:
        ValueError: an argument outside its range, or effects so large that the robot passes 150 degC.
    """
    check_one_of("rate", rate, RATES, " Hz")
    check_one_of("columns", columns, get_args(Columns))
    sensor = Probe(noise, quantisation, dropouts)
    planned = runs if isinstance(runs, Mapping) else plan(runs, seed)
    robot = quadruped(hidden, seed=seed, physics=physics, scatter=scatter)
    robot.check_runs(planned)
    if level is None:
        level = "none" if physics == "plain" else "default"
    logs = Logs(robot)
    for record in simulate_runs(robot, planned, seed, level):
        logs[record.name] = pd.concat(rows(record, sensor, seed, rate, columns), ignore_index=True)
        logs.truth[record.name] = record.truth()
    return logs


def quadruped(hidden: Effects = (), *, seed: int, physics: Physics = "full", scatter: float = 1.0) -> Robot:
    """Draw the robot that ``quadruped_logs`` simulates: see there.

    Raises:
        ValueError: an argument outside its range.
    """
    robot = draw_quadruped(seed, physics, scatter)
    for one in hidden:
        if not isinstance(one, Hidden):
            effect, at = one[:2]
            one = Hidden(effect, at, one[2] if len(one) > 2 else 1.0, "quadruped", one[3] if len(one) > 3 else "")
        replace(one, robot="quadruped").set_in(robot)
    return robot
