"""Files read as text, files written whole or not at all, and numbers as JSON can hold them."""

from __future__ import annotations

import hashlib
import math
import os
import secrets
import shutil
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, BinaryIO

from lptn.basics.bounds import TEXT, Bound
from lptn.basics.errors import InputError
from lptn.basics.words import listed

# --- Results as JSON can hold them ----------------------------------------------------------------


def finite(content: Any) -> Any:
    """The same without NaN and infinite numbers, which JSON does not know: `None` in their place."""
    if isinstance(content, Mapping):
        return {key: finite(value) for key, value in content.items()}
    if isinstance(content, list | tuple):
        return [finite(value) for value in content]
    return None if isinstance(content, float) and not math.isfinite(content) else content


# --- Files as they are read -----------------------------------------------------------------------


def bytes_of(path: Path, bound: Bound, expected: str) -> bytes:
    """The content of a user's file, which may be a pipe or a device without end.

    Args:
        path: the file.
        bound: how much of it is read.
        expected: what it should have been, for the message.

    Raises:
        InputError: there is no such file, it can't be read, or it holds more than the bound.
    """
    content = bytearray()
    try:
        with open(path, "rb", opener=_without_waiting) as stream:
            while len(content) <= bound.most and (chunk := stream.read(1 << 20)):  # bytes at once
                content += chunk
            size = max(len(content), os.fstat(stream.fileno()).st_size)
    except (OSError, ValueError) as error:  # a ValueError of a path with a zero byte in it
        raise InputError(path, "file", getattr(error, "strerror", None) or str(error), expected) from error
    bound.check(size, path, "file")
    return bytes(content)


def _without_waiting(path: str, flags: int) -> int:
    """A file opened. A pipe without an end is empty, or can't be written to: to wait for one might have no end."""
    handle = os.open(path, flags | getattr(os, "O_NONBLOCK", 0))  # which Windows lacks
    os.set_blocking(handle, True)
    return handle


def text_of(path: Path, expected: str) -> str:
    """The text of a user's file, in UTF-8 with or without a byte order mark.

    Raises:
        InputError: see `bytes_of`; or it is no text.
    """
    try:
        text = bytes_of(path, TEXT, expected).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(path, "file", "bytes that are not UTF-8 text", expected) from error
    return text.replace("\r\n", "\n").replace("\r", "\n")


def real_path(path: Path) -> Path:
    """Where a path leads, links followed. A circle of links leads nowhere and stays as it is; `resolve` would raise."""
    return Path(os.path.realpath(path))


def fingerprint(path: Path) -> str:
    """The SHA-256 of a file's bytes, as hexadecimal digits."""
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


# --- Files written whole or not at all ------------------------------------------------------------
# A file is written under another name in the same folder, forced to the disk and renamed; then the folder is forced
# to the disk. A kill, a full disk or a power cut leaves the old file or the new one, and of two processes that write
# one file the last wins as a whole. All that a kill can leave is `.<name>.<random>.part`, which nobody reads; the next
# write of the same file removes those older than an hour.


try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]


def write_whole(path: Path, content: str | bytes) -> None:
    """Write `content` to `path` so that a crash leaves either the old file or the new one.

    A link is followed, the permissions of a file that is replaced are kept, and what is no plain file (`/dev/stdout`, a
    pipe) is written to as it stands.

    Raises:
        InputError: the folder does not exist or can't be written, or the disk is full.
    """
    data = _bytes(content)
    try:
        target = _real(path)
        if target.exists() and not target.is_file():
            with open(target, "wb", opener=_without_waiting) as stream:
                stream.write(data)
            return
        with whole_file(target) as stream:
            stream.write(data)
    except OSError as error:
        raise _cannot_write(path, error) from error


@contextmanager
def whole_file(target: Path) -> Iterator[BinaryIO]:
    """A file that is written piece by piece, and has its name once the block ends; where that raises there is none.

    Raises:
        OSError: it can't be written, or the disk is full.
    """
    with _part(target) as (part, stream):
        yield stream
    try:
        part.replace(target)
    except BaseException:
        part.unlink(missing_ok=True)
        raise
    _force_to_disk(target.parent)
    _remove_abandoned(target)


def write_folder(folder: Path, contents: Mapping[str, str | bytes]) -> list[Path]:
    """Write files that belong together.

    A new folder appears with all of them or not at all. In one that stands already, which may hold other files too, all
    are on the disk before the first takes its place, and no other process's come between.

    Args:
        folder: where to; made where it is missing, in a folder that exists.
        contents: by file name, in the order in which they take their places.

    Returns:
        The files, in order.

    Raises:
        InputError: the folder can't be written, or the disk is full.
    """
    data = {name: _bytes(content) for name, content in contents.items()}
    try:
        target = _real(folder)
        if target.exists() or not _make_folder(target, data):
            _fill(target, data)
    except OSError as error:
        raise _cannot_write(folder, error) from error
    return [folder / name for name in contents]


