"""Error per run, node and operating condition."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from lptn.identify.comparison import Comparison, Errors, compare
from lptn.identify.data import DataSplit, holdout_segment, split_data
from lptn.model.model import Model
from tests.identify.truth import TRUTH, network, truth_run, with_garbage

NOISE = 0.1


@pytest.fixture(scope="module")
def true_model() -> Model:
    return Model(network().with_values(TRUTH))


@pytest.fixture(scope="module")
def held_out() -> DataSplit:
    return split_data(
        [truth_run(300.0)], [truth_run(1500.0, seed=1, noise=NOISE), truth_run(900.0, seed=2, noise=NOISE)]
    )


@pytest.fixture(scope="module")
def perfect(true_model: Model, held_out: DataSplit) -> Comparison:
    return compare(true_model, held_out.holdout)


def test_a_perfect_model_errs_by_the_noise(perfect: Comparison) -> None:
    assert perfect.all.rmse == pytest.approx(NOISE, rel=0.1)
    assert perfect.all.max < 6 * NOISE
    assert abs(perfect.all.mean) < 0.3 * NOISE
    for name in perfect.model.nodes:
        assert perfect.node(name).rmse == pytest.approx(perfect.floor(name), rel=0.15)


def test_nothing_counts_within_the_initialisation_window(perfect: Comparison) -> None:
    for prediction in perfect.predictions:
        initialising = prediction.segment.run.time < prediction.segment.initialisation[1]
        assert np.isnan(prediction.error[:, initialising]).all()
        assert np.isfinite(prediction.error[:, ~initialising]).all()
    assert perfect.all.count == 2 * (1350 + 810)


def test_the_start_comes_from_the_initialisation_window_alone(true_model: Model, held_out: DataSplit) -> None:
    segment = held_out.holdout[0]
    spoilt = replace(segment.run, columns={name: values.copy() for name, values in segment.run.columns.items()})
    spoilt.columns["temperature.a"][segment.run.time >= segment.initialisation[1]] += 50.0
    (prediction,) = compare(true_model, [replace(segment, run=spoilt)]).predictions
    (before,) = compare(true_model, [segment]).predictions
    np.testing.assert_allclose(prediction.readings, before.readings, atol=0.05)


def test_error_is_predicted_minus_measured(true_model: Model, held_out: DataSplit) -> None:
    """A winding that the model believes to have more resistance is predicted too hot."""
    hot = Model(true_model.network.with_values({"copper_loss.resistance.a": 0.25}))
    comparison = compare(hot, held_out.holdout)
    assert comparison.node("a").mean > 1.0
    assert comparison.node("b").mean > 0.5
    assert comparison.all.rmse > comparison.all.mean > 0


def test_errors_of_numbers() -> None:
    errors = Errors.of(np.array([3.0, -4.0, np.nan]))
    assert (errors.max, errors.mean, errors.count) == (4.0, -0.5, 2)
    assert errors.rmse == pytest.approx(np.sqrt(12.5))


def test_errors_of_nothing_are_no_numbers() -> None:
    errors = Errors.of(np.array([np.nan]))
    assert errors.count == 0
    assert np.isnan([errors.rmse, errors.max, errors.mean]).all()


def test_json_has_the_agreed_keys(perfect: Comparison) -> None:
    written = json.loads(json.dumps(perfect.as_json(), allow_nan=False))
    assert set(written) == {"runs", "all"}
    assert set(written["all"]) == {"rmse", "max"}
    assert set(written["runs"]) == {"run1", "run2"}
    for run in written["runs"].values():
        assert set(run) == {"nodes"}
        assert set(run["nodes"]) == {"a", "b"}
        for errors in run["nodes"].values():
            assert {"rmse", "max", "mean"} <= set(errors)
    assert written["all"]["rmse"] == pytest.approx(perfect.all.rmse)


def test_json_leaves_out_a_node_that_is_not_measured(true_model: Model, held_out: DataSplit) -> None:
    segment = held_out.holdout[0]
    columns = {name: values for name, values in segment.run.columns.items() if name != "temperature.b"}
    written = compare(true_model, [replace(segment, run=replace(segment.run, columns=columns))]).as_json()
    text = json.dumps(written, allow_nan=False)
    assert set(json.loads(text)["runs"]["run1"]["nodes"]) == {"a"}


def test_json_keeps_two_runs_of_the_same_name(true_model: Model, held_out: DataSplit) -> None:
    segment = held_out.holdout[0]
    runs = compare(
        true_model, [segment, replace(segment, run=replace(segment.run, source="elsewhere/run1.csv"))]
    ).as_json()["runs"]
    assert isinstance(runs, dict)
    assert len(runs) == 2


def test_bins_of_each_condition_hold_every_counted_reading_once(true_model: Model) -> None:
    run = with_garbage(truth_run(1500.0, seed=1))
    comparison = compare(true_model, [holdout_segment(run)])
    conditions = comparison.conditions()
    assert {"torque [N·m]", "temperature [°C]", "time since start [s]"} <= {c.quantity for c in conditions}
    for name in true_model.nodes:
        counted = comparison.node(name).count
        for quantity in {c.quantity for c in conditions if c.node == name}:
            bins = [c for c in conditions if (c.node, c.quantity) == (name, quantity)]
            assert sum(c.errors.count for c in bins) == counted
            assert sum(c.errors.rmse**2 * c.errors.count for c in bins) == pytest.approx(
                comparison.node(name).rmse ** 2 * counted
            )
            assert all(c.lower < c.upper for c in bins)


def test_a_condition_that_never_changes_is_left_out(true_model: Model) -> None:
    run = truth_run(600.0)
    columns = {**run.columns, "torque.a": np.full(len(run), 3.0)}
    conditions = compare(true_model, [holdout_segment(replace(run, columns=columns))]).conditions()
    assert "torque [N·m]" not in {c.quantity for c in conditions}
