"""The terminal: no name is cut, the library's warnings are seen, a file may be called -x.csv."""

from __future__ import annotations

import io
import logging
import os
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from rich.console import Console

import lptn
from lptn.cli import terminal
from lptn.cli.main import main
from lptn.cli.terminal import library_log_shown, show_table
from tests.cli.conftest import Lptn
from tests.diagnose.pair_runs import MODEL, table

LONG = "front_right_thigh_with_a_name_that_alone_fills_half_a_line"
ROWS = [(f"{LONG}_{number}", "constant_heat", f"{LONG}~{LONG}@monday", "1.234 K") for number in range(40)]


@pytest.mark.parametrize("watched", [True, False])
def test_tables_cut_nothing_at_80_columns(watched: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    written = io.StringIO()
    monkeypatch.setattr(terminal, "out", Console(file=written, force_terminal=watched, width=80, color_system=None))
    show_table(("node", "effect", "at", ">RMSE"), ROWS)
    lines = written.getvalue().splitlines()
    assert "…" not in written.getvalue()
    if watched:  # folded: every column's letters are all there, line below line
        assert max(map(len, lines)) <= 80
        starts = [lines[0].index(head) for head in ("node", "effect", "at")]
        for column, (start, stop) in enumerate(zip(starts, [*starts[1:], 80 - len("1.234 K")], strict=True)):
            letters = "".join(line[start:stop].strip() for line in lines[1:])
            assert letters == "".join(row[column] for row in ROWS)
    else:  # one line a row
        assert [" ".join(line.split()) for line in lines[1:]] == [" ".join(row) for row in ROWS]


HEADS = ("choice", *(f">quantity {number} [N*m]" for number in range(5)), "active constraints")


@pytest.mark.parametrize("count", [1, 2, 4, 9])
def test_a_table_that_is_too_wide_is_turned_or_left_whole(count: int, monkeypatch: pytest.MonkeyPatch) -> None:
    written = io.StringIO()
    monkeypatch.setattr(terminal, "out", Console(file=written, force_terminal=True, width=80, color_system=None))
    rows = [(f"U{number}, no sink", *"12345", "winding, mass") for number in range(count)]
    show_table(HEADS, rows)
    lines = written.getvalue().splitlines()
    heads = [head.removeprefix(">") for head in HEADS]
    assert all(rows[0][0] in line for line in lines[:1]) == (count <= 4)
    if count <= 4:  # each choice has a column
        assert max(map(len, lines)) <= 80
        assert [line[:18].rstrip() for line in lines][: len(heads)] == heads
    else:  # nothing is folded into a column of letters
        assert len(lines) == count + 1
        assert all(" ".join(row) == " ".join(line.split()) for row, line in zip(rows, lines[1:], strict=True))


def test_of_a_long_table_the_first_rows_are_shown_and_the_others_counted(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    written = io.StringIO()
    monkeypatch.setattr(terminal, "out", Console(file=written, width=80, color_system=None))
    show_table(("node", ">RMSE"), [(f"n{number}", "1 K") for number in range(9)], most=6)
    assert [line.split()[0] for line in written.getvalue().splitlines()[1:]] == [f"n{number}" for number in range(6)]
    assert capsys.readouterr().out == "and 3 more: --details\n"


class _Watched(io.StringIO):
    """A terminal."""

    def isatty(self) -> bool:
        return True


def test_sentences_are_wrapped_and_files_are_not(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    for words in (("motor", "-o", "-"), ("new", "leg", "-o", "-"), ("new", "u8-heat-sink", "-o", "-")):
        monkeypatch.setattr(sys, "stdout", watched := _Watched())
        with pytest.raises(SystemExit, match="0"):
            main(list(words))
        assert tomllib.loads(watched.getvalue())
    monkeypatch.setattr(sys, "stdout", watched := _Watched())
    with terminal.spared_closed_pipes():
        print("  An indented sentence " + "onwards " * 12)
        print("A sentence " + "onwards " * 12)
    indented, further, plain, rest = watched.getvalue().splitlines()
    assert max(map(len, (indented, further, plain, rest))) <= 80
    assert further.startswith("    onwards")
    assert rest.startswith("onwards")


def test_a_command_into_a_pipe_of_80_columns_names_its_nodes_whole(lptn: Lptn, tmp_path: Path) -> None:
    (tmp_path / "model.toml").write_text(MODEL.replace("nodes.a", f"nodes.{LONG}"))
    table().rename(columns=lambda name: name.replace(".a", f".{LONG}") if name.endswith(".a") else name).to_csv(
        tmp_path / "log.csv", index=False
    )
    status, out, _ = lptn("compare", tmp_path / "model.toml", tmp_path / "log.csv")
    assert status == 0
    assert f"log  {LONG}" in out


def test_what_the_library_logs_is_shown(capsys: pytest.CaptureFixture[str]) -> None:
    logger = logging.getLogger("lptn.anywhere")
    with library_log_shown():
        logger.info("fitting")
        logger.warning("%s: %s", "log.csv", "a column\nwas guessed")
    assert capsys.readouterr().err == "lptn: log.csv: a column was guessed\n"


def test_a_file_whose_name_looks_like_an_option(lptn: Lptn, model: Path, tmp_path: Path) -> None:
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(tmp_path)
        table().to_csv("-x.csv", index=False)
        status, _, err = lptn("check", model, "-x.csv")
        assert status == 2
        assert err.endswith("(a file of the name -x.csv is written ./-x.csv)\n")
        assert err.count("\n") == 1
        assert lptn("check", model, "--", "-x.csv")[0] == 0
        assert lptn("check", model, "./-x.csv")[0] == 0
        status, _, err = lptn("simulate", model, "./-x.csv", "-o", "-y.csv")
        assert status == 2
        assert "written ./-y.csv" in err
        assert lptn("simulate", "-o", "./-y.csv", model, "--", "-x.csv")[0] == 0
        assert Path("-y.csv").is_file()


def test_the_command_works_beside_a_folder_of_its_name(tmp_path: Path) -> None:
    """As in the folder into which somebody cloned this project."""
    (tmp_path / "lptn" / "src").mkdir(parents=True)
    command = shutil.which("lptn", path=f"{Path(sys.executable).parent}{os.pathsep}{os.environ.get('PATH', '')}")
    for words in ([command, "--version"], [sys.executable, "-m", "lptn", "--version"]):
        done = subprocess.run([str(word) for word in words], cwd=tmp_path, capture_output=True, text=True, check=False)
        assert (done.returncode, done.stdout.strip()) == (0, lptn_version())


def lptn_version() -> str:
    """Of the package as imported here."""
    return lptn.__version__
