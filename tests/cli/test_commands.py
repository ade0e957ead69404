"""The command line, run as a user runs it, in this process."""

from __future__ import annotations

import json
import re
import signal
import subprocess
import sys
import textwrap
import time
from pathlib import Path
from textwrap import wrap
from typing import Any

import pandas as pd
import pytest

from lptn.model.file import read_model_file
from lptn.report.text import title_of
from tests.cli.conftest import Lptn

EXAMPLE = Path(__file__).parents[2] / "examples" / "tclab"
MODEL, LOG = EXAMPLE / "two_heaters.toml", EXAMPLE / "log.csv"


@pytest.fixture
def short_log(tmp_path: Path) -> Path:
    """The first 150 s of the example: enough to run every command quickly."""
    table = pd.read_csv(LOG)
    path = tmp_path / "short.csv"
    table[table["time_s"] < 150].to_csv(path, index=False)
    return path


def test_presets_are_listed_and_written_and_read(lptn: Lptn, tmp_path: Path) -> None:
    status, listed, _ = lptn("new")
    assert status == 0
    head, *rows = (re.split(" {2,}", line.strip()) for line in listed.splitlines())
    assert head == ["preset", "nodes", "parameters", "what it is"]
    assert len(rows) < 15
    assert max(map(len, listed.splitlines())) <= 80
    for number, (words, nodes, parameters, _) in enumerate(rows):
        target = tmp_path / f"{number}.toml"
        assert lptn("new", *words.split(), "-o", target)[0] == 0
        network = read_model_file(target).network
        assert (int(nodes), int(parameters)) == (len(network.dynamic), len(network.parameters))


def test_an_unknown_model_of_a_preset_is_refused(lptn: Lptn) -> None:
    status, _, said = lptn("new", "leg", "--model", "whole")
    assert status == 2
    assert said == "lptn: new: --model: found 'whole'; expected one of full, single-node\n"


def test_check_says_what_the_log_holds(lptn: Lptn) -> None:
    status, out, _ = lptn("check", MODEL, LOG)
    assert status == 0
    assert "heater1" in out
    assert "first readings" in out


def test_fit_writes_values_errors_and_the_fingerprint(lptn: Lptn, short_log: Path, tmp_path: Path) -> None:
    fitted, target = tmp_path / "fitted.toml", tmp_path / "fit.json"
    status, out, _ = lptn("fit", MODEL, short_log, "--holdout-after", 120, "-o", fitted, "--json", target)
    assert status == 0
    assert out.startswith("Error: RMSE held out ")
    text = fitted.read_text()
    assert "sha256" in text
    assert "# Two heaters on one board" in text
    written = json.loads(target.read_text())
    assert written["parameters"]["capacity.heater*"]["value"] == pytest.approx(
        next(u.value for u in read_model_file(fitted).network.parameters if u.name == "capacity.heater*"), rel=1e-5
    )


@pytest.mark.long
def test_compare_writes_the_agreed_json_and_a_picture(lptn: Lptn, short_log: Path, tmp_path: Path) -> None:
    target, picture = tmp_path / "compare.json", tmp_path / "compare.png"
    status, out, _ = lptn("compare", MODEL, short_log, "--details", "--json", target, "--plot", picture)
    assert status == 0
    assert out.startswith("Error: RMSE ")
    assert "Worst by operating condition:" in out
    written = json.loads(target.read_text())
    assert set(written["runs"]["short"]["nodes"]["heater1"]) >= {"rmse", "max", "mean"}
    assert set(written["all"]) == {"rmse", "max"}
    assert picture.read_bytes().startswith(b"\x89PNG")


def test_add_appends_an_effect_and_keeps_the_comments(lptn: Lptn, tmp_path: Path) -> None:
    target = tmp_path / "next.toml"
    assert lptn("add", MODEL, "conduction", "--at", "heater1~heater2", "-o", target)[0] == 0
    assert target.read_text().startswith(MODEL.read_text().rstrip()[:400])
    assert any(instance.effect.key == "conduction" for instance in read_model_file(target).network.effect_instances)


