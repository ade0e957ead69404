"""What differs from log to log and is no part of the robot."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from lptn.diagnose.answers import Step
from lptn.diagnose.candidates import with_errors_of_runs
from lptn.diagnose.diagnosis import for_search
from lptn.diagnose.fit_statistics import explained_elsewhere
from lptn.diagnose.improvement import _less, improve
from lptn.diagnose.refits import refit
from lptn.diagnose.runs_that_differ import Cause, RunDifference, nuisances_at_limit, with_differences
from lptn.effects import catalogue
from lptn.identify.comparison import Errors, predict, with_own_errors
from lptn.identify.data import Segment
from lptn.identify.fitting import fit_starts, nuisances
from lptn.identify.validation import fit_segments, holdout_errors
from lptn.model.model import Model
from lptn.model.network import EffectDeclaration
from lptn.report.text import nuisances_in_words
from lptn.simulate.bound_run import bind
from lptn.simulate.simulation import simulate
from lptn.virtual import Hidden
from tests.diagnose.conftest import Leg


def _named(segments: Sequence[Segment], names: Sequence[str]) -> tuple[Segment, ...]:
    return tuple(
        replace(segment, run=replace(segment.run, name=name)) for segment, name in zip(segments, names, strict=True)
    )


@pytest.mark.parametrize("names", [("fit1", "fit2", "holdout"), ("log#1", "log#2", "log#3")], ids=["logs", "pieces"])
def test_a_held_out_run_with_a_wrong_ambient_does_not_judge_the_model_for_it(leg: Leg, names: tuple[str, ...]) -> None:
    model, data = leg(Hidden("ambient_offset", "ambient", size=0.4, run="holdout"))
    data = replace(data, fit=_named(data.fit, names[:2]), holdout=_named(data.holdout, names[2:]))
    coarse, errors = for_search(data), []
    for asked in (model, with_errors_of_runs(model, data, ambient=0.5)):
        held = holdout_errors(fit_segments(asked, coarse.fit), coarse.holdout)
        assert held is not None
        errors.append(held.rmse)
    assert errors[0] > 0.2  # K
    assert errors[1] < 0.1


def test_as_logged_a_held_out_run_is_predicted_as_the_model_without_nuisances_does(leg: Leg) -> None:
    """And worse than with them, where its ambient sensor is off: what somebody who takes the model will meet."""
    model, data = leg(Hidden("ambient_offset", "ambient", size=0.4, run="holdout"))
    coarse = for_search(data)
    fitted = fit_segments(with_errors_of_runs(model, data, ambient=0.5), coarse.fit)
    step = Step(fitted).made_for_use(coarse).judged_on(coarse)
    values = {
        parameter.name: parameter.value
        for parameter in step.for_use.model.parameters
        if not parameter.declared.nuisance
    }
    plain = predict(Model(model.network.with_values(values)), coarse.holdout[0], fitted.problem.sigma)
    assert step.holdout is not None
    assert step.holdout_as_logged is not None
    assert step.holdout_as_logged.rmse == pytest.approx(Errors.of(plain.error).rmse, rel=1e-9)
    assert step.holdout_as_logged.rmse > 2 * step.holdout.rmse


def test_a_nuisance_that_ends_at_its_limit_is_said(leg: Leg) -> None:
    """Air of fit2 that is off by 3 K, where 0.3 K are usual, and 0.6 K the most."""
    model, data = leg(Hidden("ambient_offset", "ambient", size=3.0, run="fit2"))
    coarse = for_search(data)
    fit = fit_segments(with_errors_of_runs(model, data, ambient=0.3, torque=0.0, surface=0.0), coarse.fit)
    (nuisance,) = [limited for limited in nuisances_at_limit(fit) if limited.run == "fit2"]
    assert (nuisance.effect, nuisance.at) == ("ambient_offset", "ambient")
    assert abs(nuisance.size) == pytest.approx(0.6)
    assert re.fullmatch("in fit2 the ambient was at least 0.6 K (warm|cool)er than given", nuisance.text)
    wide = fit_segments(with_errors_of_runs(model, data, ambient=5.0, torque=0.0, surface=0.0), coarse.fit)
    assert not nuisances_at_limit(wide)


@pytest.mark.parametrize(("off", "with_nuisances"), [(0.0, False), (2.0, True)])
def test_a_file_gets_the_fit_that_predicts_held_out_runs_as_they_were_logged(
    leg: Leg, off: float, with_nuisances: bool
) -> None:
    """What is a run's own takes from the parameters what is wrong in a log, or, where nothing is, what is right."""
    model, data = leg(Hidden("ambient_offset", "ambient", size=off, run="fit1")) if off else leg()
    coarse = for_search(data)
    fitted = fit_segments(with_errors_of_runs(model, data, ambient=2.0), coarse.fit)
    step = Step(fitted).made_for_use(coarse)
    without = fit_segments(model, coarse.fit)
    errors = [holdout_errors(fit, coarse.holdout, own_errors=False) for fit in (fitted, without, step.for_use)]
    rmse = [error.rmse for error in errors if error is not None]
    assert (step.for_use is fitted) is with_nuisances
    assert rmse[2] == pytest.approx(min(rmse[:2]), rel=1e-2)
    assert not any(effect.nuisance for effect in (step.plain or without).model.network.effects)


