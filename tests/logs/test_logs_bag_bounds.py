"""Bags that decompress to far more than they are: refused before they fill the memory."""

from __future__ import annotations

import io
import struct
import tracemalloc
from collections.abc import Callable
from pathlib import Path

import lz4.frame  # type: ignore[import-untyped]
import pytest

from lptn.logs.reading import read_log

storage = pytest.importorskip("rosbags.rosbag2.storage_mcap")
reader = pytest.importorskip("rosbags.rosbag2.reader")

Refuse = Callable[..., str]
_MAGIC = b"\x89MCAP0\r\n"
_SIZE = 256 << 20  # bytes that a bomb unfolds to
_COMPRESSED = {"zstd": reader.zstd.compress, "lz4": lz4.frame.compress}


def write_chunk(path: Path, way: str, data: bytes, declared: int) -> None:
    """An MCAP file of one chunk without an index, as a recorder that was killed leaves it."""
    out, header, chunk, footer = (io.BytesIO() for _ in range(4))
    out.write(_MAGIC)
    for text in ("ros2", "test"):
        storage.write_string(header, text)
    storage.write_record(out, 1, header)
    chunk.write(struct.pack("<QQQI", 0, 1, declared, 0))
    storage.write_string(chunk, way)
    chunk.write(struct.pack("<Q", len(data)) + data)
    storage.write_record(out, 6, chunk)
    footer.write(struct.pack("<QQI", 0, 0, 0))
    storage.write_record(out, 2, footer)
    path.write_bytes(out.getvalue() + _MAGIC)


@pytest.mark.parametrize("way", ["zstd", "lz4"])
@pytest.mark.parametrize(("declared", "said"), [(1000, "more than the 1000 bytes"), (1 << 40, "in one piece")])
def test_a_chunk_that_unfolds_to_more_than_it_may(
    tmp_path: Path, refuse: Refuse, way: str, declared: int, said: str
) -> None:
    path = tmp_path / "bomb.mcap"
    write_chunk(path, way, _COMPRESSED[way](bytes(_SIZE)), declared)
    tracemalloc.start()
    try:
        assert said in refuse(path, read_log, path)
        assert tracemalloc.get_traced_memory()[1] < _SIZE / 4
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize("way", ["zstd", "lz4"])
def test_a_chunk_that_is_cut_off(tmp_path: Path, refuse: Refuse, way: str) -> None:
    whole = _COMPRESSED[way](bytes(range(256)) * 8)
    write_chunk(tmp_path / "cut.mcap", way, whole[:-6], 2048)
    assert "cut off" in refuse(tmp_path / "cut.mcap", read_log, tmp_path / "cut.mcap")


def test_a_bag_compressed_as_a_whole_may_not_fill_the_disk(
    tmp_path: Path, refuse: Refuse, monkeypatch: pytest.MonkeyPatch
) -> None:
    rosbag2 = pytest.importorskip("rosbags.rosbag2")
    writer = rosbag2.Writer(tmp_path / "bag", version=9)
    writer.set_compression(rosbag2.CompressionMode.FILE, rosbag2.CompressionFormat.ZSTD)
    with writer:
        pass
    monkeypatch.setattr("lptn.logs.bags._SHARE", 0.0)
    assert "half of the disk" in refuse(tmp_path / "bag", read_log, tmp_path / "bag")