def test_add_takes_the_place_as_diagnose_prints_it(lptn: Lptn, tmp_path: Path) -> None:
    ways = (("--at", "heater1@monday"), ("--at", "heater1", "--run", "monday"))
    texts = []
    for number, words in enumerate(ways):
        target = tmp_path / f"{number}.toml"
        assert lptn("add", MODEL, "constant_heat", *words, "-o", target)[0] == 0
        (effect,) = (
            declaration
            for declaration in read_model_file(target).network.effects
            if declaration.effect.key == "constant_heat"
        )
        assert (effect.at, effect.run) == ("heater1", "monday")
        texts.append(target.read_text())
    assert texts[0] == texts[1]
    status, _, said = lptn("add", MODEL, "constant_heat", *ways[0], "--run", "friday", "-o", tmp_path / "x.toml")
    assert (status, said) == (
        2,
        "lptn: command line: --run: found 'friday' beside --at heater1@monday; expected the run in one place\n",
    )


@pytest.mark.parametrize(
    "words", [("add", MODEL, "convection", "--at", "*", "-o", "x.toml"), ("effects", "convection")]
)
def test_effects_of_a_like_name_are_offered(words: tuple[object, ...], lptn: Lptn) -> None:
    status, _, said = lptn(*words)
    assert status == 2
    assert "forced_convection or natural_convection" in said


@pytest.mark.long
def test_diagnose_writes_the_agreed_json(lptn: Lptn, short_log: Path, tmp_path: Path) -> None:
    target = tmp_path / "diagnosis.json"
    status, out, _ = lptn("diagnose", MODEL, short_log, "--holdout-after", 110, "--json", target)
    assert status == 0
    assert out.startswith("Verdict: The model as given ")
    written = json.loads(target.read_text())
    assert written["verdict"] in {"adequate", "missing", "unexplained"}
    for rank, candidate in enumerate(written["candidates"], start=1):
        assert candidate["rank"] == rank
        assert set(candidate) == {
            "effect",
            "at",
            "rank",
            "rmse_fit",
            "rmse_holdout_before",
            "rmse_holdout_after",
            "p_value",
            "probability",
            "indistinguishable_from",
            "separate_by",
        }


@pytest.mark.long
def test_improve_writes_model_history_and_report(lptn: Lptn, short_log: Path, tmp_path: Path) -> None:
    better, history, story = tmp_path / "better.toml", tmp_path / "history.json", tmp_path / "story.html"
    words = ("improve", MODEL, short_log, "--holdout-after", 110, "-o", better, "--json", history, "--report", story)
    status, out, _ = lptn(*words)
    assert status == 0
    assert out.startswith("Verdict: The model ")
    written = json.loads(history.read_text())
    given, *steps = written["history"]
    assert given["effect"] is None
    added = [(effect.effect.key, effect.where) for effect in read_model_file(better).network.effects]
    assert [(step["effect"], step["at"]) for step in steps] == added[-len(steps) :]
    parts = [(part["effect"], part["at"]) for part in (*written["findings"], *written["structure"])]
    assert parts == added[-len(steps) :]
    assert story.read_text().startswith("<!DOCTYPE html>")


@pytest.mark.long
def test_steps_bounds_findings_and_not_structure(lptn: Lptn, tmp_path: Path) -> None:
    target = tmp_path / "none.json"
    assert lptn("improve", MODEL, LOG, "--holdout-after", 300, "--steps", 0, "--json", target)[0] == 0
    written = json.loads(target.read_text())
    assert written["findings"] == []
    assert written["structure"]


def test_a_former_name_of_steps_is_unknown(lptn: Lptn) -> None:
    status, _, said = lptn("improve", MODEL, LOG, "--rungs", 1)
    assert status == 2
    assert "--rungs" in said


