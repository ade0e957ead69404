"""What is said is said once: one narrative for every way in which a history can end, on the terminal and the page."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import cast, get_args

import numpy as np
import pytest

from lptn.basics.words import short_size
from lptn.diagnose.advice import Advice
from lptn.diagnose.answers import Step
from lptn.diagnose.experiment import Experiment
from lptn.diagnose.improvement import History
from lptn.diagnose.refits import continued
from lptn.diagnose.unexplained_heat import HeatPeak, UnexplainedHeat, largest, stretches
from lptn.effects import Effect
from lptn.effects.copper_loss import CopperLoss
from lptn.effects.radiation import Radiation
from lptn.effects.second_mass import SecondMass
from lptn.effects.sensor_lag import SensorLag
from lptn.effects.sensor_loose import SensorLoose
from lptn.identify.comparison import Comparison, compare
from lptn.identify.fitting import finished
from lptn.identify.validation import holdout_errors
from lptn.model.model import Model
from lptn.model.network import EffectDeclaration
from lptn.online.monitoring import Monitoring
from lptn.report.narrative import (
    details,
    logs_narrative,
    monitoring_narrative,
    narrative,
    removed_in_words,
    short_name,
    size_in_words,
)
from lptn.report.pages import conditions_picture
from lptn.report.sentences import Label
from lptn.report.shown import heat_fields
from lptn.report.tables import history_table
from lptn.report.text import certainty, kelvin, percent, significant, size_text
from tests.builders import leg
from tests.report.two_joints import NODES, NOISE, Told, robot

ROOT = Path(__file__).parents[2]


class _Proposed:
    """An experiment that was worked out."""

    separates = True

    def text(self) -> str:
        return "Hold 2 N*m at thigh for 8.5 min. At 4 min the two predictions differ by 3 K."


def _advice(heat: list[HeatPeak] | None = None, experiment: _Proposed | None = None) -> Advice:
    return Advice(cast("Experiment | None", experiment), heat or [], [], [])


def _said(history: History, advice: Advice | None = None) -> dict[str, str]:
    return {each.label: each.text for each in narrative(history.steps, history.last, advice)}


def test_a_solved_history_gives_verdict_finding_errors_and_next_step(missing: Told) -> None:
    history = missing[0]
    said = _said(history)
    assert list(said) == ["Verdict", "Findings", "Error", "Next"]
    assert said["Verdict"] == (
        "The model with the effects below is adequate; what remains is no more than the sensors' noise."
    )
    size = size_text(history.best, history.best.fit)
    assert re.fullmatch(r"3 ± \S+ W", size)
    assert said["Findings"] == f"Constant heat at {NODES[0]} ({size}, {certainty(history.best.probability)})."
    before, after = history.steps[0].test, history.best.test
    assert before is not None
    assert after is not None
    assert said["Error"].startswith(f"RMSE test {before.rmse:.3g} → {after.rmse:#.3g} K, held out ")
    floor = float(said["Error"].removesuffix(" K.").rpartition(" ")[2])
    assert floor == pytest.approx(NOISE, rel=0.1)
    assert said["Next"].startswith("Use the model")


def test_the_model_as_given_has_the_effects_and_free_parameters_of_the_file(missing: Told, adequate: Told) -> None:
    for history, _ in (missing, adequate):
        given, file = history.steps[0], robot()
        assert [(one.effect.key, one.where) for one in given.fit.model.network.effects] == [
            (one.effect.key, one.where) for one in file.network.effects
        ]
        assert given.parameters == len(file.free)


def test_an_adequate_model_is_called_so_and_lacks_nothing(adequate: Told) -> None:
    said = _said(adequate[0])
    assert list(said) == ["Verdict", "Error", "Next"]
    assert said["Verdict"].startswith("The model as given is adequate")


def test_what_nothing_explains_is_not_called_found(missing: Told) -> None:
    history = missing[0]
    idle = replace(history.best, fit=history.steps[0].fit)
    last = replace(history.last, verdict="unexplained", lack_of_fit=dict.fromkeys(NODES, 9.0))
    peak = HeatPeak("one", NODES[1], 150.0, 300.0, 4.0, 0.5)
    said = _said(replace(history, steps=(history.steps[0], idle), last=last), _advice([peak]))
    assert "still wrong by more than noise" in said["Verdict"]
    assert "Best candidates" in said
    assert "Findings" not in said
    assert said["Unexplained heat"].startswith(f"Most significant at {NODES[1]} from 150 to 300 s, about 4 W")
    assert said["Next"].startswith("Look for a cause there")
    alone = replace(history, steps=history.steps[:1], last=replace(history.first, verdict="unexplained"))
    assert "Best candidates" in _said(alone)


def test_findings_come_before_structure_and_both_before_the_errors(missing: Told) -> None:
    history = missing[0]
    lag, sun = (
        replace(history.best, declaration=EffectDeclaration(effect, "*"), probability=0.7)
        for effect in (SensorLag(), Radiation())
    )
    said = _said(replace(history, steps=(history.steps[0], history.best, lag, sun)))
    assert list(said) == ["Verdict", "Findings", "Structure", "Error", "Next"]
    assert said["Structure"] == "Sensor lag (likely, 70 %) and radiation (likely, 70 %)."
    many = _said(replace(history, steps=(history.steps[0], *[lag] * 5)))
    assert many["Structure"].endswith(" and 2 others.")
    assert "Findings" not in many


def test_one_name_among_several_at_a_place_has_the_place_s_probability(missing: Told) -> None:
    history = missing[0]
    doubtful = replace(history.best, probability=0.4, at_its_place=0.97)
    said = _said(replace(history, steps=(history.steps[0], doubtful)))
    assert "about as likely as not, 40 %, something there 97 %)" in said["Findings"]
    assert "something there" not in _said(history)["Findings"]


@pytest.mark.parametrize(
    ("probability", "said"),
    [
        (1.0, "virtually certain, > 99 %"),
        (0.95, "very likely, 95 %"),
        (0.5, "about as likely as not, 50 %"),
        (0.1, "unlikely, 10 %"),
    ],
)
def test_a_probability_has_a_word_and_a_number(probability: float, said: str) -> None:
    assert certainty(probability) == said


def _by_hand(outcome: Told, effect: Effect, at: str) -> History:
    """The model as given with one effect that somebody chose, and what a diagnosis says of the two."""
    history, data = outcome
    given = history.steps[0]
    declared = EffectDeclaration(effect, at)
    fit = finished(continued(given.fit, given.fit.model.network.with_effects([declared])))
    step = Step(fit, declared, holdout=holdout_errors(fit, data.holdout), test=holdout_errors(fit, data.test))
    remaining = replace(history.first, fit=fit)
    return replace(history, steps=(given, step), last=remaining)


def test_what_was_added_by_hand_and_did_not_help_is_not_a_finding(adequate: Told, missing: Told) -> None:
    for outcome in (adequate, missing):
        said = _said(_by_hand(outcome, Radiation(), NODES[1]))
        assert said["Added by hand"] == f"Radiation at {NODES[1]} (no help)."
        assert said["Verdict"].startswith("With or without the added effects the model ")
        assert said["Next"] == "Undo the added effects, which did not help."
        assert "Findings" not in said
    assert f"still lacks constant heat at {NODES[0]} (" in said["Verdict"]


def test_what_was_added_beside_the_right_effect_is_told_apart(missing: Told) -> None:
    useless = _by_hand(missing, Radiation(), NODES[1])
    right = replace(missing[0].best, probability=0.9)
    said = _said(replace(useless, steps=(*useless.steps, right), last=missing[0].last))
    assert said["Findings"].startswith(f"Constant heat at {NODES[0]} (")
    assert said["Added by hand"] == f"Radiation at {NODES[1]} (no help)."


def test_what_lowers_the_error_on_fit_data_only_says_so(missing: Told) -> None:
    history = missing[0]
    given = history.steps[0]
    stays = replace(history.best, holdout=given.holdout, test=given.test, probability=0.0)
    said = _said(replace(history, steps=(given, stays)))
    assert said["Added by hand"] == f"Constant heat at {NODES[0]} (lowers the error on fit data only)."


def test_an_answer_that_was_not_added_yet_is_a_finding_with_its_size(missing: Told) -> None:
    history = missing[0]
    said = _said(replace(history, steps=history.steps[:1], last=history.first))
    assert said["Verdict"] == "The model as given lacks the effects below, which explain most of its error."
    assert re.match(rf"Constant heat at {re.escape(NODES[0])} \(3 ± \S+ W, ", said["Findings"])
    assert (
        said["Next"] == "Add the effects above, as lptn improve does, and see whether the error on held-out data falls."
    )


def test_held_out_runs_that_differ_are_named_in_verdict_and_next_step(adequate: Told) -> None:
    history = adequate[0]
    differs = replace(history.last, verdict="unexplained", steps=())
    said = _said(replace(history, last=differs))
    assert "but not the held-out data" in said["Verdict"]
    assert said["Next"].startswith("Find the difference between fitted and held-out runs")


def test_a_likely_candidate_that_would_predict_worse_is_named_with_its_size(missing: Told) -> None:
    history = missing[0]
    likely, unlikely = (replace(history.best, probability=probability) for probability in (0.57, 0.31))
    said = []
    for refused in (likely, unlikely):
        last = replace(history.first, verdict="unexplained", steps=(), refused=(refused,))
        said.append(_said(replace(history, steps=history.steps[:1], last=last)))
    size = size_text(likely, likely.fit)
    assert said[0]["Best candidates"] == (
        f"Constant heat at {NODES[0]} ({size}, about as likely as not, 57 %); "
        "not added, because held-out data would be predicted worse."
    )
    assert "Best candidates" not in said[1]


def test_what_stands_in_place_of_a_common_effect_is_told_beside_its_size(missing: Told) -> None:
    """A mass of 0 J/K at one joint is nothing to find, where not all others have one."""
    fit = missing[0].best.fit
    parts = tuple(replace(parameter, share="all") for parameter in SecondMass.stated())
    common, own = (EffectDeclaration(SecondMass(), at, parts) for at in ("*", NODES[0]))
    made = continued(fit, fit.model.network.with_effects([common, own]))
    shared = made.model.named[common.shared_name("capacity")].value
    assert size_text(Step(made, own), made).endswith(f" J/K where others have {short_size(shared)}")
    assert size_text(Step(made, common), made).endswith(" J/K")


def test_a_model_that_predicts_worse_than_the_one_given_is_not_to_be_used(missing: Told) -> None:
    history = missing[0]
    given, best = history.steps
    assert given.holdout is not None
    worse = replace(best, holdout=replace(given.holdout, rmse=2 * given.holdout.rmse), test=None)
    assert "Use the model" not in _said(replace(history, steps=(given, worse)))["Next"]


def test_rivals_and_the_experiment_that_separates_them_are_said(missing: Told) -> None:
    history = missing[0]
    step = replace(history.steps[1], indistinguishable=(("solar", NODES[0]),))
    rivals = replace(history, steps=(history.steps[0], step))
    assert f"; or solar at {NODES[0]})" in _said(rivals)["Findings"]
    assert _said(rivals, _advice(experiment=_Proposed()))["Next"] == "Hold 2 N·m at thigh for 8.5 min."
    assert "leave the robot powered and resting for an hour" in _said(rivals)["Next"]


def test_details_say_which_data_chose_and_what_was_refused(missing: Told) -> None:
    history, data = missing
    refused = replace(history.best, declaration=EffectDeclaration(Radiation(), NODES[1]), probability=0.31)
    text = " ".join(details(replace(history, last=replace(history.last, refused=(refused,))), data))
    assert "Held out: two (60 to 600 s); only the initial temperatures are fitted there." in text
    assert "Test: three (60 to 600 s); these runs chose nothing" in text
    assert f"Fitted as well, and not added: radiation to the surroundings at {NODES[1]} (31 %)." in text
    assert "The verdict holds for what the fit data cover: 10 min at" in text
    assert "not added" not in " ".join(details(replace(history, last=replace(history.last, refused=())), data))


def test_details_give_each_step_its_probability_and_size_and_the_table_its_errors(missing: Told) -> None:
    history, data = missing
    best = history.best
    text = " ".join(details(history, data))
    assert f"Step 1, constant heat at {NODES[0]} ({percent(best.probability)} probable): " in text
    assert size_text(best, best.fit) in text
    given, last = history_table(history).rows
    assert kelvin(best.fit.rmse) in last
    assert kelvin(history.steps[0].fit.rmse) in given


def test_an_error_like_the_noise_is_no_failure(adequate: Told, missing: Told) -> None:
    def caption(outcome: Told) -> tuple[str, Comparison]:
        comparison = compare(outcome[0].steps[0].fit.model, outcome[1].holdout)
        comparison = replace(comparison, noise=outcome[0].steps[0].fit.noise)
        picture = conditions_picture(comparison, None, "held-out")
        assert picture is not None
        return picture.caption, comparison

    said, comparison = caption(adequate)
    assert comparison.all.rmse < 0.06
    assert said.endswith("No RMSE is much larger than the sensors' noise.")
    assert re.search(
        r"Worst place of the model: \S+ in two, RMSE \S+ K, predicted too cold; most at \d+ s, by \S+ K\.",
        caption(missing)[0],
    )


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


def test_large_numbers_have_no_exponent() -> None:
    assert [significant(value, 2) for value in (0.052, 1.0, 9.96, 29.4, 142.0)] == ["0.052", "1.0", "10", "29", "142"]


@pytest.mark.parametrize(("at", "said"), [("*", "radiation"), ("*_*", "radiation at *_*"), ("a~b", "radiation a–b")])
def test_a_short_name_has_a_place_but_for_everywhere(at: str, said: str) -> None:
    assert short_name("radiation", at) == said


def test_where_next_to_nothing_goes_is_not_told(missing: Told) -> None:
    history = missing[0]
    assert re.match(
        rf"It explains \d+ % of the remaining squared error, \d+ % of that at {NODES[0]}", removed_in_words(history, 1)
    )
    first, second = history.steps
    hardly = first.fit.z.copy()
    hardly[0] *= 1 - 1e-7
    nothing = replace(second, fit=replace(first.fit, z=hardly, cost=first.fit.problem.cost(hardly)))
    before, after = sorted([first, nothing], key=lambda step: -step.fit.cost)
    said = removed_in_words(replace(history, steps=(before, after)), 1)
    assert said == "It explains less than 1 % of the remaining squared error."


@pytest.mark.parametrize(("kind", "said"), [(SensorLag, ""), (SensorLoose, r"exposure \S+( ± \S+)?; ")])
def test_the_size_of_an_effect_that_is_there_or_not_is_its_shape(
    kind: type[SensorLag], said: str, missing: Told
) -> None:
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
    assert " W beyond what it has in common with others, " in size_in_words(replace(step, declaration=more), fitted)
    assert "beyond" not in size_in_words(step, step.fit)


@pytest.mark.parametrize(("usual", "said"), [(0.1, " times a typical value"), (10.0, " % of a typical value")])
def test_a_size_is_a_multiple_or_a_percentage_of_the_typical_one(missing: Told, usual: float, said: str) -> None:
    step = missing[0].best
    (declared,) = step.declarations
    (power,) = declared.parameters
    assert step.amplitude is not None
    resized = replace(declared, parameters=(replace(power, typical=usual * step.amplitude.value),))
    network = step.fit.model.network.without_effect(*step.key).with_effects([resized])
    assert said in size_in_words(step, continued(step.fit, network))


@pytest.mark.parametrize("label", get_args(Label))
def test_the_page_on_verdicts_explains_every_label(label: str) -> None:
    page = (ROOT / "src/site/pages/how_to/verdict.md").read_text(encoding="utf-8")
    explained = {
        name.strip() for line in page.splitlines() if line.startswith("| ") for name in line.split("|")[1].split(",")
    }
    assert label in explained


def _watched(run: str, error: float, **kinds: str) -> SimpleNamespace:
    called = [SimpleNamespace(node=node, channel="", kind=kind) for node, kind in kinds.items()]
    largest = {"hip": error, "knee": error / 2}
    return SimpleNamespace(
        run=SimpleNamespace(name=run), threshold_alarms=[], statistical_alarms=called, largest_error=largest
    )


@pytest.mark.parametrize(
    ("runs", "hours", "said"),
    [
        ((_watched("one", 1.2),), 2.0, ["No alarm in one.", "1.20 K at hip in one", "come from 2 h"]),
        ((_watched("one", 9.0, knee="drift"),), 0.0, ["Alarm at knee (drift) in one.", "", "are guesses"]),
        (
            (_watched("one", 9.0, hip="stuck", knee="drift"), _watched("two", 0.5), _watched("three", 0.7)),
            1.0,
            ["Alarm at hip (stuck) and knee (drift) in one. No alarm in two and three.", "0.700 K at hip in three", ""],
        ),
        (
            tuple(_watched(f"day{n}", 1.0) for n in range(9)),
            1.0,
            ["No alarm in day0, day1, day2 and 6 others.", "", ""],
        ),
    ],
)
def test_monitored_logs_are_said_in_three_sentences(
    runs: tuple[SimpleNamespace, ...], hours: float, said: list[str]
) -> None:
    result = SimpleNamespace(runs=runs, calibration=SimpleNamespace(healthy_hours=hours))
    told = {each.label: each.text for each in monitoring_narrative(cast("Monitoring", result))}
    assert told["Verdict"] == said[0]
    assert ("Largest error" in told) == any(not watched.statistical_alarms for watched in runs)
    assert said[1] in told.get("Largest error", "")
    assert said[2] in told["Uncertainty"]


@pytest.mark.parametrize("amperes", CopperLoss.options["amperes"])
@pytest.mark.parametrize("resistance_of", CopperLoss.options["resistance_of"])
def test_every_kind_of_resistance_and_ampere_is_said(resistance_of: str, amperes: str) -> None:
    loss = CopperLoss(resistance_of=resistance_of, amperes=amperes)
    said = logs_narrative(Model(leg([EffectDeclaration(loss, "*")])), [])
    (losses,) = (sentence.text for sentence in said if sentence.label == "Losses")
    assert losses.startswith("R I²" if loss.factor == 1 else f"{loss.factor:g} R I²")