def test_a_nuisance_does_not_hide_what_the_model_lacks(leg: Leg) -> None:
    model, data = leg(Hidden("forced_convection", "FR_thigh"))
    coarse, errors = for_search(data), []
    for asked in (model, with_errors_of_runs(model, data, ambient=0.5)):
        held = holdout_errors(fit_segments(asked, coarse.fit), coarse.holdout)
        assert held is not None
        errors.append(held.rmse)
    assert errors[1] > 0.5 * errors[0]


def test_a_held_out_runs_errors_are_those_that_its_prediction_needs_from_the_start_that_it_has(leg: Leg) -> None:
    """No other ambient, torque or surface predicts it better, by a model that lacks something and has unseen states.

    With a start of their own, fitted to all of the run, these errors went with a warmth inside the joints that the
    prediction then did not begin with.
    """
    model, data = leg(Hidden("natural_convection", "*"), noise=0.02)
    coarse = for_search(data)
    declared = EffectDeclaration(catalogue()["second_mass"](), "*")
    fitted = fit_segments(with_errors_of_runs(Model(model.network.with_effects([declared])), data), coarse.fit)
    (segment,), sigma = coarse.holdout, fitted.problem.sigma
    own = with_own_errors(fitted.model, segment, sigma)
    chosen = nuisances(own, segment.run.name)
    assert len(chosen) == 7
    priors = np.array(
        [spread for index in chosen for _, spread in [own.parameters[index].declared.prior or (0.0, 1.0)]]
    )

    def misfit(model: Model) -> float:
        bound = bind(model, segment.run)
        (start,) = fit_starts(model, [bound.count(segment.initialisation).until(segment.initialisation[1])], sigma)
        error = simulate(model, bound, model.values, start).readings - bound.measured
        return float(np.nansum((error / sigma[:, None]) ** 2) + np.sum((model.values[chosen] / priors) ** 2))

    least = misfit(own)
    for index, prior in zip(chosen, priors, strict=True):
        limits = own.parameters[index].declared.bounds
        for change in (-0.2, 0.2):
            values = own.values
            values[index] = np.clip(values[index] + change * prior, *limits)
            assert misfit(own.with_values(values)) > 0.99 * least, own.parameters[index].name


def test_one_log_alone_has_no_nuisances(leg: Leg) -> None:
    model, data = leg()
    alone = type(data)(data.fit[:1])
    assert with_errors_of_runs(model, alone) is model


def test_torques_that_are_a_little_off_in_each_run_are_no_effect(leg: Leg) -> None:
    names = ("FR_thigh", "fit1", 0.15), ("FR_thigh", "fit2", -0.1), ("FR_calf", "holdout", 0.2)
    model, data = leg(*(Hidden("loss_scale", joint, size=share, run=run) for joint, run, share in names))
    assert improve(model, data, torque_error=0.0).verdict != "adequate"
    history = improve(model, data)
    assert (history.verdict, [step.key for step in history.steps]) == ("adequate", [("", "")])
    assert history.best.parameters == len(model.free)


@pytest.mark.parametrize(("at", "run"), [("FR_calf", ""), ("FR_calf", "fit1"), ("*", "")])
def test_a_surface_that_the_model_changes_already_may_differ_from_run_to_run_as_well(
    leg: Leg, at: str, run: str
) -> None:
    model, data = leg()
    fan = EffectDeclaration(catalogue()["surface_scale"](), at, run=run)
    declared = with_errors_of_runs(Model(model.network.with_effects([fan])), data).network.effects
    surfaces = [
        declaration for declaration in declared if declaration.nuisance and declaration.effect.key == "surface_scale"
    ]
    assert len(surfaces) == len(model.nodes) * 3  # runs