@pytest.fixture(scope="module")
def improved(tmp_path_factory: pytest.TempPathFactory) -> tuple[str, dict[str, Any]]:
    """What `improve` prints of the example, and what it writes for programs."""
    target = tmp_path_factory.mktemp("improved") / "history.json"
    words = ["improve", str(MODEL), str(LOG), "--holdout-after", "300", "--details", "--json", str(target)]
    code = "import sys; from lptn.cli.main import main; main(sys.argv[1:])"
    done = subprocess.run([sys.executable, "-c", code, *words], capture_output=True, text=True, check=True)
    return done.stdout, json.loads(target.read_text())


@pytest.mark.long
def test_improve_prints_sizes_and_errors_as_it_writes_them(improved: tuple[str, dict[str, Any]]) -> None:
    out, written = improved
    table = out.partition("\n\n")[2].splitlines()[: len(written["history"]) + 1]
    head, *rows = (re.split(" {2,}", line.strip()) for line in table)
    assert head == ["step", "effect", "place", "parameters", "RMSE fitted", "held out", "max held out"]
    for row, step in zip(rows, written["history"], strict=True):
        assert float(row[-3].removesuffix(" K")) == pytest.approx(step["rmse_fit"], rel=5e-3)
        assert float(row[-2].removesuffix(" K")) == pytest.approx(step["rmse_holdout"], rel=5e-3)
    steps = dict(re.findall(r"^Step \d+, (.+?) everywhere .*?: (.+?\d \S+?)[,.;] ", out, re.MULTILINE))
    for part in (*written["findings"], *written["structure"]):
        *_, value, _, _, unit = steps[title_of(part["effect"])].split()
        assert unit == part["unit"]
        assert float(value) == pytest.approx(part["size"], rel=0.05)


@pytest.mark.long
def test_what_improve_prints_is_read_at_a_glance(improved: tuple[str, dict[str, Any]]) -> None:
    out, _ = improved
    rows = [row for line in out.partition("\n\n")[0].splitlines() for row in textwrap.wrap(line, 80)]
    assert len(rows) <= 15


def test_simulate_writes_a_log_that_compares_perfectly(lptn: Lptn, short_log: Path, tmp_path: Path) -> None:
    predicted = tmp_path / "predicted.parquet"
    assert lptn("simulate", MODEL, short_log, "-o", predicted)[0] == 0
    table = pd.read_parquet(predicted)
    assert {"time", "temperature.heater1", "temperature.heater2", "power.heater1"} <= set(table)
    assert len(table) > 100


def test_effects_are_listed_and_shown(lptn: Lptn) -> None:
    assert "forced_convection" in lptn("effects")[1]
    assert "gamma" in lptn("effects", "forced_convection")[1]


def test_nothing_is_said_on_the_error_stream_when_nobody_watches(lptn: Lptn, short_log: Path) -> None:
    assert lptn("fit", MODEL, short_log)[2] == ""