def _make_folder(folder: Path, contents: Mapping[str, bytes]) -> bool:
    """Make a folder whole under another name; `False` if somebody else has made one of its name meanwhile."""
    fresh = folder.parent / _temporary_name(folder.name)
    fresh.mkdir()
    try:
        _fill(fresh, contents)
        try:
            fresh.rename(folder)
        except OSError:
            if not folder.is_dir():
                raise
            return False
    finally:
        shutil.rmtree(fresh, ignore_errors=True)  # unless it has its name
    _force_to_disk(folder.parent)
    return True


def _fill(folder: Path, contents: Mapping[str, bytes]) -> None:
    """Put files into a folder that exists, all under their other names before one under its own."""
    parts: dict[str, Path] = {}
    try:
        for name, data in contents.items():
            with _part(folder / name) as (parts[name], stream):
                stream.write(data)
        with _locked(folder):
            for name, part in parts.items():
                part.replace(folder / name)
    finally:
        for part in parts.values():
            part.unlink(missing_ok=True)
    _force_to_disk(folder)


@contextmanager
def _locked(folder: Path) -> Iterator[None]:
    """Within it other processes that fill the folder wait, where the system has such locks; they end with a process."""
    if fcntl is None:
        yield
        return
    handle = os.open(folder, os.O_RDONLY)
    try:
        with suppress(OSError):  # a file system without locks
            fcntl.flock(handle, fcntl.LOCK_EX)
        yield
    finally:
        os.close(handle)


def held(path: Path) -> int | None:
    """Hold a file as long as this process lives, however it ends.

    Args:
        path: an empty file, made where it is missing.

    Returns:
        A descriptor, whose closing lets go; `None` if another process, or another call here, holds it.

    Raises:
        OSError: it can't be made.
    """
    handle = os.open(path, os.O_RDWR | os.O_CREAT, 0o600)
    if fcntl is not None:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            os.close(handle)
            return None
        except OSError:  # a file system without locks
            pass
    return handle


def _bytes(content: str | bytes) -> bytes:
    # A lone surrogate comes from a file name that is no UTF-8: it must not cost the whole report.
    return content.encode("utf-8", "backslashreplace") if isinstance(content, str) else content


def _real(path: Path) -> Path:
    return real_path(path) if path.is_symlink() else path


@contextmanager
def _part(target: Path) -> Iterator[tuple[Path, BinaryIO]]:
    """A file under another name, and a stream into it; once the block ends, it is on the disk with its permissions."""
    part = target.parent / _temporary_name(target.name)
    handle = os.open(part, os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0), 0o666)
    try:
        with os.fdopen(handle, "wb") as stream:
            yield part, stream
            stream.flush()
            os.fsync(stream.fileno())
        with suppress(FileNotFoundError):
            part.chmod(target.stat().st_mode & 0o777)
    except BaseException:
        part.unlink(missing_ok=True)
        raise


def _temporary_name(name: str) -> str:
    return f"{_beginning(name)}{secrets.token_hex(6)}.part"


def _beginning(name: str) -> str:
    return f".{name[:48]}."  # of a character four bytes at most, and a name may have 255


def _force_to_disk(folder: Path) -> None:
    """Force a folder's names to the disk, where the system can."""
    with suppress(OSError):
        handle = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)


def _remove_abandoned(target: Path) -> None:
    """Remove what killed processes left of the same file."""
    beginning, oldest = _beginning(target.name), time.time() - 3600.0  # s; no writer takes so long to rename its file
    with suppress(OSError):
        for path in target.parent.iterdir():
            left = path.name.startswith(beginning) and path.name.endswith(".part")
            if left and len(path.name) == len(beginning) + 17 and path.stat().st_mtime < oldest:
                path.unlink()


def _cannot_write(path: Path, error: OSError) -> InputError:
    expected = "a file that can be written, in a folder that exists"
    return InputError(path, "output", error.strerror or str(error), expected)


TABLES, PICTURES = (".csv", ".parquet"), (".png", ".svg", ".pdf")
"""Endings of the tables and figures that can be written."""


def check_ending(path: Path, *endings: str) -> None:
    """Refuse a file of a kind that can't be written.

    Raises:
        InputError: its name ends in none of the endings.
    """
    if path.suffix.lower() not in endings:
        problem = f"a file name ending in '{path.suffix}'"
        raise InputError(path, "output", problem, f"one ending in {listed(endings, 'or')}")
