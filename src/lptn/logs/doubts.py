"""All that looks wrong in a log's columns."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from lptn.arrays import FloatArray
from lptn.logs.columns import ColumnSource
from lptn.logs.dead_sensors import suspect_readings
from lptn.logs.suspicions import Suspicion, suspect_all, suspect_time, suspect_units, suspect_wrap

_MOVES = 3.0  # K


def doubts_of(
    sources: Mapping[str, ColumnSource], numbers: Mapping[str, FloatArray], values: Mapping[str, FloatArray]
) -> tuple[Suspicion, ...]:
    """What looks wrong in a log's columns: another unit, a counter that wraps, a sensor that is dead.

    Args:
        sources: where the quantities stand, time among them.
        numbers: the file's columns, (n,) each, as they stand there.
        values: the quantities, (n,) each, in SI and degC.
    """
    time = values["time"]
    found = suspect_wrap("time", sources["time"], numbers[sources["time"].columns[0]])
    found = found or suspect_time(sources["time"], time)
    moved = {key: np.ptp(values[key][np.isfinite(values[key])]) for key in values if _is_read(key, values[key])}
    for key, source in sources.items():
        if key == "time":
            continue
        raw = numbers[source.columns[0]]
        odd = suspect_wrap(key, source, raw) or suspect_units(key, source, values[key])
        if not odd and key.startswith("temperature."):
            moving = any(moved[other] > _MOVES for other in moved if other != key)
            odd = suspect_readings(key, source, time, raw, values[key], moving)
        found += odd
    if not any(doubt.key.startswith("temperature.") for doubt in found):
        found += suspect_all(sources, values)
    return tuple(found)


def _is_read(key: str, values: FloatArray) -> bool:
    return key.startswith("temperature.") and bool(np.isfinite(values).any())
