"""Make the logs of a quadruped with twelve joints and an onboard computer."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Required, TypedDict, Unpack, get_args

import pandas as pd

from .further import Columns
from .hidden import Hidden
from .plans import Plan, plan
from .quadruped_truth import Level, Physics, draw_quadruped
from .record import Record, live
from .robot import Robot
from .rows import rows
from .runs import Run
from .sensors import Sensor
from .writers import Format, write_logs, write_pieces

RATES = (1.0, 100.0)  # Hz

Effects = Sequence[Hidden | tuple[str, str] | tuple[str, str, float] | tuple[str, str, float, str]]


class Options(TypedDict, total=False):
    """Options that ``quadruped_logs`` and ``write_quadruped`` share; the former says what they mean."""

    seed: Required[int]
    runs: Plan | Mapping[str, Run]
    level: Level | None
    physics: Physics
    noise: float
    quantisation: float
    dropouts: float
    scatter: float
    rate: float
    columns: Columns


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
    runs: Plan | Mapping[str, Run] = "protocol",
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
    where no cut-out comes between (there is none in "trial").

    Args:
        hidden: effects beyond the physics: ``Hidden`` or tuples (effect, place), (effect, place, size) or (effect,
            place, size, run).
        seed: 0 or above; draws parameters, movements, events and noise.
        runs: a plan's name: "protocol" (table 1: 25 runs), "tests" (table 3 and the multi-gait test: 7 runs), "trial"
            (60 min twice to fit, 40 min to hold out), "hour" (30 min twice to fit), "swing" (as "trial", with an
            ambient that steps by 8 K), "forecast" (20 trots past 60 degC), "monitor" (50 healthy logs, 50 with a
            sensor's fault); or runs of your own by name.
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
    robot, happened = _happen(
        hidden,
        seed=seed,
        runs=runs,
        level=level,
        physics=physics,
        noise=noise,
        quantisation=quantisation,
        dropouts=dropouts,
        scatter=scatter,
        rate=rate,
        columns=columns,
    )
    logs = Logs(robot)
    for record, pieces in happened:
        logs[record.name] = pd.concat(pieces, ignore_index=True)
        logs.truth[record.name] = record.truth()
    return logs


def write_quadruped(
    folder: str | Path,
    hidden: Effects = (),
    *,
    format: Format = "parquet",  # noqa: A002
    truth: bool = False,
    **options: Unpack[Options],
) -> list[Path]:
    """Write the logs of ``quadruped_logs`` to ``<folder>/<name>.<format>``, holding 10 min of samples at most.

    Args:
        folder: made if it isn't there; files in it are replaced.
        hidden: as for ``quadruped_logs``.
        format: "parquet", "csv" or "mcap"; the last needs the package rosbags.
        truth: write what no log holds, too, to ``<folder>/truth/<name>.parquet``.
        options: as for ``quadruped_logs``.

    Returns:
        The logs' files.

    Raises:
        ValueError: an argument outside its range, or effects so large that the robot passes 150 degC.
        OSError: the folder can't be written to.
    """
    _, happened = _happen(hidden, **options)

    def logs() -> Iterator[tuple[str, Iterable[pd.DataFrame]]]:
        for record, pieces in happened:
            yield record.name, pieces
            if truth:
                write_logs(Path(folder) / "truth", {record.name: record.truth()})

    return write_pieces(folder, logs(), format)


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


def _happen(
    hidden: Effects,
    *,
    seed: int,
    runs: Plan | Mapping[str, Run] = "protocol",
    level: Level | None = None,
    physics: Physics = "full",
    noise: float = 0.15,
    quantisation: float = 1.0,
    dropouts: float = 0.0,
    scatter: float = 1.0,
    rate: float = 1.0,
    columns: Columns = "asked",
) -> tuple[Robot, Iterator[tuple[Record, Iterator[pd.DataFrame]]]]:
    """Check the options; return the robot, and each run's record with the pieces of its log, made when asked for."""
    if rate not in RATES:
        raise ValueError(f"rate: found {rate:g}; expected one of {', '.join(f'{r:g}' for r in RATES)} Hz")
    if columns not in get_args(Columns):
        raise ValueError(f"columns: found {columns!r}; expected one of {', '.join(get_args(Columns))}")
    sensor = Sensor(noise, quantisation, dropouts)
    planned = runs if isinstance(runs, Mapping) else plan(runs, seed)
    robot = quadruped(hidden, seed=seed, physics=physics, scatter=scatter)
    robot.check_runs(planned)
    usual: Level = "none" if physics == "plain" else "default"
    records = live(robot, planned, seed, level or usual)
    return robot, ((record, rows(record, sensor, seed, rate, every=columns == "all")) for record in records)
