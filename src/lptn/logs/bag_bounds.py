"""Compressed bags decompressed within bounds: a few kilobytes must not fill the memory or the disk."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any, BinaryIO

_MOST = 1 << 30  # bytes of a chunk, or of a message; recorders make chunks of some megabytes
_SHARE = 0.5  # of the disk's free space that a bag may take while it is read
_PIECE = 1 << 20
_WAYS = ("lz4", "zstd")

Decompress = Callable[[bytes, int], bytes]


@contextmanager
def bounded() -> Iterator[None]:
    """Within it rosbags decompresses no chunk beyond the size that it declares, and nothing beyond 1 GiB.

    The library has no such option; its own functions are put back afterwards.
    """
    from rosbags.rosbag2 import reader, storage_mcap

    chunks: dict[str, Any] = storage_mcap.DECOMPRESSORS
    usual = {way: chunks[way] for way in _WAYS}
    zstd = getattr(reader, "zstd", None)  # older versions use another package: only their lz4 is bounded
    chunks["lz4"] = _lz4
    if zstd is not None:
        chunks["zstd"] = lambda data, size: _within(zstd.ZstdDecompressor(), data, size)
        vars(reader)["zstd"] = SimpleNamespace(
            decompress=lambda data: _within(zstd.ZstdDecompressor(), data, _MOST),
            open=lambda stream, mode: _File(zstd.open(stream, mode)),
        )
    try:
        yield
    finally:
        chunks.update(usual)
        if zstd is not None:
            vars(reader)["zstd"] = zstd


def _lz4(data: bytes, size: int) -> bytes:
    from lz4.frame import LZ4FrameDecompressor  # type: ignore[import-untyped]

    return _within(LZ4FrameDecompressor(), data, size)


def _within(decompressor: Any, data: bytes, size: int) -> bytes:
    """Data decompressed, one frame of at most `size` bytes.

    Raises:
        ValueError: it is more, or ends before the frame does.
    """
    if not 0 <= size <= _MOST:
        raise ValueError(f"{size} bytes in one piece, of which {_MOST} at most are taken")
    found: bytes = decompressor.decompress(bytes(data), max_length=size + 1)
    if len(found) > size:
        raise ValueError(f"a piece of more than the {size} bytes that it may have")
    if not decompressor.eof:
        raise ValueError("a compressed piece that is cut off")
    return found


class _File:
    """A compressed file that is read up to half of the disk's free space."""

    def __init__(self, stream: BinaryIO) -> None:
        self._stream = stream
        self._left = int(_SHARE * shutil.disk_usage(Path(tempfile.gettempdir())).free)

    def __enter__(self) -> _File:
        return self

    def __exit__(self, *_: object) -> None:
        self._stream.close()

    def read(self, size: int = _PIECE) -> bytes:
        piece = self._stream.read(size)
        self._left -= len(piece)
        if self._left < 0:
            raise ValueError("a compressed file of more than half of the disk's free space")
        return piece
