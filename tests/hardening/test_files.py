"""Files written whole or not at all, by one process or several, on disks that fill up, through pipes nobody reads."""

from __future__ import annotations

import errno
import multiprocessing
import os
import random
import subprocess
import sys
import time
from pathlib import Path

import pytest

from lptn.basics.errors import InputError, one_line
from lptn.basics.files import write_folder, write_whole
from lptn.cli.main import main

SIZE = 300_000


def test_a_link_is_followed_and_permissions_are_kept(tmp_path: Path) -> None:
    real, link = tmp_path / "real.toml", tmp_path / "link.toml"
    real.write_text("old")
    real.chmod(0o640)
    link.symlink_to(real)
    write_whole(link, "new")
    assert link.is_symlink()
    assert real.read_text() == "new"
    assert real.stat().st_mode & 0o777 == 0o640
    assert sorted(tmp_path.iterdir()) == [link, real]


def test_a_new_file_has_the_permissions_of_any_other(tmp_path: Path) -> None:
    (tmp_path / "plain").write_text("x")
    write_whole(tmp_path / "ours", "x")
    assert (tmp_path / "ours").stat().st_mode == (tmp_path / "plain").stat().st_mode


def test_what_is_no_plain_file_is_written_to_and_not_replaced(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    reader = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
    write_whole(pipe, "hello")
    assert os.read(reader, 10) == b"hello"
    os.close(reader)
    assert pipe.is_fifo()


def test_a_name_as_long_as_the_system_allows(tmp_path: Path) -> None:
    path = tmp_path / ("é" * 120 + ".json")
    write_whole(path, "x")
    assert path.read_text() == "x"
    assert len(list(tmp_path.iterdir())) == 1


@pytest.mark.parametrize("function", ["fsync", "fdopen"])
def test_a_full_disk_is_one_line_and_leaves_the_old_file(
    function: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "out.json"
    write_whole(path, "old")

    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, function, full)
    with pytest.raises(InputError, match="No space left"):
        write_whole(path, "new")
    with pytest.raises(InputError, match="No space left"):
        write_folder(tmp_path / "folder", {"a": "x", "b": "y"})
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_leftovers_of_a_killed_process_go_after_an_hour(tmp_path: Path) -> None:
    path = tmp_path / "out.json"
    young, old, others = (tmp_path / name for name in (".out.json.0123456789ab.part", ".out.json.ba9876543210.part",
                                                       ".out.json.notes.part"))  # fmt: skip
    for file in (young, old, others):
        file.write_text("half")
    for file in (old, others):
        os.utime(file, (time.time() - 4000,) * 2)
    write_whole(path, "whole")
    assert sorted(tmp_path.iterdir()) == sorted([path, young, others])


def test_a_folder_comes_whole_and_spares_what_else_is_in_it(tmp_path: Path) -> None:
    folder = tmp_path / "code"
    assert write_folder(folder, {"main.c": "1", "model.c": "2"}) == [folder / "main.c", folder / "model.c"]
    (folder / "Makefile").write_text("all:")
    write_folder(folder, {"main.c": "3", "model.c": "4"})
    contents = {path.name: path.read_text() for path in folder.iterdir()}
    assert contents == {"main.c": "3", "model.c": "4", "Makefile": "all:"}
    assert list(tmp_path.iterdir()) == [folder]


def _write_often(path: Path, letter: str, until: float) -> None:
    while time.time() < until:
        write_whole(path, letter * SIZE)


def test_of_two_processes_that_write_one_file_each_reader_sees_one(tmp_path: Path) -> None:
    path, until = tmp_path / "out.json", time.time() + 1.0
    write_whole(path, "a" * SIZE)
    context = multiprocessing.get_context("fork")
    writers = [context.Process(target=_write_often, args=(path, letter, until)) for letter in "abc"]
    for writer in writers:
        writer.start()
    seen = set()
    while time.time() < until:
        text = path.read_text()
        assert len(text) == SIZE
        assert text == text[0] * SIZE
        seen.add(text[0])
    for writer in writers:
        writer.join()
        assert writer.exitcode == 0
    assert len(seen) > 1
    assert list(tmp_path.iterdir()) == [path]


def _fill_slowly(folder: Path, letter: str) -> None:
    write_folder(folder, {f"{number}.c": letter * 1000 for number in range(8)})


def test_of_processes_that_fill_one_folder_the_last_wins_as_a_whole(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    at_once = Path.replace

    def slowly(path: Path, target: Path) -> Path:
        time.sleep(random.uniform(0.0, 0.01))
        return at_once(path, target)

    monkeypatch.setattr(Path, "replace", slowly)
    context = multiprocessing.get_context("fork")
    for trial in range(3):
        folder = tmp_path / f"code{trial}"
        writers = [context.Process(target=_fill_slowly, args=(folder, letter)) for letter in "abcd"]
        for writer in writers:
            writer.start()
        for writer in writers:
            writer.join()
            assert writer.exitcode == 0
        assert len({path.read_text() for path in folder.iterdir()}) == 1
        assert len(list(folder.iterdir())) == 8
    assert len(list(tmp_path.iterdir())) == 3


# --- what is printed ------------------------------------------------------------------------------


@pytest.mark.parametrize("words", [["effects"]])
def test_a_reader_that_goes_away_is_no_error(words: list[str]) -> None:
    started = subprocess.Popen([sys.executable, "-m", "lptn", *words], stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    assert started.stdout is not None
    assert started.stderr is not None
    started.stdout.close()
    assert started.stderr.read() == b""
    started.stderr.close()
    assert started.wait(60) == 0


def test_a_full_disk_behind_standard_output_is_one_line(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    if not Path("/dev/full").exists():
        pytest.skip("no /dev/full on this system")
    with Path("/dev/full").open("w") as full:
        monkeypatch.setattr(sys, "stdout", full)
        with pytest.raises(SystemExit) as stop:
            main(["new", "quadruped"])
    assert stop.value.code == 2
    assert capsys.readouterr().err == "lptn: system: No space left on device\n"


def test_a_message_does_nothing_to_the_terminal() -> None:
    said = str(InputError("a\x1b[2Jb\nc", "place\u202e", "found\0", "x" * 5000))
    assert said.isprintable()
    assert "\\x1b[2J" in said
    assert len(said) < 2000
    assert one_line("a \n\t b") == "a b"
