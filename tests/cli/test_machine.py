"""A machine that lacks something: characters, memory, a place to write. One line, and no traceback."""

from __future__ import annotations

import io
import os
import subprocess
import sys
from pathlib import Path

import pytest

from lptn.basics.errors import InputError
from lptn.basics.files import real_path
from lptn.cli import main as command
from lptn.cli.main import main
from lptn.cli.terminal import spared_closed_pipes
from lptn.robots.presets import presets
from tests.hardening.bad_inputs import table


@pytest.fixture
def desk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with a model and a log, in which the command runs."""
    monkeypatch.chdir(tmp_path)
    Path("model.toml").write_text(presets()["single-motor"])
    table().to_csv("log.csv", index=False)
    return tmp_path


def refused(words: str, capsys: pytest.CaptureFixture[str]) -> str:
    """The one line of a command that ends with status 2."""
    with pytest.raises(SystemExit) as stop:
        main(words.split())
    said = capsys.readouterr().err
    assert stop.value.code == 2
    assert said.count("\n") == 1
    return said


@pytest.mark.parametrize("encoding", ["ascii", "latin-1", "cp437", "utf-8"])
def test_a_terminal_without_our_characters_shows_numbers_and_names_all_the_same(
    encoding: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    bytes_ = io.BytesIO()
    monkeypatch.setattr(sys, "stdout", io.TextIOWrapper(bytes_, encoding=encoding, errors="strict"))
    with spared_closed_pipes():
        print("mean error −2.1 K at 30 °C, Knöchel", "half\udcff")
    said = bytes_.getvalue().decode(encoding)
    assert "2.1 K" in said
    assert "−" in said if encoding == "utf-8" else " -2.1 K" in said
    assert "half\\udcff" in said


@pytest.mark.parametrize("columns", [40, 80, 200])
def test_a_sentence_breaks_between_words_where_the_terminal_ends(
    columns: int, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    path = "/home/somebody/" + "a-long-folder/" * 8 + "better.toml"
    sentence = f"What is left is no more than the sensors' noise, and the best model was written to {path} as asked."
    monkeypatch.setenv("COLUMNS", str(columns))
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True)
    with spared_closed_pipes():
        print(sentence)
        print("first line\nsecond line")
    said = capsys.readouterr().out
    assert " ".join(said.split()) == f"{sentence} first line second line"
    assert all(len(line) <= columns or line == path for line in said.splitlines())
    assert said.endswith("first line\nsecond line\n")


def test_a_pipe_has_a_sentence_in_one_line(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setenv("COLUMNS", "40")
    with spared_closed_pipes():
        print("word " * 40)
    assert capsys.readouterr().out.count("\n") == 1


LOOPS = {
    "itself": {"x.toml": "x.toml"},
    "a circle": {"x.toml": "b", "b": "c", "c": "x.toml"},
    "a folder in itself": {"d": "d", "x.toml": "d/x"},
    "nowhere": {"x.toml": "nowhere/at/all"},
}
READERS = [
    "check {} log.csv",
    "check model.toml {}",
    "improve {} log.csv -o o.toml",
    "fmu {} -o o.fmu",
    "plan model.toml {} -o o.csv",
    "new --urdf {} -o o.toml",
    "motor {} -o o.toml",
    "trade {} --json o.json",
    "cosim {} log.csv",
    "report {} log.csv -o o.html",
]


@pytest.mark.parametrize("loop", LOOPS)
@pytest.mark.parametrize("words", READERS)
def test_a_link_that_leads_nowhere_is_no_file(
    words: str, loop: str, desk: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for link, target in LOOPS[loop].items():
        Path(link).symlink_to(target)
    assert "x.toml" in refused(words.format("x.toml"), capsys)
    assert not (desk / "nowhere").exists()


@pytest.mark.parametrize(
    "words", ["simulate model.toml log.csv -o {}", "improve model.toml log.csv -o o.toml --json {}"]
)
@pytest.mark.parametrize("result", ["loop.csv", "model.toml/x.csv", "x" * 300 + ".csv", "loop.csv/x.csv"])
def test_a_result_that_can_not_be_written_is_refused_before_the_work(
    result: str, words: str, desk: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    Path("loop.csv").symlink_to("loop.csv")
    before = sorted(desk.iterdir())
    assert ": output: found " in refused(words.format(result), capsys)
    assert sorted(desk.iterdir()) == before
    assert real_path(Path("loop.csv")).name == "loop.csv"


@pytest.mark.parametrize(
    "words", ["check {} log.csv", "motor {}", "new --urdf {}", "monitor model.toml log.csv --calibration {}"]
)
def test_a_device_without_end_is_not_read_to_its_end(
    words: str, desk: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for device in ("/dev/zero", "/dev/urandom"):
        assert "bytes; expected at most" in refused(words.format(device), capsys)


@pytest.mark.parametrize(
    ("raised", "said"),
    [
        (MemoryError("Unable to allocate 9 GiB for an array"), "not enough memory: Unable to allocate 9 GiB"),
        (ImportError("x.so: failed to map segment from shared object"), "not enough memory"),
        (RuntimeError("can't start new thread"), "not enough memory"),
        (RuntimeError(".../casadi/x.cpp:3: std::bad_alloc"), "not enough memory"),
        (ImportError("help\n\nOriginal error was: x.so: wrong ELF class"), "can't be loaded: Original error was: x.so"),
        (OSError(28, "No space left on device", "/tmp/x"), "/tmp/x: No space left on device"),
    ],
)
def test_what_the_machine_lacks_is_one_line(
    raised: Exception, said: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def ends(*_: object, **__: object) -> None:
        raise raised

    monkeypatch.setattr(command, "library_log_shown", ends)  # within it every command runs
    assert said in refused("effects", capsys)


def test_a_mistake_of_ours_keeps_its_traceback(monkeypatch: pytest.MonkeyPatch) -> None:
    def ends(*_: object, **__: object) -> None:
        raise RuntimeError("a bug")

    monkeypatch.setattr(command, "library_log_shown", ends)  # within it every command runs
    with pytest.raises(RuntimeError, match="a bug"):
        main(["effects"])


@pytest.mark.parametrize("words", ["check model.toml log.csv", "fit m.toml x.csv -o f.toml", "fmu model.toml -o m.fmu"])
def test_a_current_folder_that_is_gone_is_named(words: str, desk: Path) -> None:
    line = f"mkdir gone; cd gone; rmdir ../gone; exec {sys.executable} -m lptn.cli.main {words}"
    done = subprocess.run(["bash", "-c", line], capture_output=True, text=True, timeout=60)
    assert done.returncode == 2
    assert "Traceback" not in done.stderr
    assert done.stderr.startswith(("lptn: the current folder: ", "lptn: m")), (
        done.stderr
    )  # or the file, as none is there


@pytest.mark.parametrize("megabytes", [350, 700, 1000])
def test_a_limit_of_memory_that_no_library_can_live_with_is_said(megabytes: int, desk: Path) -> None:
    line = f"ulimit -v {megabytes * 1000}; exec {sys.executable} -m lptn.cli.main compare model.toml log.csv"
    done = subprocess.run(["bash", "-c", line], capture_output=True, text=True, timeout=60)
    assert done.returncode == 2
    assert done.stderr.startswith("lptn: not enough memory: `ulimit -v` allows ")
    assert done.stderr.count("\n") == 1


@pytest.mark.parametrize("capacity", [1e-3, 1e-4, 1e-5, 1e-6])
@pytest.mark.parametrize(
    "words", ["compare model.toml log.csv", "simulate model.toml log.csv -o o.csv", "monitor model.toml log.csv"]
)
def test_a_node_too_quick_for_the_logs_steps_is_named(
    words: str, capacity: float, desk: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = presets()["single-motor"].replace("value = 300", f"value = {capacity}").replace("[20, 3000]", "[0, 3000]")
    Path("model.toml").write_text(text)
    said = refused(words, capsys)
    assert said.startswith("lptn: model.toml: motor: found a time constant of ")
    assert "in a log of steps of 1 s" in said


@pytest.mark.parametrize("bad", ["x\0y", "x" * 5000, "d/" * 3000])
def test_a_path_that_no_system_has_is_a_line(bad: str) -> None:
    from lptn.model.file import read_model_file

    with pytest.raises(InputError):
        read_model_file(Path(bad))


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("MPLBACKEND", "nonsense"),
        ("MPLCONFIGDIR", "circle"),
        ("MPLBACKEND", "module://nowhere"),
        ("MATPLOTLIBRC", "rc"),
    ],
)
def test_a_library_that_does_not_come_up_in_this_environment(desk: Path, name: str, value: str) -> None:
    """matplotlib asks the environment as it is imported, and raises errors of many kinds."""
    Path("circle").symlink_to("circle")
    Path("rc").write_bytes(b"\xff\xfe\x00")
    words = ["-m", "lptn", "forecast", "model.toml", "log.csv", "--limit", "60", "--plot", "out.png"]
    environment = os.environ | {name: value}
    ended = subprocess.run([sys.executable, *words], env=environment, capture_output=True, text=True, check=False)
    assert ended.returncode in (0, 2)
    assert "Traceback" not in ended.stderr
    if ended.returncode:
        assert "lptn: a library can't be loaded: " in ended.stderr


_ENDS = """
import atexit, os, sys, threading
sys.argv = ["lptn", *sys.argv[1:]]
atexit.register(print, "handlers run")
from lptn.cli.main import main
class Slow:  # what a thread lets go of after the command is done with it
    def __del__(self): os.write(2, b"let go of at the end")
held = Slow(); held.itself = held
main()
"""


@pytest.mark.parametrize(("words", "status"), [("effects", 0), ("--version", 0), ("fit --x", 2), ("check m.toml", 2)])
def test_a_command_ends_the_process_without_taking_the_interpreter_down(words: str, status: int) -> None:
    """Arrow's threads, which need it to let go of a file's bytes, would abort it: in 7 of 120 on a busy machine."""
    words_given = [sys.executable, "-c", _ENDS, *words.split()]
    ended = subprocess.run(words_given, capture_output=True, text=True, check=False)
    assert ended.returncode == status
    assert ended.stdout.endswith("handlers run\n")
    assert "let go" not in ended.stderr
