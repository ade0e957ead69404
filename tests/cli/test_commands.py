"""The command line, run as a user runs it, in this process."""

from __future__ import annotations

import json
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pandas as pd
import pytest

from lptn.model.file import read_model_file
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
    assert ["quadruped --model single-node", "12", "64"] in [row[:3] for row in rows]
    assert all(row[3].startswith(("A ", "One ", "The ")) for row in rows)
    for number, (words, *_) in enumerate(rows):
        target = tmp_path / f"{number}.toml"
        assert lptn("new", *words.split(), "-o", target)[0] == 0
        network = read_model_file(target).network
        assert [words, str(len(network.dynamic)), str(len(network.parameters))] == rows[number][:3]


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
    assert "Held out" in out
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
    status, out, _ = lptn("compare", MODEL, short_log, "--json", target, "--plot", picture)
    assert status == 0
    assert "It fails worst where" in out
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
    assert "The model is" in out
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
@pytest.mark.parametrize("option", ["--steps", "--rungs"])  # the second is an older name
def test_improve_writes_model_history_and_report(option: str, lptn: Lptn, short_log: Path, tmp_path: Path) -> None:
    better, history, story = tmp_path / "better.toml", tmp_path / "ladder.json", tmp_path / "story.html"
    words = ("improve", MODEL, short_log, "--holdout-after", 110, option, 1)
    status, out, _ = lptn(*words, "-o", better, "--json", history, "--report", story)
    assert status == 0
    assert "(as given)" in out
    written = json.loads(history.read_text())
    assert written["ladder"][0]["effect"] is None
    assert set(written["ladder"][0]) >= {
        "rung",
        "effect",
        "at",
        "parameters",
        "rmse_fit",
        "rmse_holdout",
        "max_holdout",
    }
    added = [
        instance.effect.key
        for instance in read_model_file(better).network.effect_instances
        if instance.effect.key != "heat_input"
    ]
    assert len(set(added)) == len(written["ladder"]) - 1
    assert story.read_text().startswith("<!DOCTYPE html>")


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
