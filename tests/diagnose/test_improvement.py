"""Forward selection: effects added until nothing is missing."""

from __future__ import annotations

import pickle
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace

import pytest

from lptn.basics.parameters import Parameter
from lptn.diagnose.advice import advise
from lptn.diagnose.answers import Step
from lptn.diagnose.candidates import with_errors_of_runs
from lptn.diagnose.diagnosis import for_search
from lptn.diagnose.fit_statistics import is_negligible
from lptn.diagnose.improvement import Branch, History, _at_full_resolution, _less, _Search, effects_added, improve
from lptn.diagnose.refits import continued, refit
from lptn.effects import catalogue
from lptn.identify.data import DataSplit, split_data
from lptn.identify.validation import fit_segments, holdout_errors
from lptn.model.model import Model
from lptn.model.network import EffectDeclaration
from lptn.virtual import Hidden
from tests.diagnose.conftest import Leg, leg  # noqa: F401 - a fixture

TWO = (Hidden("forced_convection", "FR_thigh"), Hidden("sensor_offset", "FR_hip"))


@pytest.fixture(scope="module")
def improved(leg: Leg) -> tuple[Model, DataSplit, History]:  # noqa: F811
    """A leg with two effects hidden, and its history; the held-out run serves as test too."""
    model, data = leg(*TWO)
    data = DataSplit(data.fit, data.holdout, data.holdout)
    return model, data, improve(model, data)


@pytest.mark.long
def test_two_hidden_effects_are_both_found_and_nothing_else(improved: tuple[Model, DataSplit, History]) -> None:
    history = improved[2]
    steps = {(step.effect, step.at) for step in history.steps[1:]}
    assert steps == {(hidden.effect, hidden.at) for hidden in TWO}
    assert history.verdict == "missing"
    assert history.remaining == "adequate"


def test_what_would_be_missed_most_is_told_first(improved: tuple[Model, DataSplit, History]) -> None:
    history = improved[2]
    best = history.best.fit
    others = [best.model.network.without_effect(*step.key) for step in history.steps[1:]]
    missed = [fit_segments(Model(network), improved[1].fit).cost - best.cost for network in others]
    assert missed == sorted(missed, reverse=True)
    assert min(missed) > 0


@pytest.mark.long
def test_a_step_gives_way_to_what_is_more_probable_beside_the_others(leg: Leg) -> None:  # noqa: F811
    """Where an offset was hidden, one with a heat in its place, chosen while the wind was missing, say."""
    model, data = leg(Hidden("forced_convection", "*"), Hidden("sensor_offset", "FR_hip"))
    coarse, said = for_search(data), list[str]()
    branch = _branch(model, coarse, ("constant_heat", "FR_hip"), ("forced_convection", "*"))
    search = _Search(coarse, None, said.append, lambda _: None)
    search.branches = [branch[:1]]
    settled = search.settled(branch)
    assert said == ["constant_heat at FR_hip gives way to sensor_offset at FR_hip"]
    assert {step.key for step in settled[1:]} == {("sensor_offset", "FR_hip"), ("forced_convection", "*")}


def _branch(model: Model, coarse: DataSplit, *added: tuple[str, str], difference: bool = False) -> Branch:
    """The model, then with each of some effects; the last one as a difference from one that all have."""
    branch: Branch = (Step(fit_segments(with_errors_of_runs(model, coarse), coarse.fit)),)
    for kind, where in added:
        at, _, run = where.partition("@")
        own = EffectDeclaration(catalogue()[kind](), at, run=run, difference=difference and (kind, where) == added[-1])
        switched = tuple(replace(parameter.switched_on, share="all") for parameter in own.effect.stated(own.difference))
        declared = replace(own, parameters=switched)
        step = Step(refit(branch[-1].fit, declared), declared)
        branch = (*branch, replace(step, holdout=holdout_errors(step.fit, coarse.holdout)))
    return branch


