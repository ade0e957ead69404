"""Two models on the same logs."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from lptn.basics.errors import InputError
from lptn.identify.comparison import Pair, Versus, versus
from lptn.identify.data import split_data
from lptn.model.model import Model
from lptn.model.network import LinkDeclaration, Network, NodeDeclaration
from lptn.report.pages import versus_html
from lptn.simulate.bound_run import bind
from lptn.simulate.simulation import simulate
from tests.builders import AMBIENT, capacity, effect, leg, make_run, random_run, resistance


def _coupled() -> Model:
    return Model(leg([effect("copper_loss")]))


def _alone() -> Model:
    names = ("FR_hip", "FR_thigh", "FR_calf")
    nodes = tuple(NodeDeclaration(name, capacity(300.0)) for name in names)
    links = tuple(LinkDeclaration((name, "ambient"), resistance(10.0)) for name in names)
    return Model(Network("single nodes", (*nodes, AMBIENT), links, (effect("copper_loss"),)))


@pytest.fixture(scope="module")
def result() -> Versus:
    model, rng = _coupled(), np.random.default_rng(0)
    runs = []
    for seed, name in enumerate(("monday", "tuesday")):
        run = random_run(model, 900, seed, hold=300)
        readings = simulate(model, bind(model, run)).readings + rng.normal(0, 0.05, (3, 900))
        measured = {f"temperature.{node}": row for node, row in zip(model.nodes, readings, strict=True)}
        runs.append(make_run({**run.columns, **measured}, name=name))
    return versus(model, _alone(), split_data((), runs).holdout)


def test_a_pair_has_the_errors_and_the_reduction_of_the_largest() -> None:
    pair = Pair.of("all", (np.array([1.0, -2.0, np.nan]), np.array([-4.0, 2.0, np.nan])))
    assert pair.mean == (1.5, 3.0)
    assert pair.square == (2.5, 10.0)
    assert pair.max == (2.0, 4.0)
    assert pair.reduction == 0.5
    assert pair.square_reduction == 0.75


def test_classes_and_runs_are_those_of_the_logs(result: Versus) -> None:
    assert [pair.what for pair in result.classes] == ["*_hip", "*_thigh", "*_calf", "all"]
    assert [pair.what for pair in result.runs] == ["monday", "tuesday"]
    assert all(pair.mean[0] < 0.1 < pair.mean[1] for pair in result.runs)
    whole = np.concatenate([prediction.error.ravel() for prediction in result.other.predictions])
    assert result.classes[-1].mean[1] == pytest.approx(np.nanmean(np.abs(whole)))


@pytest.mark.long
def test_json_and_page_name_both_models(result: Versus) -> None:
    written = result.as_json()
    assert written["models"] == ["leg", "single nodes"]
    page = versus_html(result, "leg against single nodes")
    assert "monday" in page
    assert page.count("single nodes") > 2  # in the table's head as in the text
    assert "the model as given" not in page


def test_models_without_a_node_in_common_are_not_compared(tmp_path: Path) -> None:
    other = Model(
        Network("x", (NodeDeclaration("x", capacity()), AMBIENT), (LinkDeclaration(("x", "ambient"), resistance()),))
    )
    run = random_run(_coupled(), 300)
    both = make_run({**run.columns, "temperature.x": run.columns["temperature.FR_hip"]})
    with pytest.raises(InputError, match="none that both models have"):
        versus(_coupled(), other, split_data((), [both]).holdout)
