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
from lptn.report.text import significant, size_told
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
    size = size_told(history.best, history.best.fit)
    assert re.fullmatch(r"3 ± \S+ W", size)
    opening = f"Found: constant heat at {NODES[0]} ({size}, 98 % probable); "
    opening += f"test {before.rmse:.3g} → {after.rmse:#.3g} K, floor "
    assert headline(history).startswith(opening)
    floor = float(headline(history).removeprefix(opening).removesuffix(" K."))
    assert floor == pytest.approx(NOISE, rel=0.1)
    assert left_in_words(history) == "What is left is no more than the sensors' noise."
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
    assert text.startswith("Not explained; the best that the catalogue offers: constant heat at")
    assert "Found" not in text
    assert "no more than the sensors' noise" not in text


def test_an_effect_added_to_an_adequate_model_is_added_and_not_found(missing: Told) -> None:
    history = missing[0]
    chosen = replace(history.best, probability=0.0)
    added = replace(history, verdict="adequate", steps=(history.steps[0], chosen))
    assert headline(added).startswith("Added: ")
    assert "Nothing is missing" not in _everything(added, missing)


def test_what_is_wrong_comes_before_what_the_machine_is_made_of_and_that_before_the_errors(missing: Told) -> None:
    history = missing[0]
    lag, sun = (
        replace(history.best, declaration=EffectDeclaration(effect, "*"), probability=0.7)
        for effect in (SensorLag(), Radiation())
    )
    steps = (history.steps[0], history.best, lag, sun)
    said = headline(replace(history, steps=steps))
    order = [said.index(word) for word in ("Found: constant heat", "; structure: sensor lag and radiation; ", "test ")]
    assert order == sorted(order)
    alone = replace(history, steps=(history.steps[0], lag, sun))
    assert headline(alone).startswith("Structure: sensor lag and radiation; test ")
    summary = in_short(alone, HeatStory.of(alone))
    assert summary[0][1].startswith("What all parts have in common: sensor lag")
    assert summary[1][1].startswith("Everywhere; nothing sets one part apart.")
    many = replace(history, steps=(history.steps[0], *[lag] * 5))
    assert headline(many).startswith("Structure: sensor lag, sensor lag, sensor lag and 2 others; ")


def test_a_name_among_several_at_a_place_is_told_with_the_place(missing: Told) -> None:
    history = missing[0]
    open_ = replace(history.best, probability=0.4, at_its_place=0.97)
    said = headline(replace(history, steps=(history.steps[0], open_)))
    assert "40 % probable, that something is missing there 97 %)" in said
    assert "that something is missing" not in headline(history)


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
    said = headline(both)
    assert said.startswith(f"Found: constant heat at {NODES[0]} (")
    assert f"90 % probable); radiation at {NODES[1]}, added as well, did not help; " in said
    assert outcome_of(both) == "found"


def test_what_helps_on_the_fitted_runs_alone_says_so(missing: Told) -> None:
    history = missing[0]
    given, best = history.steps[0], history.best
    stays = replace(best, holdout=given.holdout, test=given.test, probability=0.0)
    alone = replace(history, steps=(given, stays), remaining="missing", searched_from=None)
    assert outcome_of(alone) == "tried"
    assert headline(alone).startswith(f"Constant heat at {NODES[0]} helps on the fitted runs alone; test ")


def test_an_answer_that_was_not_added_is_an_answer_and_no_failure(missing: Told) -> None:
    history = missing[0]
    asked = replace(history, steps=history.steps[:1], remaining="missing", last=history.first, searched_from=None)
    assert outcome_of(asked) == "asked"
    assert headline(asked).startswith(f"Something is missing, first of all constant heat at {NODES[0]} (")


def test_held_out_runs_far_above_the_noise_are_not_called_noise(missing: Told) -> None:
    history = missing[0]
    holdout = history.best.holdout
    assert holdout is not None
    far = replace(history.best, holdout=replace(holdout, rmse=1.0))
    sentence = left_in_words(replace(history, steps=(history.steps[0], far), remaining="unexplained"))
    assert "but the held-out ones are off by 1.00 K" in sentence


def test_a_model_that_predicts_worse_than_the_one_given_is_not_to_be_used(missing: Told) -> None:
    history = missing[0]
    given, best = history.steps
    assert "use the best model" in next_step(history)
    assert given.holdout is not None
    worse = replace(best, holdout=replace(given.holdout, rmse=2 * given.holdout.rmse), test=None)
    told = next_step(replace(history, steps=(given, worse)))
    assert "use the best model" not in told
    assert "which the model as given predicts better" in told


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


def test_what_else_it_may_be_is_told_alike_in_page_and_terminal(
    missing: Told, capsys: pytest.CaptureFixture[str]
) -> None:
    history = missing[0]
    step = replace(history.steps[1], indistinguishable=(("solar", NODES[0]),))
    rivals = replace(history, steps=(history.steps[0], step))
    show_history(rivals)
    assert f"heat of the sun at {NODES[0]}" in " ".join(capsys.readouterr().out.split())
    assert _everything(rivals, missing).count(f"can't rule out heat of the sun at {NODES[0]} in its place") == 2
    assert "in its place" not in _everything(history, missing)


def test_what_was_refused_is_told_with_its_probability(missing: Told) -> None:
    history = missing[0]
    refused = replace(history.best, declaration=EffectDeclaration(Radiation(), NODES[1]), probability=0.31)
    told = replace(history, last=replace(history.last, refused=(refused,)))
    assert f"refused as less probable than not: radiation to the surroundings at {NODES[1]} (31 %)." in _everything(
        told, missing
    )
    assert "refused" not in _everything(replace(history, last=replace(history.last, refused=())), missing)


@pytest.mark.parametrize(("at", "said"), [("*", "radiation"), ("*_*", "radiation at *_*"), ("a~b", "radiation a–b")])
def test_a_short_name_has_a_place_but_for_everywhere(missing: Told, at: str, said: str) -> None:
    assert short_name(replace(missing[0].best, declaration=EffectDeclaration(Radiation(), at))) == said


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