def test_what_one_joint_has_beside_all_gives_way_to_its_own_where_the_others_have_none(leg: Leg) -> None:  # noqa: F811
    """Heat at two of three joints, told as heat of all three and less of it at the third, say, or more at two."""
    model, data = leg(Hidden("constant_heat", "FR_hip", size=1.0), Hidden("constant_heat", "FR_calf", size=0.4))
    coarse, said = for_search(data), list[str]()
    branch = _branch(model, coarse, ("constant_heat", "*"), ("constant_heat", "FR_hip"), difference=True)
    shorter_network, (_, own) = _less(branch, branch[1])
    assert own.key == ("constant_heat", "FR_hip")
    assert own.declaration is not None
    assert not own.declaration.difference
    assert shorter_network.effects[-1] == own.declaration
    both = [replace(step, fit=branch[-1].fit).amplitude for step in branch[1:]]
    (power,) = own.declaration.parameters
    assert power.value == pytest.approx(sum(amplitude.value for amplitude in both if amplitude is not None))
    assert power.bounds == own.declaration.effect.parameters[0].bounds
    search = _Search(coarse, None, said.append, lambda _: None)
    search.branches = [branch[:1]]
    settled = search.settled(branch)
    assert said == ["constant_heat at * gives way to constant_heat at FR_calf"]
    assert {step.key for step in settled[1:]} == {("constant_heat", "FR_hip"), ("constant_heat", "FR_calf")}


def test_the_model_that_is_told_keeps_what_the_search_kept(leg: Leg) -> None:  # noqa: F811
    """Of the hip's capacity a tenth more than the log asks for, as if it would vanish beside the wind otherwise."""
    model, data = leg(Hidden("forced_convection", "FR_thigh"))
    given, last = _branch(model, for_search(data), ("forced_convection", "FR_thigh"))
    name = "capacity.FR_hip"
    (capacity,) = (parameter for parameter in last.fit.model.parameters if parameter.name == name)
    within = {name: (1.1 * capacity.value, capacity.declared.bounds[1])}
    kept = replace(last, fit=continued(last.fit, last.fit.model.network, within=within))
    for end, times in ((last, 1.0), (kept, 1.1)):
        told = _at_full_resolution((given, end), data)[-1].for_use.model.parameters
        (after,) = (parameter.value for parameter in told if parameter.name == name)
        assert after == pytest.approx(times * capacity.value, rel=0.02)


@pytest.mark.parametrize(("size", "kept"), [(0.004, False), (0.4, True)])
def test_a_step_that_explains_less_than_anyone_looks_for_is_left_out(leg: Leg, size: float, kept: bool) -> None:  # noqa: F811
    """Hundredths of a kelvin, however well long clean logs show them."""
    model, data = leg(Hidden("forced_convection", "*"), Hidden("constant_heat", "FR_calf", size=size))
    coarse = for_search(data)
    branch = _branch(model, coarse, ("forced_convection", "*"), ("constant_heat", "FR_calf"))
    shorter, longer = branch[-2].predicting(coarse), branch[-1].predicting(coarse)
    assert is_negligible(shorter.fit, longer.fit, shorter.predicted, longer.predicted) != kept
    search = _Search(coarse, None, lambda _: None, lambda _: None)
    search.branches = [branch[:1], branch[:2]]
    settled = search.settled(branch)
    assert (("constant_heat", "FR_calf") in {step.key for step in settled}) == kept
    assert ("forced_convection", "*") in {step.key for step in settled}


