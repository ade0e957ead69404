"""What the report and the terminal say never contradicts itself: every way in which a selection can end."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from lptn.cli.improve import show_history
from lptn.diagnose.answers import Step
from lptn.diagnose.improvement import History
from lptn.diagnose.refits import continued
from lptn.diagnose.unexplained_heat import UnexplainedHeat, largest, stretches
from lptn.effects import Effect
from lptn.effects.radiation import Radiation
from lptn.effects.sensor_lag import SensorLag
from lptn.effects.sensor_loose import SensorLoose
from lptn.identify.comparison import Comparison, compare
from lptn.identify.fitting import finished
from lptn.identify.validation import holdout_errors
from lptn.model.network import EffectDeclaration
from lptn.report.heat_story import HeatStory
from lptn.report.outcome import headline, left_in_words, outcome_of, short_name
from lptn.report.shown import heat_fields
from lptn.report.text import significant
from lptn.report.words import (
    caption_of_conditions,
    in_short,
    next_step,
    removed_in_words,
    size_in_words,
    story_in_words,
)
from tests.report.two_joints import NODES, NOISE, Told


def _everything(history: History, outcome: Told) -> str:
    heat = HeatStory.of(history)
    parts = [headline(history), left_in_words(history), next_step(history), *story_in_words(history, outcome[1])]
    return " ".join([*parts, *(f"{label}: {text}" for label, text in in_short(history, heat))])


def test_a_solved_story_says_what_was_found_and_not_that_something_is_missing(missing: Told) -> None:
    history = missing[0]
    before, after = history.steps[0].test, history.best.test
    assert before is not None
    assert after is not None
    opening = f"Found: constant heat at {NODES[0]}; test {before.rmse:.3g} → {after.rmse:#.3g} K, floor "
    assert headline(history).startswith(opening)
    floor = float(headline(history).removeprefix(opening).removesuffix(" K."))
    assert floor == pytest.approx(NOISE, rel=0.1)
    assert left_in_words(history) == "What is left on the fitted runs is no more than the sensors' noise."
    text = _everything(history, missing)
    for wrong in ("is missing:", "Something", "still wrong", "does not explain"):
        assert wrong not in text


def test_what_a_first_verdict_could_not_explain_but_two_steps_did_is_found(missing: Told) -> None:
    solved = replace(missing[0], verdict="unexplained", remaining="adequate")
    assert outcome_of(solved) == "found"
    text = _everything(solved, missing)
    assert "Do not read" not in text
    assert "stays" not in text


def test_what_nothing_explains_is_not_called_found(missing: Told) -> None:
    stuck = replace(missing[0], verdict="unexplained", remaining="unexplained")
    text = _everything(stuck, missing)
    assert text.startswith("Not explained; the best that the catalogue offers is constant heat at")
    assert "Found" not in text
    assert "no more than the sensors' noise" not in text


def test_an_effect_added_to_an_adequate_model_is_added_and_not_found(missing: Told) -> None:
    added = replace(missing[0], verdict="adequate")
    assert headline(added).startswith("Added: ")
    assert "Nothing is missing" not in _everything(added, missing)


def _by_hand(outcome: Told, effect: Effect, at: str) -> History:
    """The model as given with one effect that somebody chose, and what a diagnosis says of the two."""
    history, data = outcome
    given = history.steps[0]
    declared = EffectDeclaration(effect, at)
    fit = finished(continued(given.fit, given.fit.model.network.with_effects([declared])))
    step = Step(fit, declared, holdout=holdout_errors(fit, data.holdout), test=holdout_errors(fit, data.test))
    remaining = replace(history.first, fit=fit)
    return replace(
        history, steps=(given, step), remaining=history.verdict, last=remaining, considered=1, searched_from=None
    )


def test_what_was_added_and_did_not_help_is_not_called_found(
    adequate: Told, missing: Told, capsys: pytest.CaptureFixture[str]
) -> None:
    for outcome in (adequate, missing):
        history = _by_hand(outcome, Radiation(), NODES[1])
        assert outcome_of(history) == "tried"
        assert headline(history).startswith(f"Radiation at {NODES[1]}, added, did not help; test ")
        text = _everything(history, outcome)
        show_history(history)
        text += capsys.readouterr().out
        for wrong in ("Found", "What was missing", "Nothing else in the catalogue", "nothing else", "best that the"):
            assert wrong not in text
    assert f"first of all constant heat at {NODES[0]}" in text
    assert "next to add would be constant heat" in text
    assert "in its place" in next_step(history)


def test_what_was_added_beside_the_right_effect_and_did_not_help_is_told_apart(missing: Told) -> None:
    useless = _by_hand(missing, Radiation(), NODES[1])
    right = replace(missing[0].best, probability=0.9)
    both = replace(useless, steps=(*useless.steps, right), remaining="adequate")
    assert headline(both).startswith(
        f"Found: constant heat at {NODES[0]}; radiation at {NODES[1]}, added as well, did "
    )
    assert outcome_of(both) == "found"
    searched = replace(both, searched_from=0)  # a search keeps what only helps together with what follows
    assert headline(searched).startswith(f"Added: radiation at {NODES[1]} and constant heat at {NODES[0]}; ")


def test_what_helps_on_the_fitted_runs_alone_says_so(missing: Told) -> None:
    history = missing[0]
    given, best = history.steps[0], history.best
    stays = replace(best, holdout=given.holdout, test=given.test)
    alone = replace(history, steps=(given, stays), remaining="missing", searched_from=None)
    assert outcome_of(alone) == "tried"
    assert headline(alone).startswith(f"Constant heat at {NODES[0]} helps on the fitted runs alone; test ")


def test_a_step_that_is_improbable_beside_the_others_is_no_name(missing: Told) -> None:
    history = missing[0]
    right = replace(history.best, probability=0.9, at_its_place=0.9)
    open_ = replace(_by_hand(missing, Radiation(), NODES[1]).steps[-1], probability=0.1, at_its_place=0.2)
    both = replace(history, steps=(history.steps[0], open_, right), remaining="missing", searched_from=0)
    first = f"Found: constant heat at {NODES[0]}; "
    assert headline(both).startswith(f"{first}radiation at {NODES[1]} stands for something that these data don't name;")
    alone = replace(open_, fit=right.fit, holdout=right.holdout, test=right.test)
    assert headline(replace(both, steps=(history.steps[0], alone))).startswith(
        f"Best explanation, not certain: radiation at {NODES[1]}; "
    )


def test_an_answer_that_was_not_added_is_an_answer_and_no_failure(missing: Told) -> None:
    history = missing[0]
    asked = replace(history, steps=history.steps[:1], remaining="missing", last=history.first, searched_from=None)
    assert outcome_of(asked) == "asked"
    assert headline(asked).startswith(f"Something is missing, first of all constant heat at {NODES[0]} (")
    assert "no effect that was tried" not in _everything(asked, missing)
    assert "no effect that was tried" in _everything(replace(asked, searched_from=0), missing)


def test_held_out_runs_far_above_the_noise_are_not_called_noise(missing: Told) -> None:
    history = missing[0]
    holdout = history.best.holdout
    assert holdout is not None
    far = replace(history.best, holdout=replace(holdout, rmse=1.0))
    sentence = left_in_words(replace(history, steps=(history.steps[0], far)))
    assert "but the held-out ones are off by 1.00 K" in sentence


def test_an_error_like_the_noise_is_no_failure(adequate: Told, missing: Told) -> None:
    def caption(outcome: Told) -> tuple[str, Comparison]:
        comparison = compare(outcome[0].steps[0].fit.model, outcome[1].holdout)
        comparison = replace(comparison, noise=outcome[0].steps[0].fit.noise)
        return caption_of_conditions(comparison, None, "held-out"), comparison

    said, comparison = caption(adequate)
    assert comparison.all.rmse < 0.06
    assert "fails" not in said
    assert "errs nowhere by much more than noise" in said
    assert "fails worst at" in caption(missing)[0]


def test_heat_that_is_drawn_as_sure_is_heat_that_is_said(adequate: Told) -> None:
    """The band that is drawn is the one that decides: none is said to be sure that lies within it, nor the reverse."""
    rng = np.random.default_rng(4)
    time = np.arange(5.0, 3600.0, 10.0)
    for shift in (0.0, 0.5, 1.0, 1.5, 2.5):
        heat = rng.normal(0.0, 0.3, (2, time.size)) + shift * np.exp(-(((time - 1800) / 300) ** 2))
        estimate = UnexplainedHeat("run", time, NODES, heat, np.full_like(heat, 0.8), 10.0)
        (drawn,) = heat_fields([estimate])
        beyond = bool((np.abs(heat) > estimate.sure_band).any())
        assert (largest([estimate]) is not None) == beyond == bool(drawn.values.any()) == bool(stretches([estimate]))
    story = HeatStory.of(adequate[0])
    assert ("no node lacks heat beyond chance" in in_short(adequate[0], story)[1][1]) == (story.peak is None)


def test_large_numbers_have_no_exponent() -> None:
    assert [significant(value, 2) for value in (0.052, 1.0, 9.96, 29.4, 142.0)] == ["0.052", "1.0", "10", "29", "142"]


def test_the_terminal_says_the_same(missing: Told, capsys: pytest.CaptureFixture[str]) -> None:
    show_history(missing[0])
    out = capsys.readouterr().out
    assert headline(missing[0]) in out
    assert left_in_words(missing[0]) in out
    assert "missing something" not in out


def test_a_step_that_the_fitted_data_alone_speak_against_is_not_called_the_best(
    missing: Told, capsys: pytest.CaptureFixture[str]
) -> None:
    history = missing[0]
    first = replace(history.steps[1], probability=0.01, indistinguishable=())
    reordered = replace(history, steps=(history.steps[0], first, *history.steps[2:]))
    show_history(reordered)
    text = _everything(reordered, missing) + capsys.readouterr().out
    assert "othing else in the catalogue explains" not in text
    assert text.count("another answer") >= 3
    assert "held-out runs included, decided" in text


def test_of_two_places_that_share_a_parameter_either_is_told(missing: Told, capsys: pytest.CaptureFixture[str]) -> None:
    history = missing[0]
    declared = EffectDeclaration(Radiation(), NODES[1])
    twin = replace(history.steps[1], declaration=replace(declared, at=NODES[0]), probability=0.5004)
    step = replace(history.steps[1], declaration=declared, probability=0.5, indistinguishable=(twin.key,))
    step = replace(step, places=(NODES[1], NODES[0]), in_some_run=0.5)
    first = replace(history.first, refits=(twin, step))
    show_history(replace(history, first=first, steps=(history.steps[0], step)))
    said = " ".join(capsys.readouterr().out.split())
    assert f"radiation at {NODES[1]} (or {NODES[0]})" in said
    assert f"by the fitted data 50 % probable; they don't rule out radiation to the surroundings at {NODES[0]}" in said
    assert "was added, too" not in said


def test_of_everywhere_and_all_joints_either_is_told(missing: Told) -> None:
    everywhere = replace(missing[0].steps[1], declaration=EffectDeclaration(Radiation(), "*"), places=("*",))
    assert short_name(everywhere) == "radiation"
    assert short_name(replace(everywhere, places=("*", "*_*"))) == "radiation everywhere (or *_*)"
    joints = replace(everywhere, declaration=EffectDeclaration(Radiation(), "*_*"), places=("*_*", "*"))
    assert short_name(joints) == "radiation at *_* (or everywhere)"


def test_what_was_added_as_well_is_no_other_name_for_a_step(missing: Told, capsys: pytest.CaptureFixture[str]) -> None:
    history = missing[0]
    given, step = history.steps
    other = replace(step, probability=0.9, indistinguishable=(step.key, ("solar", NODES[0])))
    second = replace(other, declaration=EffectDeclaration(Radiation(), NODES[1]), indistinguishable=(step.key,))
    show_history(replace(history, steps=(given, other, second)))
    said = " ".join(capsys.readouterr().out.split())
    assert f"they don't rule out heat of the sun at {NODES[0]}" in said
    assert "what explains the fitted data as well was added, too" in said


def test_a_step_is_not_told_beside_itself_where_it_was_more_probable_before(
    missing: Told, capsys: pytest.CaptureFixture[str]
) -> None:
    history = missing[0]
    first = replace(history.first, refits=(replace(history.first.refits[0], probability=0.9),))
    step = replace(history.steps[1], probability=0.8, declaration=first.refits[0].declaration)
    show_history(replace(history, first=first, steps=(history.steps[0], step)))
    said = " ".join(capsys.readouterr().out.split())
    assert "by the fitted data 80 % probable;" in said
    assert "90 %" not in said


def test_an_answer_of_a_few_per_cent_is_one_of_several_and_not_said_to_be_as_good(
    missing: Told, capsys: pytest.CaptureFixture[str]
) -> None:
    history = missing[0]
    step = replace(history.steps[1], probability=0.06, by_all_runs=0.93, indistinguishable=(("solar", NODES[0]),))
    show_history(replace(history, steps=(history.steps[0], step)))
    said = " ".join(capsys.readouterr().out.split())
    assert "the fitted data alone leave it open (this one 6 %" in said
    assert f" and don't rule out heat of the sun at {NODES[0]}; with the held-out data it is 93 % probable" in said
    assert "can't tell" not in said


def test_where_something_is_missing_is_surer_than_what_it_is(missing: Told, capsys: pytest.CaptureFixture[str]) -> None:
    history = missing[0]
    declared = EffectDeclaration(Radiation(), NODES[1])
    other = (("solar", NODES[1]),)
    step = replace(history.steps[1], declaration=declared, probability=0.4, by_all_runs=0.3, indistinguishable=other)
    two, many = f"{NODES[1]} or {NODES[0]}", "one of 6 places"
    for places, at_its_place, words in (
        ((NODES[1],), 0.97, f", and that something is missing at {NODES[1]} 97 %"),
        ((NODES[1], NODES[0]), 0.97, f", and that something is missing at {two} 97 %"),
        ((NODES[1], *"abcde"), 0.97, f", and that something is missing at {many} 97 %"),
        ((NODES[1],), 0.4, ""),
    ):
        judged = replace(step, places=places, at_its_place=at_its_place)
        show_history(replace(history, steps=(history.steps[0], judged)))
        said = " ".join(capsys.readouterr().out.split())
        assert "with the held-out data it is 30 % probable" in said
        assert ("that something is missing at" in said) is bool(words)
        assert words in said


def test_where_next_to_nothing_goes_is_not_told(missing: Told) -> None:
    history = missing[0]
    assert re.match(rf"It removes \d+ % of .* runs, \d+ % of that at {NODES[0]}", removed_in_words(history, 1))
    first, second = history.steps
    hardly = first.fit.z.copy()
    hardly[0] *= 1 - 1e-7
    nothing = replace(second, fit=replace(first.fit, z=hardly, cost=first.fit.problem.cost(hardly)))
    before, after = sorted([first, nothing], key=lambda step: -step.fit.cost)
    said = removed_in_words(replace(history, steps=(before, after)), 1)
    assert said == "It removes less than 1 % of the squared error that was left of the fitted runs."


@pytest.mark.parametrize(("kind", "said"), [(SensorLag, ""), (SensorLoose, r"exposure \S+( ± \S+)?; ")])
def test_the_size_of_what_is_there_or_not_is_how_it_is(kind: type[SensorLag], said: str, missing: Told) -> None:
    fit = missing[0].best.fit
    slow = tuple(parameter.switched_on for parameter in kind.parameters)
    network = fit.model.network.with_effects([EffectDeclaration(kind(), NODES[0], slow)])
    lagging = replace(missing[0].best, declaration=network.effects[-1])
    assert re.fullmatch(said + r"time constant \S+( ± \S+)? s", size_in_words(lagging, continued(fit, network)))


def test_a_difference_is_told_as_one(missing: Told) -> None:
    step = missing[0].best
    (declared,) = step.declarations
    more = replace(
        declared,
        difference=True,
        parameters=tuple(replace(p, value=-1.0, bounds=(-9.0, 9.0)) for p in declared.parameters),
    )
    fitted = continued(step.fit, step.fit.model.network.without_effect(*step.key).with_effects([more]))
    assert " W beside what it has in common with others, " in size_in_words(replace(step, declaration=more), fitted)
    assert "beside" not in size_in_words(step, step.fit)


@pytest.mark.parametrize(("usual", "said"), [(0.1, " times what is usual"), (10.0, " of what is usual")])
def test_a_size_is_so_many_times_or_a_share_of_what_is_usual(missing: Told, usual: float, said: str) -> None:
    step = missing[0].best
    (declared,) = step.declarations
    (power,) = declared.parameters
    resized = replace(declared, parameters=(replace(power, typical=usual * step.size * power.typical),))
    network = step.fit.model.network.without_effect(*step.key).with_effects([resized])
    assert said in size_in_words(step, continued(step.fit, network))
