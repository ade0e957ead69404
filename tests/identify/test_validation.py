"""Choosing the left-right weight by runs that the fit never saw."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from lptn.basics.errors import InputError
from lptn.identify.comparison import predict
from lptn.identify.data import DataSplit, load_model, split_data
from lptn.identify.validation import fit_segments, spread_of, symmetry_trials
from lptn.logs.run import Run
from lptn.model.model import Model
from lptn.model.network import LinkDeclaration, Network, NodeDeclaration
from lptn.robots.presets import preset_text
from lptn.virtual import leg_logs, write_logs
from tests.builders import AMBIENT, capacity, effect, make_run, resistance

_SIDES = ("left_knee", "right_knee")


def _model(share: str = "sides") -> Model:
    nodes = tuple(NodeDeclaration(name, capacity(300.0, share=share)) for name in _SIDES)
    links = tuple(LinkDeclaration((name, "ambient"), resistance(8.0, share=share)) for name in _SIDES)
    return Model(Network("knees", (*nodes, AMBIENT), links, (effect("copper_loss"),)))


def _run(name: str, load: tuple[float, float], seconds: int, noise: float, seed: int) -> Run:
    """Two equal knees, one of which is hardly loaded in the runs to fit."""
    rng = np.random.default_rng(seed)
    torque = {f"torque.{side}": np.full(seconds, size) for side, size in zip(_SIDES, load, strict=True)}
    heat = np.array([0.15 * (size / 0.84) ** 2 for size in load])
    times = np.arange(seconds + 1.0)
    solved = solve_ivp(lambda _, y: (heat - (y - 20.0) / 9.0) / 320.0, (0, seconds), [22.0, 22.0], t_eval=times)
    means = 0.5 * (solved.y[:, 1:] + solved.y[:, :-1])
    read = {f"temperature.{side}": row + rng.normal(0, noise, seconds) for side, row in zip(_SIDES, means, strict=True)}
    return make_run(
        {**read, **torque, "temperature.ambient": np.full(seconds, 20.0)}, step=1.0, averaged=True, name=name
    )


def _data() -> DataSplit:
    return split_data([_run("fit", (9.0, 0.5), 900, 0.5, seed=1)], [_run("held", (1.0, 9.0), 900, 0.05, seed=2)])


def test_a_side_that_was_never_loaded_is_learnt_from_the_other() -> None:
    trials = symmetry_trials(_model(), _data(), penalties=(0.0, 1e2, 1e4))
    assert [trial.symmetry_penalty for trial in trials] == [0.0, 1e2, 1e4]
    best = min(trials, key=lambda trial: trial.holdout.rmse)
    assert best.symmetry_penalty > 0
    assert best.holdout.rmse < 0.5 * trials[0].holdout.rmse


def test_without_pairs_or_without_held_out_runs_there_is_nothing_to_choose() -> None:
    with pytest.raises(InputError, match="no left-right pair"):
        symmetry_trials(_model("each"), _data())
    with pytest.raises(InputError, match="nothing held out"):
        symmetry_trials(_model(), DataSplit(_data().fit))


@pytest.mark.long
def test_readings_scatter_about_predictions_as_stated_where_nothing_is_missing(tmp_path: Path) -> None:
    (tmp_path / "leg.toml").write_text(preset_text("leg"))
    *fitted, held_out = write_logs(tmp_path, leg_logs([], seed=3, rate=1.0))
    loaded = load_model(tmp_path / "leg.toml")
    data = split_data(loaded.runs(fitted), loaded.runs([held_out]))
    fit = fit_segments(loaded.model, data.fit)
    prediction = predict(fit.model, data.holdout[0], fit.problem.sigma)
    spread = spread_of(fit, prediction)
    error = prediction.error[:, np.searchsorted(prediction.bound.run.time, spread.time)]
    within = np.abs(error) < 1.96 * spread.size
    assert np.mean(within[np.isfinite(error)]) == pytest.approx(0.95, abs=0.02)
