"""What a machine is made of: nothing where nothing is hidden, a conduction of any size, what is one place's own."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import expm

from lptn.diagnose.candidates import possible_effects
from lptn.diagnose.composition import _as_its_own, composition
from lptn.diagnose.diagnosis import diagnose, for_search
from lptn.diagnose.refits import refit
from lptn.identify.data import split_data
from lptn.identify.validation import fit_segments
from lptn.logs.run import Run
from lptn.model.file import parse_model
from lptn.model.model import Model
from lptn.virtual import Hidden
from tests.builders import make_run
from tests.diagnose.conftest import Leg, leg  # noqa: F401 - a fixture

STATOR = """
[model]
name = "stator"
ambient = "temperature.ambient"
[nodes.winding]
capacity = { value = 300, unit = "J/K", bounds = [20, 5000] }
[nodes.body]
capacity = { value = 500, unit = "J/K", bounds = [20, 5000] }
[[links]]
between = ["*", "ambient"]
resistance = { value = 2, unit = "K/W", bounds = [0.05, 50] }
[[effects]]
kind = "heat_input"
at = "winding"
gain = { value = 1, fixed = true }
"""
AIR, NOISE = 22.0, 0.1


def _stator(name: str, seed: int, conductance: float) -> Run:
    """Winding and body in air, joined by so many W/K; exact while the power holds."""
    rng, n = np.random.default_rng(seed), 2400
    power, capacities, losses = rng.uniform(0, 60, n // 200).repeat(200), np.array([250.0, 900.0]), np.array([0.2, 0.9])
    rates = np.array([[-1.0, 1.0], [1.0, -1.0]]) * conductance - np.diag(losses)
    rates = rates / capacities[:, None]
    over, rest, warm = expm(rates), np.linalg.inv(rates), np.zeros((2, n))
    for k in range(n - 1):
        settled = -rest @ np.array([power[k] / capacities[0], 0.0])
        warm[:, k + 1] = settled + over @ (warm[:, k] - settled)
    readings = AIR + warm + rng.normal(0, NOISE, (2, n))
    columns = {"temperature.ambient": np.full(n, AIR), "power.winding": power}
    return make_run(columns | dict(zip(("temperature.winding", "temperature.body"), readings, strict=True)), name=name)


@pytest.mark.parametrize("conductance", [0.7, 7.0, 20.0])
def test_what_conducts_a_hundred_times_as_well_as_is_usual_is_named_with_its_size(conductance: float) -> None:
    data = split_data([_stator("one", 1, conductance)], [_stator("two", 2, conductance)])
    model = Model(parse_model(STATOR, Path("stator.toml")).network)
    diagnosis = diagnose(model, data)
    (step,) = diagnosis.steps
    assert step.key == ("conduction", "body~winding")
    assert step.is_structure
    assert step.amplitude is not None
    error = step.fit.standard_errors[step.amplitude.name]
    assert abs(step.amplitude.value - conductance) < 3 * error + 0.02 * conductance
    assert step.holdout is not None
    assert step.holdout.rmse < NOISE
    assert diagnosis.verdict == "missing"


@pytest.mark.parametrize("conductance", [7.0, 20.0])
def test_conduction_is_refused_for_no_size(conductance: float) -> None:
    data = split_data([_stator("one", 1, conductance)], [_stator("two", 2, conductance)])
    diagnosis = diagnose(Model(parse_model(STATOR, Path("stator.toml")).network), data)
    assert ("conduction", "body~winding") in {step.key for step in diagnosis.steps}


@pytest.mark.parametrize(
    "seed", [11, pytest.param(12, marks=pytest.mark.slow), pytest.param(13, marks=pytest.mark.slow)]
)
def test_where_nothing_is_hidden_nothing_is_added(leg: Leg, seed: int) -> None:  # noqa: F811
    model, data = leg(seed=seed)
    coarse = for_search(data)
    given = fit_segments(model, coarse.fit)
    made = composition(given, coarse)
    assert made.steps == ()
    assert made.fit.cost == pytest.approx(given.cost, rel=1e-3)


@pytest.mark.long
def test_a_part_of_structure_shares_its_probability_with_what_the_data_cannot_tell_from_it(
    leg: Leg,  # noqa: F811
) -> None:
    """Where torque alone is logged, warm windings and weaker magnets heat alike; one was told as certain."""
    model, data = leg(Hidden("torque_constant_drop", "*"))
    twins = {("torque_constant_drop", "*"), ("resistance_rise", "*")}
    (step,) = (one for one in diagnose(model, data).steps if one.key in twins)
    assert {step.key, *step.indistinguishable} >= twins
    assert step.probability < 0.95 < step.at_its_place


def test_what_one_joint_had_beside_all_becomes_its_own_when_the_others_have_none(leg: Leg) -> None:  # noqa: F811
    """Heat of the thigh alone, in a model in which all have some and the thigh has more."""
    model, data = leg(Hidden("constant_heat", "FR_calf"))
    coarse = for_search(data)
    fit = fit_segments(model, coarse.fit)
    columns = set(coarse.fit[0].run.columns)
    everywhere = next(one for one in possible_effects(fit, columns) if one.key == ("constant_heat", "*"))
    common = everywhere.declaration(0.4)
    fit = refit(fit, common)
    beside = next(one for one in possible_effects(fit, columns) if one.key == ("constant_heat", "FR_calf"))
    own = beside.declaration(0.6)
    fit = refit(fit, own)
    assert own.difference
    alone = _as_its_own(own, fit, common)
    values = {parameter.name: parameter.value for parameter in fit.model.parameters}
    (power,) = alone.parameters
    assert not alone.difference
    assert power.value == pytest.approx(values[own.shared_name("power")] + values[common.shared_name("power")])
    assert power.bounds == alone.effect.parameters[0].bounds
