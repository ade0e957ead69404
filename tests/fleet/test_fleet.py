"""One model fitted to each robot: what is kept, skipped, reported, and who stands apart."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from lptn.basics.errors import InputError
from lptn.cli.main import main
from lptn.fleet.fleet import Fleet, fit_each, pooled_of
from lptn.fleet.robots import RobotLogs, robots_of
from lptn.fleet.work import FleetFit, Outcome, ResultFolder, fit_robot
from lptn.model.file import read_model_file
from lptn.model.model import Model
from tests.fleet.truth import MODEL, RESISTANCE, write_fleet, write_log

LINK = "resistance.ambient~motor"


@pytest.fixture
def model(tmp_path: Path) -> Path:
    path = tmp_path / "motor.toml"
    path.write_text(MODEL)
    return path


@pytest.fixture
def logs(tmp_path: Path) -> list[Path]:
    return write_fleet(tmp_path / "logs", 12, bad=3, odd=7)


def _command(capsys: pytest.CaptureFixture[str], *words: object) -> tuple[int, str, str]:
    status = 0
    try:
        main(["fleet", *map(str, words)])
    except SystemExit as stop:
        status = int(stop.code or 0)
    seen = capsys.readouterr()
    return status, seen.out, seen.err


def test_the_command_fits_all_but_the_bad_log_and_names_the_odd_robot(
    model: Path, logs: list[Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out, target = tmp_path / "out", tmp_path / "fleet.json"
    status, said, complained = _command(capsys, model, *logs, "-o", out, "--json", target)
    assert status == 1
    assert complained.count("\n") == 1
    assert complained.startswith(f"lptn: robot_003: not fitted: {logs[3]}: line ")
    apart = [line for line in said.splitlines() if "times the fleet's" in line]
    assert len(apart) == 1
    assert apart[0].startswith(f"robot_007: {LINK} ")
    assert said.startswith("Fleet: 11 of 12 fits of 12 robots; 1 robot stands apart or drifts.")

    table = pd.read_csv(out / "fleet.csv")
    binary = pd.read_parquet(out / "fleet.parquet")
    numbers = ["rmse", "logs", "capacity.motor", "capacity.motor.error", LINK, f"{LINK}.error"]
    pd.testing.assert_frame_equal(table[numbers], binary[numbers])
    assert table["fitted"].tolist() == [number != 3 for number in range(12)]
    truth = np.array([RESISTANCE * np.exp(0.05 * np.random.default_rng(1000 + n).normal(size=2)[1]) for n in range(12)])
    truth[7] *= 3
    off = np.abs(table[LINK] - truth) / table[f"{LINK}.error"]
    assert off.drop(3).max() < 4.5
    for name in table["robot"].drop(3):
        fitted = {
            parameter.name: parameter.value
            for parameter in read_model_file(out / "models" / f"{name}.toml").network.parameters
        }
        assert fitted[LINK] == pytest.approx(table.set_index("robot")[LINK][name], rel=1e-5)

    written = json.loads(target.read_text())
    assert written["robots"]["robot_003"]["message"].startswith(str(logs[3]))
    (deviation,) = written["deviations"]
    assert (deviation["robot"], deviation["parameter"], deviation["drifts"]) == ("robot_007", LINK, False)
    assert deviation["probability"] > 0.95
    assert written["parameters"][LINK]["unit"] == "K/W"
    assert written["parameters"][LINK]["mean"] == pytest.approx(RESISTANCE, rel=0.05)


def test_only_what_changed_is_fitted_again(model: Path, logs: list[Path], tmp_path: Path) -> None:
    def statuses(**options: Any) -> list[str]:
        return [outcome.status for outcome in fit_each(model, logs[:3], into=tmp_path / "out", **options).outcomes]

    assert statuses() == ["fitted"] * 3
    assert statuses() == ["unchanged"] * 3
    write_log(logs[1], seed=99)
    assert statuses() == ["unchanged", "fitted", "unchanged"]
    (tmp_path / "out" / "models" / "robot_000.toml").unlink()
    (tmp_path / "out" / "records" / "robot_002.json").write_text('{"half')
    assert statuses() == ["fitted", "unchanged", "fitted"]
    assert statuses(holdout_after=900.0) == ["fitted"] * 3
    model.write_text(MODEL.replace("value = 300", "value = 310"))
    assert statuses(holdout_after=900.0) == ["fitted"] * 3


def test_a_folder_of_logs_is_fitted_together_and_held_out_by_time(model: Path, tmp_path: Path) -> None:
    for seed in range(2):
        write_log(tmp_path / "robot" / f"{seed}.csv", seed)
    (outcome,) = fit_each(model, [tmp_path / "robot"], holdout_after=1000.0).outcomes
    assert [entry["file"] for entry in outcome.result["data"]] == ["0.csv", "1.csv"]
    assert outcome.result["rmse_holdout"] < 0.2
    assert "[fit]" in outcome.text
    assert outcome.converged


class _Counting(Executor):
    """Runs a task only when somebody else is submitted or waits; counts how many were out at once."""

    def __init__(self) -> None:
        self._pool, self.out, self.most = ThreadPoolExecutor(1), 0, 0

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        self.out += 1
        self.most = max(self.most, self.out)
        future = self._pool.submit(fn, *args, **kwargs)
        future.add_done_callback(lambda _: setattr(self, "out", self.out - 1))
        return future

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        self._pool.shutdown(wait, cancel_futures=cancel_futures)


def test_another_lptn_fits_again(
    model: Path, logs: list[Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    fit_each(model, logs[:1], into=tmp_path / "out")
    assert fit_each(model, logs[:1], into=tmp_path / "out").outcomes[0].status == "unchanged"
    monkeypatch.setattr("lptn.fleet.work.__version__", "0.0.0")
    assert fit_each(model, logs[:1], into=tmp_path / "out").outcomes[0].status == "fitted"


def test_what_was_guessed_is_told_once_for_all_robots(
    model: Path, logs: list[Path], tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    for log in logs[:3]:
        log.write_text(log.read_text().replace("temperature.motor", "motor_temp", 1))
    words = ["fleet", model, *logs[:3], "-o", tmp_path / "out", "--map", "guess", "--jobs", "2"]
    with pytest.raises(SystemExit, match=r"^0$"):
        main(list(map(str, words)))
    seen = capfd.readouterr()
    assert seen.err == ""
    assert seen.out.replace("\n", " ").count("guessed: ") == 1
    assert '3 fits: guessed: "temperature.motor" = "motor_temp"' in seen.out.replace("\n", " ")


def test_no_more_than_asked_for_are_handed_out_at_once(model: Path, logs: list[Path]) -> None:
    with _Counting() as executor:
        fleet = fit_each(model, logs, executor=executor, in_flight=3)
    assert executor.most == 3
    assert len(fleet.fitted) == 11
    assert [outcome.robot for outcome in fleet.outcomes] == [log.stem for log in logs]


def _fit_or_die(order: FleetFit, name: str, logs: Sequence[str], fingerprint: str = "") -> Outcome:
    if name == "robot_002":
        os.kill(os.getpid(), signal.SIGKILL)
    return fit_robot(order, name, logs, fingerprint)


@pytest.mark.long
@pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")  # of Python 3.12 and 3.13, beside any thread
def test_a_worker_that_dies_costs_its_robot_and_no_other(
    model: Path, logs: list[Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("lptn.fleet.work.fit_robot", _fit_or_die)
    fleet = fit_each(model, logs, jobs=2)
    assert {outcome.robot for outcome in fleet.failed} == {"robot_002", "robot_003"}
    assert "worker died" in next(outcome.message for outcome in fleet.failed if outcome.robot == "robot_002")
    with ProcessPoolExecutor(1) as executor:  # the caller's own is not made anew
        fleet = fit_each(model, logs[1:5], executor=executor, in_flight=1)
    assert [outcome.status for outcome in fleet.outcomes] == ["fitted", "failed", "failed", "failed"]


def test_two_processes_do_not_fit_into_one_folder(
    model: Path, logs: list[Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("lptn.fleet.work._PATIENCE", 0.1)
    shelf = ResultFolder(tmp_path / "out")
    with shelf.alone(), pytest.raises(InputError, match="another process"):
        fit_each(model, logs, into=tmp_path / "out")
    assert not list((tmp_path / "out" / "records").iterdir())


def test_what_can_not_be_is_refused_in_one_line(
    model: Path, logs: list[Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    fixed = tmp_path / "fixed.toml"
    fixed.write_text(
        MODEL.replace("bounds = [20, 3000]", "fixed = true").replace("bounds = [0.2, 200]", "fixed = true")
    )
    for words, expected in (
        ((model, *logs), "a folder for one model a robot"),
        ((model, *logs, "-o", model), "a folder for one model a robot"),
        ((model, *logs, "-o", tmp_path / "no" / "out"), "a folder in a folder that exists"),
        ((model, logs[1], "--holdout", logs[2], "-o", tmp_path / "out"), "--holdout-after: of each robot's own logs"),
        ((model, "-o", tmp_path / "out"), "LOGS"),
        ((fixed, *logs, "-o", tmp_path / "out"), "one at least without fixed = true"),
    ):
        status, _, complained = _command(capsys, *words)
        assert (status, complained.count("\n")) == (2, 1)
        assert expected in complained
    assert not (tmp_path / "out").exists()


def test_names_that_can_be_no_file_names_are_refused(model: Path, logs: list[Path]) -> None:
    for names in (("../out",), (".hidden",), ("",), ("a", "a"), ()):
        with pytest.raises(InputError, match="robots: names"):
            fit_each(model, [RobotLogs(name, (logs[0],)) for name in names])


def _outcomes(values: Sequence[float], errors: Sequence[float | None], name: str = LINK) -> Iterator[Outcome]:
    for number, (value, error) in enumerate(zip(values, errors, strict=True)):
        parameters = {name: {"value": value, "error": error, "unit": "K/W"}}
        yield Outcome(f"r{number}", "fitted", result={"status": "converged", "parameters": parameters})


def test_a_robot_stands_apart_only_if_its_logs_say_so(model: Path) -> None:
    network = Model(read_model_file(model).network)
    values = [5.0, 5.1, 4.9, 5.05, 4.95, 5.02, 15.0, 1.6, 40.0]
    errors = [0.05, 0.05, 0.05, 0.05, 0.05, 0.05, 0.2, 1.5, None]
    outcomes = list(_outcomes(values, errors))
    robots = {outcome.robot: RobotLogs(outcome.robot, ()) for outcome in outcomes}
    (of_link,) = parameters = pooled_of(network, outcomes, robots)
    assert (of_link.name, len(of_link.robots)) == (LINK, 8)
    assert of_link.value(of_link.mean) == pytest.approx(5.01, abs=0.03)
    (apart,) = Fleet(tuple(outcomes), robots, parameters).deviations
    assert apart.robot == "r6"  # r7 scatters as much itself, r8 says nothing
    assert str(apart).startswith(f"r6: {LINK} 3 times the fleet's: 15 against 5.03 K/W (more than 99 %)")
    assert of_link.robots["r7"].apart < 0.2


@pytest.mark.long
def test_ctrl_c_ends_workers_and_keeps_what_is_done(model: Path, tmp_path: Path) -> None:
    write_fleet(tmp_path / "logs", 150)
    words = ["fleet", model, *sorted((tmp_path / "logs").iterdir()), "-o", tmp_path / "out", "--jobs", 2]
    code = "import sys; from lptn.cli.main import main; main(sys.argv[1:])"
    started = subprocess.Popen(
        [sys.executable, "-c", code, *map(str, words)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    while len(list(tmp_path.glob("out/records/*.json"))) < 10 and started.poll() is None:
        time.sleep(0.02)
    os.killpg(started.pid, signal.SIGINT)
    _, complained = started.communicate(timeout=60)
    assert started.returncode == 130
    assert complained.startswith("lptn: stopped; ")
    assert complained.count("\n") == 1
    with pytest.raises(ProcessLookupError):
        os.killpg(started.pid, 0)
    kept = {path.stem for path in tmp_path.glob("out/records/*.json")}
    assert 10 <= len(kept) < 150
    some = robots_of([tmp_path / "logs" / f"{name}.csv" for name in sorted(kept)[:5]])
    assert {outcome.status for outcome in fit_each(model, some, into=tmp_path / "out").outcomes} == {"unchanged"}