@pytest.mark.long
def test_ctrl_c_ends_a_search_in_one_line_and_writes_nothing(tmp_path: Path) -> None:
    code = "import sys; from lptn.cli.main import main; print('ready', flush=True); main(sys.argv[1:])"
    motor = MODEL.parents[1] / "pmsm"  # some 30 s; the two heaters' search may be over when the signal comes
    words = ["improve", str(motor / "four_nodes.toml"), str(motor / "log.csv"), "--holdout-after", "4400"]
    words += ["-o", str(tmp_path / "better.toml")]
    started = subprocess.Popen(
        [sys.executable, "-c", code, *words], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    assert started.stdout is not None
    assert started.stdout.readline() == "ready\n"
    time.sleep(2)
    started.send_signal(signal.SIGINT)
    _, said = started.communicate(timeout=60)
    assert started.returncode == 130
    assert said == "lptn: stopped; nothing was written\n"
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("words", "written"),
    [
        (("new", "leg"), "leg.toml"),
        (("new", "quadruped", "--model", "windings"), "quadruped.windings.toml"),
        (("new", "u8-heat-sink", "-o", "mine.toml"), "mine.toml"),
        (("new", "--urdf", "robot.urdf"), "robot.toml"),
        (("motor",), "drawing.toml"),
        (("motor", "--sample", "outrunner"), "drawing.toml"),
        (("add", MODEL, "fan", "--at", "*", "-o", "next.toml"), "next.toml"),
    ],
    ids=lambda value: " ".join(map(str, value[:2])) if isinstance(value, tuple) else value,
)
def test_what_is_written_is_said_with_what_to_do_next(
    words: tuple[object, ...], written: str, lptn: Lptn, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "robot.urdf").write_text(
        '<robot name="arm"><link name="base"/><link name="arm"/><joint name="elbow" type="revolute">'
        '<parent link="base"/><child link="arm"/><axis xyz="0 0 1"/><limit effort="10" velocity="5" lower="-1" '
        'upper="1"/></joint></robot>'
    )
    before = set(tmp_path.iterdir())
    status, out, _ = lptn(*words)
    assert status == 0
    assert {path.name for path in set(tmp_path.iterdir()) - before} == {written}
    said = out.splitlines()
    assert [line.partition(":")[0] for line in said] == ["Written", "Next"]
    assert written in said[0]
    assert written in said[1]  # the next command takes it
    assert sum(len(wrap(line, 80)) for line in said) <= 15


def test_a_model_of_a_drawing_is_said_with_its_inputs(
    lptn: Lptn, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    lptn("motor")
    status, out, _ = lptn("motor", "drawing.toml")
    assert status == 0
    assert "Written: motor.toml (a model of drawing.toml: 13 nodes, inputs temperature.ambient, current.motor)." in out
    (tmp_path / "motor.toml").write_text("# edited\n")
    assert lptn("motor", "drawing.toml")[0] == 2  # under its usual name an edited file may stand
    assert lptn("motor", "drawing.toml", "-o", "motor.toml")[0] == 0


@pytest.mark.long
def test_verbose_and_quiet_say_more_and_less_beside_one_answer(lptn: Lptn, short_log: Path, tmp_path: Path) -> None:
    for words in (
        ("fit", MODEL, short_log),
        ("compare", MODEL, short_log),
        ("forecast", MODEL, short_log, "--limit", 60),
    ):
        runs = [lptn(*words), lptn("-v", *words), lptn(*words, "--quiet")]
        (usual, said), (loud, log), (alone, nothing) = [(out, err) for _, out, err in runs]
        assert loud == usual
        assert usual.startswith(alone)
        assert len(alone) < len(usual)
        assert all(re.match(r"[A-Z][a-z ]+: ", line) for line in alone.splitlines())
        assert nothing == ""
        assert len(log) >= len(said)
        assert all(line.startswith("lptn: ") for line in log.splitlines())
    assert "iteration" in lptn("fit", "-v", MODEL, short_log)[2]
    status, _, said = lptn("fit", "-v", "-q", MODEL, short_log)
    assert (status, len(said.splitlines())) == (2, 1)


@pytest.mark.long
def test_diagnose_draws_what_it_found(lptn: Lptn, short_log: Path, tmp_path: Path) -> None:
    words = ("diagnose", MODEL, short_log, "--holdout-after", 110)
    for name, begins in (("found.png", b"\x89PNG"), ("found.svg", b"<?xml")):
        assert lptn(*words, "--plot", tmp_path / name)[0] == 0
        assert (tmp_path / name).read_bytes().startswith(begins)
    text = (tmp_path / "found.svg").read_text()
    assert text.count('<g id="axes_') == 6  # two nodes with their errors, and a map of the heat for each model
    assert lptn(*words, "--plot", tmp_path / "found.txt")[0] == 2
