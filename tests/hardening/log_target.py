"""Logs for the fuzzer."""

from __future__ import annotations

import gzip
import io
import tempfile
from collections.abc import Callable, Mapping
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
import pandas as pd

from lptn.virtual import leg_logs
from tests.hardening.mutations import spoil_bytes, spoil_csv
from tests.logs.ulog_bytes import FORMATS, definitions, esc_status, header

_SPOIL_BYTES = 0.5


@cache
def _log_table() -> pd.DataFrame:
    time = np.arange(0.0, 90.0, 0.5)
    hot = 25 + 10 * (1 - np.exp(-time / 60))
    return pd.DataFrame(
        {"time": time, "temperature.a": hot, "temperature.b": np.round(hot), "torque.a": 3 + np.sin(time),
         "current.b": 2.0, "velocity.a": np.cos(time), "temperature.ambient": 22.0, "power.pc": 20.0}
    ).round(4)  # fmt: skip


@cache
def logs() -> Mapping[str, bytes]:
    """One log in each format, plain and as other programs write it."""
    table = _log_table()
    text = table.to_csv(index=False)
    dated = table.assign(time=pd.Timestamp("2026-01-01") + pd.to_timedelta(table["time"], unit="s"))
    typed = table.astype({"torque.a": "float32", "power.pc": "int64"})
    files = {"log.csv": text.encode(), "log.csv.gz": gzip.compress(text.encode(), mtime=0)}
    files["dated.csv"] = dated.to_csv(index=False).encode()
    files["comma.csv"] = table.to_csv(index=False, sep=";", decimal=",").encode()
    for name, frame in (("log.parquet", table), ("dated.parquet", dated), ("typed.parquet", typed)):
        files[name] = _parquet(frame)
    return files | _recordings()


def _recordings() -> dict[str, bytes]:
    """A ROS 2 bag and a ULog, where the packages that read them are installed."""
    files = {}
    if find_spec("rosbags"):
        with tempfile.TemporaryDirectory() as name:
            from tests.truth.bags import write_bag

            files["bag.mcap"] = write_bag(Path(name) / "bag.mcap", leg_logs(seed=1)["holdout"][:300]).read_bytes()
    if find_spec("pyulog"):
        parts = [header(), definitions(FORMATS)]
        for k in range(300):
            slots = [(3000, 2.5, 40 + k // 100), (-600, 1.0, 35), (0, 0.0, 0), (0, 0.0, 0)]
            parts.append(esc_status(5 + 0.1 * k, 2, slots))
        files["flight.ulg"] = b"".join(parts)
    return files


def _parquet(table: pd.DataFrame) -> bytes:
    stream = io.BytesIO()
    table.to_parquet(stream, index=False)
    return stream.getvalue()


def spoil_log(random: Random, content: bytes, others: list[bytes]) -> bytes:
    if content.startswith((b"\x89MCAP", b"ULog")):
        return spoil_bytes(random, content)
    if content.startswith(b"PAR1"):
        return spoil_bytes(random, content) if random.random() < _SPOIL_BYTES else _odd_parquet(random)
    if content.startswith(b"\x1f\x8b"):
        if random.random() < _SPOIL_BYTES:
            return spoil_bytes(random, content)
        return gzip.compress(spoil_csv(random, gzip.decompress(content).decode()), mtime=0)
    return spoil_csv(random, content.decode())


def _odd_parquet(random: Random) -> bytes:
    """A whole Parquet file whose columns hold what no log holds."""
    table: Any = _log_table().copy()
    n = len(table)
    name = random.choice(list(table))
    odd: list[Callable[[], object]] = [
        lambda: pd.array([None] * n, dtype="Int64"),
        lambda: [str(value) for value in range(n)],
        lambda: [{"x": 1}] * n,
        lambda: [[1.0, 2.0]] * n,
        lambda: [b"\xff"] * n,
        lambda: [True, False] * (n // 2),
        lambda: pd.date_range("1700-01-01", periods=n, freq="D"),
        lambda: pd.date_range("2026-01-01", periods=n, freq="s", tz="Europe/Rome"),
        lambda: pd.to_timedelta(np.arange(n), unit="s"),
        lambda: pd.Categorical(["1", "2"] * (n // 2)),
        lambda: np.full(n, np.inf),
        lambda: np.full(n, np.nan),
        lambda: np.full(n, 1e308) * np.where(np.arange(n) % 2, 1, -1),
        lambda: np.arange(n, dtype=np.uint64) + np.uint64(2**63),
        lambda: np.arange(n)[::-1],
        lambda: np.zeros(n),
        lambda: np.arange(n) * 10.0 ** random.randrange(-18, 18),
        lambda: np.arange(n).astype("float16"),
    ]
    table[name] = random.choice(odd)()
    if random.random() < 0.2:
        table = table.iloc[: random.randrange(4)]
    return _parquet(table)


def read_some_log(path: Path, random: Random) -> None:
    """A log, read for all that it holds, or for what a model needs."""
    from lptn.logs.columns import parse_columns
    from lptn.logs.reading import read_log

    wanted = random.choice(((), ("torque_square.a",), ("torque_rms.a",), ("velocity.a", "power.pc")))
    columns = parse_columns({"temperature.c": {"column": "temperature.b", "unit": "degF"}}, "map", "columns")
    read_log(
        path,
        random.choice(({}, columns)),
        step=random.choice((None, 1.0, 5.0)),
        inputs=wanted,
        outputs=("temperature.a",) if wanted else (),
        optional=("current_rms.b", "velocity_rms.a") if wanted else (),
    )
