"""Changes that engineers name, hidden in a leg of finite volumes; which answers are right; the logs of its runs.

A change alters dimensions, losses or sensors of ``finite_volumes``, never a term of a lumped balance. None can be
imitated by a parameter that is free in one mass a joint with links along the leg: a fan runs at a logged, changing
speed; a torque constant is wrong, a cover is on, in one run alone.

An answer is right if the engineer who takes it to the robot finds the cause: the part is right and so is what to look
for. A stator without paste is a coil that runs ahead of its housing: a second mass or a hot spot where the sensor is on
the coil's side of the gap, a winding that passes its heat on late where it is on the other. In a tight gearbox friction
of either law sends her to the same gear. Where the robot has a mass of its own for the inside of a joint, a sensor
between the two says the same.

``ALWAYS`` is true of every leg, at its natural size, wherever it is named, or at the place that stands with it: no
lumped model has all of it. Such a step is neither the answer nor silly.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
import pandas as pd

from lptn.virtual import LEG_JOINTS, Job, Probe
from lptn.virtual.leg import SAMPLES, Signals, draw_runs, draw_signals, mean
from lptn.virtual.robot import PC, PC_BUSY, PC_IDLE, Array, check_one_of, edge, stream
from lptn.virtual.sensors import by_place, lagged
from lptn.virtual.surroundings import BURST_EVERY, fan, sun

from .finite_volumes import TORQUE_CONSTANT, Joint, Leg, assemble, draw_finite_volumes, solve

Logging = Literal["sampled", "mean"]

ONE_RUN = "fit2"  # in which what acts in one run alone acts
EVERYWHERE = ("*",)
UNLINKED = (edge("FR_hip", "FR_calf"),)

# True of every leg: coil, rotor and flange are masses apart, the sensor touches the coil and lags, films of air grow
# with temperature, a housing radiates, copper's resistance rises and is not just the data sheet's, gears and iron rub,
# boards idle, flanges and tubes between joints are masses that these share. Motors of thigh and calf are bolted back to
# back, so that either's sensor, on the housing, feels some of the other's heat before its own motor's mean does.
ALWAYS = (
    "second_mass",
    "shared_mass",
    "hot_spot",
    "sensor_lag",
    "winding_mass",
    "natural_convection",
    "radiation",
    "resistance_rise",
    "loss_scale",
    "coulomb_friction",
    "viscous_friction",
    "gear_loss",
    "iron_loss",
    "constant_heat",
    "sensor_position@FR_thigh~FR_calf",
    "sensor_position@FR_calf~FR_thigh",
)


@dataclass(frozen=True)
class Change:
    """One change by its engineering name.

    about: what was done to the robot. effects: of the catalogue, by which it is rightly named; none for what no
    catalogue has. set: changes a leg, at one joint for a change that stands at joints. places: where it may be. run: in
    which alone it acts; "" for all.
    """

    about: str
    effects: tuple[str, ...]
    set: Callable[[Leg, Joint], None]
    places: tuple[str, ...] = LEG_JOINTS
    run: str = ""

    @property
    def outside(self) -> bool:
        """Whether the catalogue lacks it, so that "unexplained" is right and no name is."""
        return not self.effects

    def answers(self, at: str) -> list[tuple[str, str]]:
        """Return the right answers for the change at this place: effect, and pattern (fnmatch) of its place.

        Raises:
            ValueError: it can't stand there.
        """
        check_one_of("at", at, self.places)
        here = f"{at}@{self.run}" if self.run else at
        # A pattern of its own: "J~J_case", "J~J.second_mass", or whatever the inside of a joint is called.
        inside = f"{at}~{at}?*"
        return [(effect, inside if effect == "sensor_position" else here) for effect in self.effects]


def _to(**values: object) -> Callable[[Leg, Joint], None]:
    """Return what sets these fields of the joint."""

    def change(_leg: Leg, joint: Joint) -> None:
        for name, value in values.items():
            setattr(joint, name, value)

    return change


def _more(name: str, value: float) -> Callable[[Leg, Joint], None]:
    """Return what adds to this field of the joint."""

    def change(_leg: Leg, joint: Joint) -> None:
        setattr(joint, name, getattr(joint, name) + value)

    return change


def _whole(name: str, value: object) -> Callable[[Leg, Joint], None]:
    """Return what sets this field of the leg."""

    def change(leg: Leg, _joint: Joint) -> None:
        setattr(leg, name, value)

    return change


CHANGES: Mapping[str, Change] = {
    # Air in a gap of 0.2 mm: 0.026 W/(m K) / 0.2 mm.
    "paste_missing": Change(
        "the stator sits in its housing without heat paste",
        ("winding_mass", "second_mass", "hot_spot", "sensor_position"),
        _to(paste=130.0),
    ),
    "fan": Change("a fan of logged speed blows on one joint", ("fan",), _to(fan=3.0)),
    "wind": Change(
        "the leg travels through the air, no treadmill", ("forced_convection",), _whole("wind", True), EVERYWHERE
    ),
    "bracket": Change("an aluminium strut ties hip and calf", ("conduction",), _whole("strut", 0.6), UNLINKED),
    "tight_gearbox": Change("a gearbox is preloaded", ("coulomb_friction", "viscous_friction"), _more("dry", 0.9)),
    "standby": Change("a board draws power when nothing moves", ("constant_heat", "drive_heat"), _more("idle", 5.0)),
    "wrong_torque_constant": Change(
        f"in {ONE_RUN} a driver computes torque by a constant 20 % too large",
        ("loss_scale",),
        _to(scale=(ONE_RUN, 1.2)),
        run=ONE_RUN,
    ),
    "sun": Change("the sun shines on one joint", ("solar",), _to(sunlit=0.006)),
    "heat_sink": Change("a block of 0.35 kg is bolted on by a pad", ("second_mass",), _to(block_mass=0.35)),
    "loose_sensor": Change("a thermistor's glue is loose", ("sensor_lag", "sensor_loose"), _to(bead=70.0)),
    "sensor_offset": Change("a thermistor of the wrong type", ("sensor_offset",), _to(offset=3.0)),
    "sensor_drift": Change("a supply voltage creeps", ("sensor_drift",), _to(drift=4.0)),
    # A delay of the temperatures would be a lag as well; that they come before their cause can be nothing else.
    "clock": Change("the torques' clock is 20 s late", ("clock_offset",), _whole("clock", 20.0), EVERYWHERE),
    # Ferrite magnets: -0.2 %/K. The same law as copper's resistance, and the same joint.
    "weak_magnets": Change(
        "ferrite magnets, for which the driver's torque allows",
        ("torque_constant_drop", "resistance_rise"),
        _to(weakening=0.002),
    ),
    "cover": Change(f"a cloth on the housing in {ONE_RUN}", ("surface_scale",), _to(cover=(ONE_RUN, 0.4)), run=ONE_RUN),
    # Eddy currents go with the square of speed, as grease does.
    "shorted_sheets": Change("burrs short the stator's sheets", ("iron_loss", "viscous_friction"), _more("eddy", 0.15)),
    "damaged_transistor": Change("a transistor's voltage drops", ("driver_loss",), _to(drop=0.7)),
    "sensor_in_coil": Change(
        "the thermistor slipped towards the coil",
        ("hot_spot", "second_mass", "sensor_position"),
        _to(glued_to_coil=0.5),
    ),
    # --- what no catalogue has ---
    "draught": Change("a door opens, twice a run: cold air on one joint for minutes", (), _to(draught=-12.0)),
    "dragging_brake": Change("a brake drags for a minute or three, at random", (), _to(burst=7.0)),
    "heater": Change("a thermostat's heater, not logged, on for two minutes in five", (), _to(cycle=7.0)),
    "wax": Change("a pouch of wax melts at 37 degC", (), _to(wax=0.1)),
    "cracked_glue": Change("a reading jumps, once a run", (), _to(crack=3.0)),
}


def finite_volume_leg_logs(
    change: str | None = None,
    at: str = "",
    *,
    seed: int,
    computer: bool = False,
    steps: float = 0.1,
    noise: float = 0.05,
    logging: Logging = "sampled",
    cells: int = 1,
) -> dict[str, pd.DataFrame]:
    """Simulate two runs to fit and one to hold out, as ``leg_logs`` does, of a leg without lumped structure.

    Equal arguments give equal logs. Calls that differ only in ``change`` and ``at`` share dimensions, movements, noise.

    Args:
        change: a key of ``CHANGES``; ``None`` for a leg as it was built.
        at: one of the change's places; "" for its only one.
        seed: 0 or above; draws dimensions, movements, events and noise.
        computer: whether the leg hangs on a box with a computer of logged power.
        steps: what temperatures are rounded to, K: 1 or 0.1 in most drivers; 0 for none.
        noise: standard deviation of the temperatures before rounding, K.
        logging: of torque and speed, at 10 Hz: "sampled" at the instant, or the "mean" of the interval.
        cells: how much finer to cut.

    Returns:
        "fit1", "fit2" and "holdout", each with the columns time (s), torque.<joint> (N·m), velocity.<joint> (rad/s),
        speed.base (m/s), speed.fan (share of full speed), irradiance.global (W/m²), temperature.<joint> and
        temperature.ambient (degC); with a computer power.pc (W) and temperature.pc.

    Raises:
        ValueError: an argument outside its range, or a leg that passes 160 degC.
    """
    check_one_of("logging", logging, get_args(Logging))
    leg = draw_finite_volumes(seed, computer)
    if change is not None:
        check_one_of("change", change, CHANGES)
        hidden = CHANGES[change]
        place = at or (hidden.places[0] if len(hidden.places) == 1 else at)
        check_one_of(f"place of {change}", place, hidden.places)
        hidden.set(leg, leg.joints.get(place, Joint()))
    elif at:
        raise ValueError(f"at: found {at!r}; expected none without a change")
    sensor = Probe(noise, steps)
    return {name: _log(leg, name, run, seed, sensor, logging, cells) for name, run in draw_runs(seed).items()}


# --- one run -------------------------------------------------------------------------------------------------------

RIPPLE = 0.08  # of the current within a tenth of a second: impacts of the foot, and the controller's own
TORQUE_NOISE, VELOCITY_NOISE, POWER_NOISE = 0.04, 0.01, 0.2  # N·m, rad/s, W
READS = (0.5, 2.0)  # s between two readings of a driver's thermistor
PC_BEAD = 8.0  # s, the lag of the computer's sensor
WANDER, KNOT = 0.3, 600  # K, s: of the room's air
TOO_HOT = 160.0  # degC: insulation of class F has aged before


def _log(leg: Leg, name: str, run: Job, seed: int, sensor: Probe, logging: Logging, cells: int) -> pd.DataFrame:
    signals = draw_signals(run.segments, stream(seed, "movement", name))
    late = int(leg.clock)  # s by which the world goes on after the last row
    seconds, joints = run.seconds + late, list(leg.joints.values())
    light, blown = sun(run.seconds, seed, name), fan(run.seconds, seed, name)
    rng = stream(seed, "finite volumes", "air", name)
    air = run.ambient + _wander(rng, seconds, KNOT, WANDER)
    computer = PC_IDLE + (PC_BUSY - PC_IDLE) * mean((signals.base[:, None] != 0).astype(float), SAMPLES)[:, 0]
    computer = computer + _wander(rng, run.seconds, 30, 1.0)
    heat = _heat(joints, signals, light[:, 0], computer if leg.computer else None, seed, name)
    draughts = np.column_stack(
        [joint.draught * _open_doors(seed, name, at, seconds) for at, joint in leg.joints.items()]
    )
    zones = air[:, None] + np.pad(draughts, ((0, 0), (0, 1)))
    wind = mean(np.abs(signals.base[:, None]), SAMPLES)[:, 0] * leg.wind

    def goes_on(values: Array) -> Array:
        return np.pad(values, [(0, late)] + [(0, 0)] * (values.ndim - 1), mode="edge")

    assembly = assemble(leg, name, cells)
    start = air[0] + rng.uniform(0, 0.3)
    solution = solve(assembly, goes_on(heat), zones, goes_on(wind), goes_on(blown[:, 0]), start)
    T = solution.temperature
    if not np.all(T < TOO_HOT):
        raise ValueError(f"change: the leg passes {TOO_HOT:g} degC in {name}; expected a leg that survives")

    rng = stream(seed, "finite volumes", "logs", name)
    time = np.arange(run.seconds * SAMPLES) / SAMPLES
    torque, velocity = signals.torque, signals.velocity
    ripples, errors, turns = rng.standard_normal((3, *torque.shape))
    if logging == "sampled":
        torque = torque * (1 + RIPPLE * ripples)
    warm = np.column_stack([np.interp(time, np.arange(len(T)), T[:, magnet]) for magnet in assembly.magnets]) - 25
    scale = [joint.scale[1] if joint.scale[0] == name else 1.0 for joint in joints]
    torque = torque * (1 - warm * [joint.weakening for joint in joints]) * scale + TORQUE_NOISE * errors
    columns = {"time": time}
    columns |= by_place("torque", torque, LEG_JOINTS)
    columns |= by_place("velocity", velocity + VELOCITY_NOISE * turns, LEG_JOINTS)
    columns["speed.base"] = signals.base
    columns["speed.fan"] = blown[:, 0].repeat(SAMPLES)
    columns["irradiance.global"] = light[:, 0].repeat(SAMPLES)
    if leg.computer:
        columns["power.pc"] = computer.repeat(SAMPLES) + POWER_NOISE * rng.standard_normal(len(time))
    readings = _readings(leg, T @ assembly.reads.T, time, seed, name)
    places = (*LEG_JOINTS, PC)[: readings.shape[1]]
    columns |= by_place("temperature", sensor.read(readings, stream(seed, "sensors", name)), places)
    thermometer = np.interp(time, np.arange(len(air)), air)
    columns["temperature.ambient"] = np.round(thermometer, 1)
    return pd.DataFrame(columns)


def _wander(rng: np.random.Generator, seconds: int, knot: int, size: float) -> Array:
    """Return what wanders slowly around 0, in each second."""
    knots = size * rng.standard_normal(seconds // knot + 2)
    return np.interp(np.arange(seconds), knot * np.arange(len(knots)), knots)


def _heat(joints: list[Joint], signals: Signals, light: Array, computer: Array | None, seed: int, run: str) -> Array:
    """Return the heat of each of the assembly's sources in each second, W, at 25 degC."""
    force, speed = np.abs(signals.torque), np.abs(signals.velocity)
    square, fast, spin, power = (mean(values, SAMPLES) for values in (force**2, speed**2, speed, force * speed))
    current = mean(force, SAMPLES) / TORQUE_CONSTANT
    square = square * (1 + RIPPLE**2) / TORQUE_CONSTANT**2
    columns = []
    for k, (name, joint) in enumerate(zip(LEG_JOINTS, joints, strict=True)):
        columns += [
            joint.resistance * square[:, k],
            joint.hysteresis * spin[:, k] + joint.eddy * fast[:, k],
            joint.dry * spin[:, k] + joint.mesh * power[:, k],
            joint.grease * fast[:, k],
            joint.idle + joint.drop * current[:, k] + joint.on_resistance * square[:, k],
            joint.sunlit * light + joint.burst * _bursts(seed, run, name, len(light)),
        ]
        columns[-1] += joint.cycle * _cycle(seed, run, name, len(light))
    if computer is not None:
        columns.append(computer)
    return np.column_stack(columns)


