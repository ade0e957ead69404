"""Write down what the quadruped's sensors show: the rows of a log."""

from __future__ import annotations

from collections.abc import Collection, Iterator

import numpy as np
import pandas as pd

from .events import sensor_steps
from .faults import shift, spoil
from .forcing import copper_loss
from .further import common, wanted
from .motion import SAMPLES
from .quadruped_truth import JOINTS, NODES
from .record import Record
from .robot import Array
from .sensors import Sensor
from .shown import shown
from .streams import stream

CHUNK = 600  # s of 100 Hz rows at a time, which bounds the memory
TORQUE_NOISE = 0.02  # relative, of each second and joint


def rows(record: Record, sensor: Sensor, seed: int, rate: float, *, every: bool = False) -> Iterator[pd.DataFrame]:
    """Yield a log in pieces, whole seconds each: all of it at 1 Hz, 10 min at a time at 100 Hz.

    ``every``: with the columns that no hidden effect asks for, too.
    """
    seconds = record.run.seconds
    seen = shown(record.network, record.states, copper_loss(record.robot, record.motion.means()))
    steps = sensor_steps(record.robot, seconds, seed, record.name)[:, : len(NODES)]
    noise = stream(seed, "torque", record.name).standard_normal((seconds, len(JOINTS)))
    reader = _Reader(record, sensor, seed, seen, steps, 1 + TORQUE_NOISE * noise, wanted(record.robot, every=every))
    if rate == 1:
        yield reader.slow()
        return
    for begin in range(0, seconds, CHUNK):
        piece = reader.fast(begin, min(begin + CHUNK, seconds))
        # Half the size, and finer than any sensor; only time would lose.
        yield piece.astype({name: np.float32 for name in piece if name != "time"})


class _Reader:
    """Reads one run.

    shown, steps: K, of shape (seconds + 1, nodes) and (seconds, nodes). gain: of the torque. further: extra columns.
    """

    def __init__(
        self,
        record: Record,
        sensor: Sensor,
        seed: int,
        shown: Array,
        steps: Array,
        gain: Array,
        further: Collection[str],
    ) -> None:
        self.record, self.sensor, self.seed = record, sensor, seed
        self.shown, self.steps, self.gain, self.further = shown, steps, gain, further
        motion = record.motion
        self.common = {
            name: values for name, values in common(motion.common(motion.means())).items() if name in further
        }
        self.frozen = self._frozen()

    def slow(self) -> pd.DataFrame:
        """Return the log at 1 Hz: temperatures at each row's time, means over the second that follows."""
        motion, means = self.record.motion, self.record.motion.means()
        time = np.arange(len(motion.base), dtype=float)
        moves = {
            "torque": np.sqrt(means.torque2) * self.gain,
            "velocity": means.speed,
            "velocity_rms": np.sqrt(means.speed2),
        }
        # A reader can't form these from the others once the signs are gone.
        further = {"torque_abs": means.torque1 * self.gain, "mechanical_power": means.power * self.gain}
        moves |= {name: values for name, values in further.items() if name in self.further}
        return self._table(time, moves, motion.base, self.shown[:-1] + self.steps, "slow")

    def fast(self, begin: int, end: int) -> pd.DataFrame:
        """Return the log's samples at 100 Hz from second ``begin`` to ``end``."""
        time = np.arange(begin * SAMPLES, end * SAMPLES) / SAMPLES
        torque, velocity = self.record.motion.samples(begin, end)
        torque *= self.gain[begin:end].repeat(SAMPLES, axis=0)
        part = (np.arange(SAMPLES) / SAMPLES)[None, :, None]
        now, then = self.shown[begin:end, None, :], self.shown[begin + 1 : end + 1, None, :]
        shown = (now + part * (then - now) + self.steps[begin:end, None, :]).reshape(len(time), -1)
        base = self.record.motion.base[begin:end].repeat(SAMPLES)
        return self._table(time, {"torque": torque, "velocity": velocity}, base, shown, str(begin))

    def _table(self, time: Array, moves: dict[str, Array], base: Array, shown: Array, piece: str) -> pd.DataFrame:
        record, second = self.record, time.astype(int)
        faults = record.run.faults
        shift(faults, time, shown)
        readings = self.sensor.read(shown, stream(self.seed, "sensors", record.name, piece))
        spoil(faults, time, readings, self.frozen)
        columns = {"time": time}
        for quantity, values in moves.items():
            columns |= {f"{quantity}.{joint}": values[:, i] for i, joint in enumerate(JOINTS)}
        columns["speed.base"] = base
        columns |= {f"powered.{joint}": record.motion.powered[second, i] for i, joint in enumerate(JOINTS)}
        columns["power.pc"] = record.motion.pc[second]
        columns |= {name: values[second, 0] for name, values in self.common.items()}
        columns |= {f"temperature.{node}": readings[:, i] for i, node in enumerate(NODES)}
        columns["temperature.ambient"] = np.interp(time, np.arange(len(self.shown)), record.ambient.logged)
        return pd.DataFrame(columns)

    def _frozen(self) -> Array:
        """Return the reading at the beginning of each fault: what a stuck sensor keeps on showing."""
        faults = self.record.run.faults
        held = []
        for k, fault in enumerate(faults):
            second = min(int(fault.time), len(self.steps) - 1)
            shown = self.shown[second : second + 1] + self.steps[second]
            shift(faults, np.array([fault.time]), shown)
            # Without gaps: a stuck sensor shows something.
            whole = Sensor(self.sensor.noise, self.sensor.quantisation)
            reading = whole.read(shown, stream(self.seed, "stuck", self.record.name, str(k)))
            held.append(reading[0, NODES.index(fault.at)])
        return np.array(held)