def test_an_error_of_the_log_that_is_the_only_step_stays_however_little_it_explains(
    leg: Leg,  # noqa: F811
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """It stands beside no others, and without it the answer would be that nothing explains what it does."""
    model, data = leg(Hidden("ambient_offset", "ambient", size=0.6), noise=0.03)
    coarse = for_search(data)
    given, error = (step.predicting(coarse) for step in _branch(model, coarse, ("ambient_offset", "ambient")))
    assert is_negligible(given.fit, error.fit, given.predicted, error.predicted)
    search = _Search(coarse, None, lambda _: None, lambda _: None)
    search.branches = [(given,)]
    monkeypatch.setattr(_Search, "_errors_are_believed", lambda *_: True)
    assert search.settled((given, error)) == (given, error)


def test_where_none_that_was_followed_to_the_end_is_believed_there_the_next_ones_are(
    leg: Leg,  # noqa: F811
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    model, data = leg(Hidden("surface_scale", "FR_calf", size=0.4, run="fit1"))
    coarse = for_search(data)
    keys = [("surface_scale", "FR_calf@fit1"), ("surface_scale", "FR_calf@fit2")]
    pool = [_branch(model, coarse, key) for key in keys]
    ended = _Search._believed_with
    search = _Search(DataSplit(coarse.fit), None, lambda _: None, lambda _: None)
    likeliest = search._next(pool, 1)[0][-1].key
    for believed in ([key for key in keys if key != likeliest], []):
        monkeypatch.setattr(
            _Search, "_believed_with", lambda *args, keys=believed: ended(*args) if args[1][-1].key in keys else None
        )
        assert [branch[-1].key for branch in search._next(pool, 1)] == believed


def test_at_full_resolution_a_time_constant_may_be_shorter_than_the_steps_of_the_search(leg: Leg) -> None:  # noqa: F811
    """And effects may stand in another order than they were added in: each keeps its own."""
    model, data = leg(Hidden("sensor_lag", "FR_hip"))
    coarse = for_search(data)
    given, mass, lag = _branch(model, coarse, ("second_mass", "FR_calf"), ("sensor_lag", "FR_hip"))
    assert lag.declaration is not None
    cut = replace(lag.declaration, parameters=tuple(_from(40.0, parameter) for parameter in lag.declaration.parameters))
    searched = refit(mass.fit, cut)
    assert searched.model.network.parameters[-1].value == pytest.approx(40.0)
    reordered = (given, replace(lag, declaration=cut), replace(mass, fit=searched))
    last = _at_full_resolution(reordered, data)[-1].fit.model
    values = {parameter.name: parameter.value for parameter in last.parameters}
    assert values["sensor_lag.time_constant.FR_hip"] == pytest.approx(20.0, rel=0.1)
    assert values["second_mass.capacity.FR_calf"] < 30.0


def _from(shortest: float, parameter: Parameter) -> Parameter:
    """A time constant with another lower bound."""
    if parameter.unit != "s":
        return parameter
    return replace(parameter, bounds=(shortest, parameter.bounds[1]), value=max(shortest, parameter.value))


@pytest.mark.parametrize("likely", [True, False])
def test_an_error_of_the_log_stays_only_while_it_is_likelier_than_all_in_the_robot(
    leg: Leg,  # noqa: F811
    monkeypatch: pytest.MonkeyPatch,
    likely: bool,
) -> None:
    """However well it predicts: here it is the truth, and goes only because it is said to be unlikely."""
    model, data = leg(Hidden("forced_convection", "*"), Hidden("sensor_offset", "FR_hip"))
    coarse, said = for_search(data), list[str]()
    branch = _branch(model, coarse, ("sensor_offset", "FR_hip"), ("forced_convection", "*"))
    search = _Search(coarse, None, said.append, lambda _: None)
    search.branches = [branch[:1]]
    monkeypatch.setattr(_Search, "_errors_are_believed", lambda *_: likely)
    settled = search.settled(branch)
    assert (("sensor_offset", "FR_hip") in {step.key for step in settled}) == likely
    assert any(text.startswith("sensor_offset at FR_hip gives way to") for text in said) != likely


def test_an_error_of_the_log_is_believed_only_where_most_of_the_misfit_goes_with_it(leg: Leg) -> None:  # noqa: F811
    """Where friction is missing at the same joint, some of the misfit goes with a drift of its sensor, too."""
    friction, drift = ("viscous_friction", "FR_calf"), ("sensor_drift", "FR_calf")
    model, data = leg(Hidden(*friction, size=2.0), Hidden(*drift))
    coarse = for_search(data)
    search = _Search(coarse, None, lambda _: None, lambda _: None)
    given, alone = _branch(model, coarse), _branch(model, coarse, drift)[-1]
    assert alone.fit.cost < 0.95 * given[-1].fit.cost
    assert not search._explains_half(given, alone)
    *with_friction, both = _branch(model, coarse, friction, drift)
    assert search._explains_half(tuple(with_friction), both)


@pytest.mark.parametrize("late", ["sensor_lag", "clock_offset"])
def test_a_clock_is_believed_only_where_no_lags_do_as_well(leg: Leg, late: str) -> None:  # noqa: F811
    """A lag looks like a delay; a delay is like no number of lags."""
    model, data = leg(Hidden(late, "*"))
    coarse = for_search(data)
    given, clock = _branch(model, coarse), _branch(model, coarse, ("clock_offset", "*"))[-1]
    assert clock.fit.cost < 0.5 * given[-1].fit.cost
    search = _Search(coarse, None, lambda _: None, lambda _: None)
    confused = {step.key for step in search._with_all_confused(given, clock)[1:]}
    assert confused == {("sensor_lag", "*"), ("winding_mass", "*"), ("second_mass", "*")}
    assert search._errors_are_believed(given) == (late == "clock_offset")


@pytest.mark.parametrize("late", [0.3, 0.0])
def test_a_clock_stands_where_heat_is_late_as_well(leg: Leg, late: float) -> None:  # noqa: F811
    """All lags together do better than a clock of 9 s alone, and worse than with it."""
    hidden = [Hidden("clock_offset", "*", size=late)] if late else []
    model, data = leg(*hidden, Hidden("second_mass", "*", size=2.0))
    coarse = for_search(data)
    given, clock = _branch(model, coarse), _branch(model, coarse, ("clock_offset", "*"))[-1]
    search = _Search(coarse, None, lambda _: None, lambda _: None)
    lags = search._with_all_confused(given, clock)
    assert lags[-1].fit.cost < clock.fit.cost
    assert search._stands(given, clock) == (late > 0)


@pytest.mark.long
def test_what_sets_one_joint_apart_is_told_before_what_all_have(leg: Leg) -> None:  # noqa: F811
    model, data = leg(Hidden("forced_convection", "*"), Hidden("sensor_offset", "FR_hip"))
    history = improve(model, data)
    assert [step.key for step in history.steps[1:]] == [("sensor_offset", "FR_hip"), ("forced_convection", "*")]
    offset, wind = history.steps[1:]
    assert wind.gain > offset.gain


@pytest.mark.long
def test_an_error_of_the_log_is_told_before_what_all_have(leg: Leg) -> None:  # noqa: F811
    model, data = leg(Hidden("forced_convection", "*"), Hidden("clock_offset", "*", size=0.25))
    coarse = for_search(data)
    branch = _branch(model, coarse, ("forced_convection", "*"), ("clock_offset", "*"))
    reordered = _Search(coarse, None, lambda _: None, lambda _: None).reconsidered(branch)
    assert [step.effect for step in reordered[1:]] == ["clock_offset", "forced_convection"]
    assert reordered[1].gain < reordered[2].gain  # it is not told first for what would be missed most


@pytest.mark.long
def test_everywhere_in_one_run_is_no_place_that_shares_what_is_missing_everywhere(leg: Leg) -> None:  # noqa: F811
    """Heat in one run that is hardly there would be told first because a lag, everywhere, surely is."""
    model, data = leg(Hidden("forced_convection", "*"), Hidden("sensor_lag", "*"))
    coarse = for_search(data)
    branch = _branch(model, coarse, ("forced_convection", "*"), ("constant_heat", "*@fit1"))
    reordered = _Search(coarse, None, lambda _: None, lambda _: None).reconsidered(branch)
    assert [step.key for step in reordered[1:]] == [("forced_convection", "*"), ("constant_heat", "*@fit1")]
    assert reordered[2].at_its_place < 0.5 < reordered[1].at_its_place


def test_a_step_is_as_probable_as_it_is_beside_the_others(improved: tuple[Model, DataSplit, History]) -> None:
    history = improved[2]
    # While the larger effect is missing the smaller one has rivals that disappear with it.
    assert all(step.probability > 0.9 for step in history.steps[1:])
    assert all(not step.indistinguishable for step in history.steps[1:])
    assert history.rivals == ()  # nothing is left for an experiment to decide


def test_what_is_to_be_decided_is_what_the_steps_leave_open(leg: Leg) -> None:  # noqa: F811
    """Grease and eddy currents go with the same square of speed, whatever was thought before the wind was found."""
    model, data = leg(Hidden("viscous_friction", "FR_thigh"), Hidden("forced_convection", "*"))
    history = improve(model, data)
    first_open = next(step for step in history.steps[1:] if step.indistinguishable)
    assert {step.key for step in history.rivals} == {first_open.key, *first_open.indistinguishable}
    assert ("viscous_friction", "FR_thigh") in {step.key for step in history.rivals}
    experiment = advise(history.first, history.best.fit, for_search(data), rivals=history.rivals).experiment
    assert experiment is not None
    assert set(experiment.rivals) <= {step.key for step in history.rivals}


def test_an_offset_of_all_sensors_fits_as_well_as_air_that_is_so_much_warmer(leg: Leg) -> None:  # noqa: F811
    model, data = leg(Hidden("sensor_offset", "*"))
    costs = []
    for effect, at in (("sensor_offset", "*"), ("ambient_offset", "ambient")):
        declared = EffectDeclaration(catalogue()[effect](), at)
        parameters = tuple(replace(parameter, share="all").switched_on for parameter in declared.effect.parameters)
        network = model.network.with_effects([replace(declared, parameters=parameters)])
        costs.append(fit_segments(Model(network), data.fit).cost)
    assert costs[0] == pytest.approx(costs[1], rel=1e-4)


def test_the_held_out_error_falls_to_the_noise(improved: tuple[Model, DataSplit, History]) -> None:
    model, data, history = improved
    given = holdout_errors(fit_segments(model, data.fit), data.holdout)  # without nuisance parameters
    errors = [step.holdout.rmse for step in history.steps if step.holdout]
    assert given
    assert errors[-1] < 0.2  # K; the sensors' noise is 0.15 K
    assert errors[-1] < 0.6 * given.rmse
    assert history.best.test
    assert history.best.holdout
    assert history.best.test.rmse == pytest.approx(history.best.holdout.rmse, rel=1e-9)


def test_json_has_the_agreed_fields(improved: tuple[Model, DataSplit, History]) -> None:
    written = improved[2].as_json()
    assert written["verdict"] == "missing"
    steps = written["history"]
    assert isinstance(steps, list)
    assert written["ladder"] == steps  # their older names
    assert all(step["rung"] == step["step"] and step["rmse_proof"] == step["rmse_test"] for step in steps)
    assert [step["step"] for step in steps] == list(range(len(steps)))
    assert {"step", "effect", "at", "parameters", "rmse_fit", "rmse_holdout", "max_holdout"} <= set(steps[0])
    assert (steps[0]["effect"], steps[0]["at"]) == (None, None)
    assert steps[-1]["parameters"] > steps[0]["parameters"]


def test_declarations_rebuild_the_last_step(improved: tuple[Model, DataSplit, History]) -> None:
    model, _, history = improved
    again = Model(model.network.with_effects(history.declarations()))
    added = {parameter.name: parameter.value for parameter in again.parameters if parameter.name.startswith("forced")}
    fitted = {parameter.name: parameter.value for parameter in history.best.for_use.model.parameters}
    assert added
    for name, value in added.items():
        assert value == fitted[name]


def test_an_effect_of_one_run_is_declared_as_it_was_fitted(leg: Leg) -> None:  # noqa: F811
    model, data = leg(Hidden("surface_scale", "FR_calf", size=3.0, run="fit1"))
    coarse = for_search(data)
    base = fit_segments(with_errors_of_runs(model, coarse), coarse.fit)
    kind = catalogue()["surface_scale"]
    switched = tuple(replace(parameter.switched_on, share="all") for parameter in kind.parameters)
    declared = EffectDeclaration(kind(), "FR_calf", switched, run="fit1")
    step = Step(refit(base, declared), declared)
    (rebuilt,) = effects_added([Step(base), step])
    assert step.amplitude is not None
    assert rebuilt.parameters[0].value == step.amplitude.value != switched[0].value


@pytest.mark.long
@pytest.mark.parametrize("run", ["fit1", "fit2"])
def test_held_out_runs_say_which_of_two_runs_is_the_odd_one(leg: Leg, run: str) -> None:  # noqa: F811
    """Less air in one and more in the other are one step to the fitted data, whose name comes first by chance."""
    model, data = leg(Hidden("surface_scale", "FR_calf", size=3.0, run=run))
    history = improve(model, data, most=1)
    assert history.steps[1].key == ("surface_scale", f"FR_calf@{run}")
    assert history.steps[1].at_its_place > 0.9


@pytest.mark.long
def test_an_adequate_model_keeps_one_step(leg: Leg) -> None:  # noqa: F811
    history = improve(*leg())
    assert len(history.steps) == 1
    assert history.verdict == history.remaining == "adequate"


@pytest.mark.long
def test_without_held_out_data_the_criterion_ends_the_selection(leg: Leg) -> None:  # noqa: F811
    model, data = leg(Hidden("forced_convection", "FR_thigh"))
    history = improve(model, split_data([segment.run for segment in data.fit]))
    assert [(step.effect, step.at) for step in history.steps[1:]] == [("forced_convection", "FR_thigh")]
    assert history.best.holdout is None


def test_models_travel_between_processes(improved: tuple[Model, DataSplit, History]) -> None:
    history = improved[2]
    again = pickle.loads(pickle.dumps(history.best.fit))
    assert again.cost == history.best.fit.cost
    assert again.problem.cost(again.z) == pytest.approx(history.best.fit.cost, rel=1e-12)


@pytest.mark.slow
def test_two_processes_select_the_same_effects(leg: Leg, improved: tuple[Model, DataSplit, History]) -> None:  # noqa: F811
    model, data = leg(*TWO)
    with ProcessPoolExecutor(2) as pool:
        history = improve(model, data, executor=pool)
    alone = improved[2]
    assert [(step.effect, step.at) for step in history.steps] == [(step.effect, step.at) for step in alone.steps]
    assert history.best.fit.cost == pytest.approx(alone.best.fit.cost, rel=1e-9)