def _open_doors(seed: int, run: str, at: str, seconds: int) -> Array:
    """Return 1 while a door is open: twice a run, 4 to 7 min, with half a minute to open and to shut."""
    rng, still = stream(seed, "door", run, at), np.zeros(seconds)
    for begin in rng.uniform(0.1, 0.4) * seconds, rng.uniform(0.55, 0.8) * seconds:
        end = begin + rng.uniform(240, 420)
        still += np.interp(np.arange(seconds), [begin, begin + 30, end, end + 30], [0, 1, 1, 0])
    return np.minimum(still, 1)


def _bursts(seed: int, run: str, at: str, seconds: int) -> Array:
    """Return 1 in bursts of 1 to 3 min at random times, some six an hour."""
    rng, on = stream(seed, "brake", run, at), np.zeros(seconds)
    for begin in rng.integers(60, seconds - 180, seconds // BURST_EVERY):
        on[begin : begin + rng.integers(60, 181)] = 1
    return on


def _cycle(seed: int, run: str, at: str, seconds: int) -> Array:
    """Return 1 for about two minutes in five."""
    rng = stream(seed, "thermostat", run, at)
    period, share, begin = rng.uniform(270, 360), rng.uniform(0.35, 0.5), rng.uniform(0, 300)
    on: Array = (((np.arange(seconds) + begin) % period) < share * period).astype(float)
    return on


def _readings(leg: Leg, touched: Array, time: Array, seed: int, run: str) -> Array:
    """Return what the thermistors show at these times, degC: late by their bead, held between the driver's readings."""
    beads = [joint.bead for joint in leg.joints.values()] + [PC_BEAD]
    shown = lagged(touched, np.array(beads[: touched.shape[1]]))
    rng = stream(seed, "finite volumes", "thermistors")
    columns = []
    for k in range(touched.shape[1]):
        period = rng.uniform(*READS)
        read_at = np.floor(time / period) * period + leg.clock
        columns.append(np.interp(read_at, np.arange(len(shown)), shown[:, k]))
    for k, (name, joint) in enumerate(leg.joints.items()):
        events = stream(seed, "glue", run, name)
        when, sign = events.uniform(0.2, 0.8) * time[-1], events.choice([-1.0, 1.0])
        columns[k] = columns[k] + joint.offset + joint.drift * time / 3600 + sign * joint.crack * (time > when)
    return np.column_stack(columns)
