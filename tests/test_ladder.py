"""The ladder: effects added until nothing is missing."""

from __future__ import annotations

import pickle
from concurrent.futures import ProcessPoolExecutor

import pytest

from lptn.evidence import Evidence, evidence
from lptn.ladder import Ladder, improve
from lptn.model import Model
from lptn.virtual import Hidden
from tests.diagnose.conftest import Leg, leg  # noqa: F401 - a fixture

TWO = (Hidden("forced_convection", "FR_thigh"), Hidden("sensor_offset", "FR_hip"))


@pytest.fixture(scope="module")
def climbed(leg: Leg) -> tuple[Model, Evidence, Ladder]:  # noqa: F811
    """A leg with two effects hidden, and its ladder; the held-out run serves as proof too."""
    model, data = leg(*TWO)
    data = Evidence(data.fit, data.holdout, data.holdout)
    return model, data, improve(model, data)


def test_two_hidden_effects_are_both_found_and_nothing_else(climbed: tuple[Model, Evidence, Ladder]) -> None:
    ladder = climbed[2]
    found = {(rung.effect, rung.at) for rung in ladder.rungs[1:]}
    assert found == {(hidden.effect, hidden.at) for hidden in TWO}
    assert ladder.verdict == "missing"
    assert ladder.remaining == "adequate"


def test_the_held_out_error_falls_to_the_noise(climbed: tuple[Model, Evidence, Ladder]) -> None:
    ladder = climbed[2]
    errors = [rung.holdout.rmse for rung in ladder.rungs if rung.holdout]
    assert errors[-1] < 0.2  # K; the sensors' noise is 0.15 K
    assert errors[-1] < 0.6 * errors[0]
    assert ladder.best.proof
    assert ladder.best.holdout
    assert ladder.best.proof.rmse == pytest.approx(ladder.best.holdout.rmse, rel=1e-9)


def test_json_has_the_agreed_fields(climbed: tuple[Model, Evidence, Ladder]) -> None:
    written = climbed[2].as_json()
    assert written["verdict"] == "missing"
    rungs = written["ladder"]
    assert isinstance(rungs, list)
    assert [rung["rung"] for rung in rungs] == list(range(len(rungs)))
    assert {"rung", "effect", "at", "parameters", "rmse_fit", "rmse_holdout", "max_holdout"} <= set(rungs[0])
    assert (rungs[0]["effect"], rungs[0]["at"]) == (None, None)
    assert rungs[-1]["parameters"] > rungs[0]["parameters"]


def test_declarations_rebuild_the_last_rung(climbed: tuple[Model, Evidence, Ladder]) -> None:
    model, _, ladder = climbed
    again = Model(model.network.with_effects(ladder.declarations()))
    added = {unknown.name: unknown.value for unknown in again.unknowns if unknown.name.startswith("forced")}
    fitted = {unknown.name: unknown.value for unknown in ladder.best.fit.model.unknowns}
    assert added
    for name, value in added.items():
        assert value == fitted[name]


def test_an_adequate_model_keeps_one_rung(leg: Leg) -> None:  # noqa: F811
    ladder = improve(*leg())
    assert len(ladder.rungs) == 1
    assert ladder.verdict == ladder.remaining == "adequate"


def test_without_held_out_data_the_criterion_ends_the_ladder(leg: Leg) -> None:  # noqa: F811
    model, data = leg(Hidden("forced_convection", "FR_thigh"))
    ladder = improve(model, evidence([part.run for part in data.fit]))
    assert [(rung.effect, rung.at) for rung in ladder.rungs[1:]] == [("forced_convection", "FR_thigh")]
    assert ladder.best.holdout is None


def test_models_travel_between_processes(climbed: tuple[Model, Evidence, Ladder]) -> None:
    ladder = climbed[2]
    again = pickle.loads(pickle.dumps(ladder.best.fit))
    assert again.cost == ladder.best.fit.cost
    assert again.problem.cost(again.z) == pytest.approx(ladder.best.fit.cost, rel=1e-12)


@pytest.mark.slow
def test_two_processes_climb_the_same_ladder(leg: Leg, climbed: tuple[Model, Evidence, Ladder]) -> None:  # noqa: F811
    model, data = leg(*TWO)
    with ProcessPoolExecutor(2) as pool:
        ladder = improve(model, data, executor=pool)
    alone = climbed[2]
    assert [(rung.effect, rung.at) for rung in ladder.rungs] == [(rung.effect, rung.at) for rung in alone.rungs]
    assert ladder.best.fit.cost == pytest.approx(alone.best.fit.cost, rel=1e-9)
