"""Model files beyond any robot's are refused at once, with what was found and what is admitted."""

from __future__ import annotations

import os
import select
import threading
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from lptn.basics.errors import InputError
from lptn.model.file import read_model_file
from lptn.robots.presets import presets

GOOD = presets()["single-motor"]


def _nodes(count: int) -> str:
    return "".join(f"[nodes.n{k}]\ncapacity = 300\n" for k in range(count))


def _joints(count: int, more: str) -> str:
    names = ", ".join(f'"j{k}"' for k in range(count))
    return (
        f'[model]\nname = "m"\nambient = 25\njoints = [{names}]\n[nodes."*"]\ncapacity = 300\n'
        f'[[links]]\nbetween = ["*", "ambient"]\nresistance = 3\n{more}'
    )


def _heat_of_run(number: int) -> str:
    return f'[[effects]]\nkind = "constant_heat"\nat = "*"\nrun = "day{number}"\n'


HUGE: dict[str, tuple[Callable[[], str], str]] = {
    "60 MB of comment": (lambda: GOOD + "# comment\n" * 6_000_000, "bytes; expected at most 500,000"),
    "one line": (lambda: GOOD + "#" + "x" * 2_000_000, "bytes; expected at most 500,000"),
    "blanks": (lambda: GOOD + " \n" * 1_000_000, "bytes; expected at most 500,000"),
    "nodes": (lambda: GOOD + _nodes(3000), "3,002 nodes; expected at most 500"),
    "joints": (lambda: _joints(800, ""), "801 nodes; expected at most 500"),
    "links": (
        lambda: _joints(100, '[[links]]\nbetween = ["j*", "j*"]\nresistance = 3\n'),
        "links; expected at most 2,000",
    ),
    "effects": (lambda: _joints(150, "".join(map(_heat_of_run, range(60)))), "places; expected at most"),
    "levels": (lambda: GOOD + "a = " + "[" * 5000 + "]" * 5000, "TOML"),
    "dots": (lambda: GOOD + "a." * 5000 + "b = 1", "TOML"),
}


@pytest.mark.parametrize("kind", HUGE)
def test_what_no_robot_needs_is_refused_before_work_begins(kind: str, tmp_path: Path) -> None:
    text, said = HUGE[kind]
    path = tmp_path / "model.toml"
    path.write_text(text())
    begun = time.monotonic()
    with pytest.raises(InputError) as refused:
        read_model_file(path)
    assert said in str(refused.value)
    assert str(refused.value).startswith(f"{path}: ")
    assert time.monotonic() - begun < 20.0


def test_a_large_robot_is_read(tmp_path: Path) -> None:
    path = tmp_path / "model.toml"
    path.write_text(_joints(480, ""))
    assert len(read_model_file(path).network.dynamic) == 480


def test_windows_line_ends_and_a_byte_order_mark_are_text(tmp_path: Path) -> None:
    path = tmp_path / "model.toml"
    path.write_bytes(b"\xef\xbb\xbf" + GOOD.replace("\n", "\r\n").encode())
    assert read_model_file(path).text == GOOD


def test_a_pipe_that_nobody_writes_to_is_empty_and_one_that_somebody_does_is_read(tmp_path: Path) -> None:
    path = tmp_path / "model.toml"
    os.mkfifo(path)
    with pytest.raises(InputError):
        read_model_file(path)
    writer = threading.Thread(target=path.write_text, args=[GOOD])
    reader = os.open(path, os.O_RDONLY | os.O_NONBLOCK)  # with which the writer begins
    writer.start()
    while not select.select([reader], [], [], 1.0)[0]:
        pass
    assert read_model_file(path).text == GOOD
    writer.join()
    os.close(reader)
