"""Native code is taken from a folder that only its user can write to, and from no other."""

from __future__ import annotations

import ctypes
import errno
import os
import subprocess
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from lptn.basics.c_library import compiler, shared_library

SOURCES = {"one.c": "int one(void) { return 1; }\n"}

pytestmark = [
    pytest.mark.skipif(compiler() is None, reason="no C compiler on this machine"),
    pytest.mark.skipif(not hasattr(os, "getuid"), reason="no owners of files here"),
]


@pytest.fixture(autouse=True)
def cache(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    monkeypatch.setattr("platformdirs.user_cache_path", lambda name: tmp_path / name)
    return tmp_path / "lptn" / "native"


def compiled_apart(caplog: pytest.LogCaptureFixture) -> str:
    """Why a library was compiled for this process alone; it works, and the cache is as it was."""
    path = shared_library(SOURCES, "one.c", ())
    assert path.parent.name.startswith("lptn-native-")
    assert path.parent.stat().st_mode & 0o777 == 0o700
    assert ctypes.CDLL(str(path)).one() == 1
    (said,) = {record.getMessage() for record in caplog.records}
    return said.partition("; what is compiled")[0].partition(", so nothing")[0].rpartition(": ")[2]


def full(cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A disk on which nothing finds room any more."""
    cache.mkdir(parents=True, mode=0o700)

    def no_room(handle: int) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr("os.fsync", no_room)


def in_its_place(cache: Path, _: pytest.MonkeyPatch) -> None:
    """A file of the folder's name."""
    cache.parent.mkdir()
    cache.write_text("")


UNUSABLE: dict[str, tuple[Callable[[Path, pytest.MonkeyPatch], object], str]] = {
    "a full disk": (full, "No space left on device"),
    "a file in its place": (in_its_place, "File exists"),
    "a file above it": (lambda cache, _: cache.parent.write_text(""), "File exists"),
    "links in a circle": (lambda cache, _: cache.parent.symlink_to(cache.parent), "File exists"),
    "a link to nowhere": (lambda cache, _: cache.parent.symlink_to("/proc/nowhere"), "File exists"),
}


@pytest.mark.parametrize("kind", UNUSABLE)
def test_a_cache_that_can_t_be_written_costs_seconds_and_no_result(
    kind: str, cache: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    spoil, said = UNUSABLE[kind]
    spoil(cache, monkeypatch)
    assert said in compiled_apart(caplog)


def test_a_library_is_compiled_once_into_a_folder_of_one_s_own(cache: Path) -> None:
    path = shared_library(SOURCES, "one.c", ())
    assert path.parent == cache
    assert cache.stat().st_mode & 0o777 == 0o700
    made = path.stat().st_ino
    assert shared_library(SOURCES, "one.c", ()) == path
    assert path.stat().st_ino == made


def test_libraries_that_nobody_asked_for_in_a_month_are_removed(cache: Path) -> None:
    first = shared_library(SOURCES, "one.c", ())
    other = shared_library({"two.c": "int two(void) { return 2; }\n"}, "two.c", ())
    for path in (first, other):
        os.utime(path, (0, 0))
    assert shared_library(SOURCES, "one.c", ()) == first
    shared_library({"three.c": "int three(void) { return 3; }\n"}, "three.c", ())
    assert first.exists()
    assert not other.exists()
    assert len(list(cache.iterdir())) == 2


@pytest.mark.parametrize("mode", [0o777, 0o775, 0o702])
def test_no_library_is_taken_from_a_folder_that_others_can_write(
    cache: Path, mode: int, caplog: pytest.LogCaptureFixture
) -> None:
    shared_library(SOURCES, "one.c", ())
    cache.chmod(mode)
    assert compiled_apart(caplog) == "others can write to it"


def test_no_library_is_taken_from_another_user_s_folder(
    cache: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    shared_library(SOURCES, "one.c", ())
    mine = os.getuid()
    monkeypatch.setattr("os.getuid", lambda: mine + 1)
    assert compiled_apart(caplog) == "others can write to it"


@pytest.mark.parametrize("spoil", ["truncated", "other bytes", "empty"])
def test_a_library_that_is_not_whole_is_made_anew(spoil: str) -> None:
    path = shared_library(SOURCES, "one.c", ())
    content = path.read_bytes()
    path.write_bytes({"truncated": content[: len(content) // 2], "empty": b""}.get(spoil, b"\0" + content[1:]))
    again = shared_library(SOURCES, "one.c", ())
    assert ctypes.CDLL(str(again)).one() == 1
    assert [entry.name for entry in again.parent.iterdir()] == [again.name]


def test_a_link_in_the_cache_is_not_loaded(tmp_path: Path) -> None:
    path = shared_library(SOURCES, "one.c", ())
    elsewhere = tmp_path / "elsewhere.so"
    path.rename(elsewhere)
    path.symlink_to(elsewhere)
    assert not shared_library(SOURCES, "one.c", ()).is_symlink()
    assert elsewhere.exists()


def test_no_library_is_taken_through_a_link_into_a_folder_that_others_can_write(
    cache: Path, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    shared_library(SOURCES, "one.c", ())
    shared = tmp_path / "shared"
    shared.mkdir()
    cache.rename(shared / "native")
    cache.symlink_to(shared / "native")
    shared_library(SOURCES, "one.c", ())  # a link into a folder of one's own, on another disk perhaps, is fine
    shared.chmod(0o777)
    assert compiled_apart(caplog) == "others can write to it"
    shared.chmod(0o1777)  # as /tmp, where nobody can rename what others made
    shared_library(SOURCES, "one.c", ())


def script(path: Path, text: str) -> Path:
    path.write_text(f"#!/bin/sh\n{text}\n")
    path.chmod(0o700)
    return path


def test_a_compiler_with_flags(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    real = compiler()
    assert real is not None
    noted = script(tmp_path / "my cc", f'echo "$@" > "{tmp_path}/asked"; exec {real[0]} "$@"')
    monkeypatch.setenv("CC", f"'{noted}' -DTWO=2 -g0")
    path = shared_library({"two.c": "int two(void) { return TWO; }\n"}, "two.c", ("-O1",))
    assert ctypes.CDLL(str(path)).two() == 2
    assert (tmp_path / "asked").read_text().startswith("-DTWO=2 -g0 -O1")


@pytest.mark.parametrize("named", ["no-such-compiler -O2", "cc 'unclosed"])
def test_a_compiler_that_is_none(named: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CC", named)
    with pytest.raises(OSError, match="no C compiler"):
        shared_library(SOURCES, "one.c", ())


def test_a_compiler_that_hangs_is_stopped_with_all_it_started(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    hangs = script(tmp_path / "cc", f'sleep 600 & echo $! > "{tmp_path}/child"; wait')
    monkeypatch.setenv("CC", str(hangs))
    monkeypatch.setattr("lptn.basics.c_library._LONGEST", 0.5)
    with pytest.raises(OSError, match="no end of the compilation"):
        shared_library(SOURCES, "one.c", ())
    child = int((tmp_path / "child").read_text())
    for _ in range(100):
        try:
            os.kill(child, 0)
        except ProcessLookupError:
            return
        if Path(f"/proc/{child}/stat").exists() and Path(f"/proc/{child}/stat").read_text().split()[2] == "Z":
            return  # ended, and waits for whoever inherits it
        time.sleep(0.02)
    pytest.fail("what the compiler started is still there")


def test_a_compiler_that_waits_for_a_line_gets_none(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CC", str(script(tmp_path / "cc", "read line; exit 3")))
    with pytest.raises(subprocess.CalledProcessError):
        shared_library(SOURCES, "one.c", ())