def test_a_run_gets_back_the_nuisance_parameter_that_a_step_stood_for(leg: Leg) -> None:
    model, data = leg()
    given = Step(fit_segments(with_errors_of_runs(model, data), for_search(data).fit))
    effects = given.fit.model.network.effects
    fan = EffectDeclaration(catalogue()["surface_scale"](), "FR_calf", run="fit1")
    named = Step(refit(given.fit, fan), fan)
    assert len(named.fit.model.network.effects) == len(effects)  # one more, and its nuisance parameter less
    assert _less((given, named), named)[0].effects == effects


def test_a_fan_of_one_held_out_run_is_no_nuisance_of_every_run(leg: Leg) -> None:
    model, data = leg()
    fan = catalogue()["surface_scale"]()
    cause = Cause(EffectDeclaration(fan, "FR_calf", fan.parameters, run="holdout"), 2.0, 0.1, "")
    differing = [RunDifference("holdout", 1.0, 0.1, (cause,))]
    words = nuisances_in_words(with_differences(with_errors_of_runs(model, data, surface=0.0), differing))
    assert words == "its ambient sensor off by 0.3 K and the heat that a joint's torque or current makes off by 3 %"


@pytest.mark.parametrize(
    ("before", "after", "explained"),
    [
        (0.5, 0.3, True),  # more than half of the squares beyond noise
        (0.5, 0.45, False),
        (0.17, 0.19, True),  # within noise before and after, where a tenth of a kelvin up or down is chance
        (0.17, 0.25, False),
        (0.25, 0.25, False),
    ],
)
def test_held_out_runs_within_noise_object_to_nothing(leg: Leg, before: float, after: float, explained: bool) -> None:
    model, data = leg(noise=0.2)
    fit = fit_segments(model, data.fit)
    assert np.allclose(fit.noise.floor, 0.2, rtol=0.1)
    floor = float(np.sqrt(np.mean(fit.noise.floor**2))) / 0.2
    errors = [Errors.of(np.full((1, 10), floor * size)) for size in (before, after)]
    assert explained_elsewhere(fit, *errors) is explained


def test_a_surface_that_loses_a_little_more_in_each_run_is_no_effect(leg: Leg) -> None:
    names = ("FR_thigh", "fit1", 0.3), ("FR_calf", "fit2", -0.3), ("FR_thigh", "holdout", -0.3)
    model, data = leg(*(Hidden("surface_scale", joint, size=share, run=run) for joint, run, share in names), noise=0.03)
    assert improve(model, data, surface_error=0.0).verdict != "adequate"
    assert improve(model, data).verdict == "adequate"


def test_a_fan_in_one_run_is_named_at_its_full_size(leg: Leg) -> None:
    history = improve(*leg(Hidden("surface_scale", "FR_thigh", size=2.0, run="fit1")))
    assert [step.key for step in history.steps[1:]] == [("surface_scale", "FR_thigh@fit1")]
    values = {parameter.name: parameter.value for parameter in history.best.fit.model.parameters}
    assert values["surface_scale.change.FR_thigh@fit1"] == pytest.approx(0.6, rel=0.1)


def test_a_torque_that_is_far_off_in_one_run_is_named_at_its_full_size(leg: Leg) -> None:
    history = improve(*leg(Hidden("loss_scale", "FR_thigh", run="fit1")))
    assert [step.key for step in history.steps[1:]] == [("loss_scale", "FR_thigh@fit1")]
    values = {parameter.name: parameter.value for parameter in history.best.fit.model.parameters}
    assert values["loss_scale.change.FR_thigh@fit1"] == pytest.approx(0.2, rel=0.1)
    assert "loss_scale_nuisance.change.FR_thigh@fit1" not in values


@pytest.mark.long
def test_what_a_log_had_wrong_does_not_depend_on_how_often_it_reads(leg: Leg) -> None:
    model, data = leg(Hidden("forced_convection", "FR_thigh", size=0.1))
    coarse, offsets = for_search(data), []
    with_errors = with_errors_of_runs(model, data, ambient=0.05, torque=0.0, surface=0.0)
    fit = fit_segments(with_errors, coarse.fit)
    for segment in (data.holdout[0], coarse.holdout[0]):
        own = with_own_errors(fit.model, segment, fit.problem.sigma)
        offsets.append(
            next(parameter.value for parameter in own.parameters if parameter.name.endswith("ambient@holdout"))
        )
    assert (data.holdout[0].run.step, coarse.holdout[0].run.step) == (1.0, 5.0)
    assert 0.01 < abs(offsets[1]) < 0.09  # K; between nothing and the most
    assert offsets[0] == pytest.approx(offsets[1], rel=0.02)
