"""A fit that was cut off goes on from its best point."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from lptn.cli.main import main
from lptn.identify.data import split_data
from lptn.identify.fitting import Checkpoint, fingerprint_of
from lptn.identify.problem import Point
from lptn.identify.solvers import Progress
from lptn.identify.validation import fit_segments
from lptn.model.file import read_model_file
from lptn.model.model import Model
from tests.identify.truth import network, truth_run

MODEL = """
[model]
name = "two"
ambient = "temperature.ambient"

[nodes]
a = { capacity = { value = 300, unit = "J/K", bounds = [1, 1e5] } }
b = { capacity = { value = 300, unit = "J/K", bounds = [1, 1e5] } }

[[links]]
between = ["a", "b"]
resistance = { value = 5, unit = "K/W", bounds = [0.01, 1e3] }

[[links]]
between = ["b", "ambient"]
resistance = { value = 5, unit = "K/W", bounds = [0.01, 1e3] }

[[effects]]
kind = "copper_loss"
at = "a"
resistance = 0.2
torque_constant = 1.0
"""
# Writes at every better point, and takes its time between them.
SLOW = """
import sys, time
import lptn.identify.fitting as checkpoint
from lptn.cli.main import main

checkpoint._EVERY = 0.0
keep = checkpoint.Checkpoint.save
checkpoint.Checkpoint.__init__.__defaults__ = (None, 0.0)
checkpoint.Checkpoint.save = lambda *given: (keep(*given), time.sleep(0.5))
main(sys.argv[1:])
"""


class _CutError(Exception):
    pass


def _cut_off_after(count: int) -> Progress:
    seen: list[int] = []

    def progress(_number: int, _rms: float) -> None:
        seen.append(1)
        if len(seen) > count:
            raise _CutError

    return progress


def _lptn(*words: object) -> None:
    with pytest.raises(SystemExit) as stop:
        main([str(word) for word in words])
    assert not stop.value.code


def test_the_same_as_without_a_checkpoint_and_nothing_left_behind(tmp_path: Path) -> None:
    model, data = Model(network()), split_data([truth_run(seed=1), truth_run(900.0, seed=2)])
    checkpoint = Checkpoint("f" * 64, tmp_path, every=0.0)
    plain, again = fit_segments(model, data.fit), fit_segments(model, data.fit, checkpoint=checkpoint)
    np.testing.assert_allclose(again.model.values, plain.model.values, rtol=1e-9)  # step by step the same search
    assert again.status == plain.status == "converged"
    assert again.standard_errors == pytest.approx(plain.standard_errors, rel=1e-6)
    assert again.iterations == plain.iterations
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(("share", "coarse"), [(0.2, True), (1.0, False)])
def test_a_fit_cut_off_anywhere_ends_at_the_same_optimum(tmp_path: Path, share: float, coarse: bool) -> None:
    model, data = Model(network()), split_data([truth_run(4000.0, seed=1)])
    checkpoint = Checkpoint("f" * 64, tmp_path, every=0.0)
    calls: list[int] = []
    whole = fit_segments(model, data.fit, checkpoint=checkpoint, progress=lambda number, _: calls.append(number))
    with pytest.raises(_CutError):
        fit_segments(model, data.fit, checkpoint=checkpoint, progress=_cut_off_after(round(share * (len(calls) - 1))))
    kept = checkpoint.load(model, 1)
    assert kept is not None
    assert kept.averaged == coarse
    again: list[int] = []
    resumed = fit_segments(model, data.fit, checkpoint=checkpoint, progress=lambda number, _: again.append(number))
    assert len(again) < len(calls)
    np.testing.assert_allclose(resumed.model.values, whole.model.values, rtol=1e-4)
    assert not checkpoint.path.exists()


@pytest.mark.parametrize("late", [False, True])
def test_ctrl_c_keeps_the_best_point_for_the_next_time(tmp_path: Path, late: bool) -> None:
    model, data = Model(network()), split_data([truth_run(4000.0, seed=1)])
    checkpoint = Checkpoint("f" * 64, tmp_path, every=1e9)
    calls: list[int] = []
    whole = fit_segments(model, data.fit, progress=lambda number, _: calls.append(number))
    press_at = len(calls) if late else 2  # in the last search, or in the coarse one
    calls.clear()

    def press(number: int, _rms: float) -> None:
        calls.append(number)
        if len(calls) == press_at:
            signal.raise_signal(signal.SIGINT)

    assert fit_segments(model, data.fit, checkpoint=checkpoint, progress=press).status == "interrupted"
    assert checkpoint.load(model, 1) is not None
    done = fit_segments(model, data.fit, checkpoint=checkpoint)
    assert done.status == "converged"
    np.testing.assert_allclose(done.model.values, whole.model.values, rtol=1e-4)
    assert not list(tmp_path.iterdir())


@pytest.mark.long
def test_kill_9_loses_no_more_than_the_last_seconds(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    cache, model, log, fitted = (tmp_path / name for name in ("cache", "two.toml", "log.parquet", "fitted.toml"))
    monkeypatch.setattr("platformdirs.user_cache_path", lambda _: cache / "lptn")
    model.write_text(MODEL)
    run = truth_run(3000.0, seed=1)
    pd.DataFrame({"time": run.time, **run.columns}).to_parquet(log)
    words = ["fit", str(model), str(log), "-o", str(fitted)]
    started = subprocess.Popen(
        [sys.executable, "-c", SLOW, *words], stdout=subprocess.DEVNULL, env=os.environ | {"XDG_CACHE_HOME": str(cache)}
    )
    stop = time.monotonic() + 60
    while not list(cache.glob("lptn/fits/*.json")) and started.poll() is None and time.monotonic() < stop:
        time.sleep(0.02)
    started.send_signal(signal.SIGKILL)
    assert started.wait() == -signal.SIGKILL
    assert not fitted.exists()
    assert len(list(cache.glob("lptn/fits/*.json"))) == 1

    _lptn("fit", model, log, "--holdout-after", 2500)  # another fit, which starts from nothing
    assert "continues from" not in capsys.readouterr().out
    _lptn(*words)
    assert capsys.readouterr().out.count("continues from the best saved point") == 1
    _lptn(*words)
    assert "continues from" not in capsys.readouterr().out
    assert not list(cache.glob("lptn/fits/*"))
    values = {parameter.name: parameter.value for parameter in read_model_file(fitted).network.parameters}
    assert values["capacity.a"] == pytest.approx(120.0, rel=0.02)


def test_a_damaged_checkpoint_or_one_of_another_model_is_none(tmp_path: Path) -> None:
    model, checkpoint = Model(network()), Checkpoint("f" * 64, tmp_path / "fits")
    assert checkpoint.load(model, 1) is None
    checkpoint.save(model, Point(model.values, [np.array([20.0, 21.0])], averaged=True))
    saved = checkpoint.load(model, 1)
    assert saved is not None
    assert saved.averaged
    np.testing.assert_array_equal(saved.starts[0], [20.0, 21.0])
    assert checkpoint.load(model, 2) is None
    whole = checkpoint.path.read_text()
    for damaged in (
        whole[:40],
        whole.replace("21.0", "NaN"),
        "[]",
        '{"averaged": 1, "values": 3, "starts": []}',
        "\x00",
    ):
        checkpoint.path.write_text(damaged)
        assert checkpoint.load(model, 1) is None


def test_a_cache_that_can_not_be_written_costs_no_fit(tmp_path: Path) -> None:
    (tmp_path / "fits").write_text("a file")
    checkpoint = Checkpoint("f" * 64, tmp_path / "fits", every=0.0)
    done = fit_segments(Model(network()), split_data([truth_run(900.0)]).fit, checkpoint=checkpoint)
    assert done.status == "converged"


def test_the_fingerprint_holds_model_logs_and_options() -> None:
    first = fingerprint_of("model", [("a.csv", "00")], {"weight": 0.0})
    assert first == fingerprint_of("model", [("a.csv", "00")], {"weight": 0.0})
    others = [
        fingerprint_of("model ", [("a.csv", "00")], {"weight": 0.0}),
        fingerprint_of("model", [("a.csv", "01")], {"weight": 0.0}),
        fingerprint_of("model", [("b.csv", "00")], {"weight": 0.0}),
        fingerprint_of("model", [("a.csv", "00")], {"weight": 1.0}),
    ]
    assert len({first, *others}) == 5
