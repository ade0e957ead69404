"""The sentences on logs, searches, comparisons and forecasts that terminal, workbench, report and Python show.

Of a search, first the verdict on the model as it is now, then effects at one place, of one sensor, limb or run
(findings), effects that all parts have (structure), what somebody added, the errors, and what to do next.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from math import isfinite, sqrt
from pathlib import Path
from typing import TYPE_CHECKING, Literal, get_args

import numpy as np

from lptn.basics.parameters import Parameter
from lptn.basics.words import FEW, count_of, few, listed, short_size
from lptn.diagnose.answers import LIKELY, Step
from lptn.diagnose.excitation import NOT_LOGGED, excitation, identifiability
from lptn.diagnose.fit_statistics import WORTH, Removed, criterion_difference, explained_share, is_met
from lptn.effects.copper_loss import CopperLoss
from lptn.effects.excitation import ZERO
from lptn.effects.learned_heat import UNNAMED, LearnedHeat, goes_with
from lptn.identify.comparison import Comparison, Versus
from lptn.identify.data import DataSplit, Segment
from lptn.identify.fitting import Fit
from lptn.identify.noise import estimate_noise
from lptn.identify.torque_per_ampere import apart, torque_per_ampere
from lptn.logs.run import Run
from lptn.model.model import Model
from lptn.model.network import EffectDeclaration, EffectInstance
from lptn.report.sentences import Label, Narrative, Sentence
from lptn.report.shown import ONE_SIDED, noise_alone, worst_view
from lptn.report.tables import interval_to_limit, settling_temperature, time_to_limit
from lptn.report.text import (
    capitalised,
    certainty,
    experiment_for,
    for_people,
    kelvin,
    named,
    percent,
    place_of,
    significant,
    size_text,
    time_span,
    unit_text,
    value_in_words,
    window_text,
)
from lptn.simulate.bound_run import bind

if TYPE_CHECKING:  # what is asked of logs alone needs no SciPy
    from lptn.diagnose.advice import Advice
    from lptn.diagnose.diagnosis import Diagnosis
    from lptn.diagnose.improvement import History
    from lptn.online.forecasting import Forecast
    from lptn.online.monitoring import MonitoredRun, Monitoring

HELPED = 0.99
"""The share of the error below which an error is called smaller."""


# --- what the steps are -------------------------------------------------------------------------------------


Kind = Literal["finding", "structure", "learned", "helped", "fitted", "idle"]
"""How a step is reported. Of a diagnosis: an effect of one place, sensor, limb or run, or one of all parts. Added by
hand: a learned curve, which names no cause; what lowers the errors, those on fit data only, or none."""


def kinds_of(steps: Sequence[Step]) -> dict[Kind, list[Step]]:
    """The steps of a history, the model as given first, by how they are reported.

    Answers of a diagnosis have a probability; effects added by hand are judged by the errors.
    """
    kinds: dict[Kind, list[Step]] = {kind: [] for kind in get_args(Kind)}
    for before, step in pairwise(steps):
        kind: Kind = _judged(before, step)
        if step.probability:
            kind = "structure" if step.is_structure else "finding"
        elif step.effect == LearnedHeat.key and kind != "idle":
            kind = "learned"
        kinds[kind].append(step)
    return kinds


def _judged(before: Step, after: Step) -> Literal["helped", "fitted", "idle"]:
    """Which errors a step lowers: those of held-out data, `"fitted"` where those of the fit data alone, or none.

    Errors on fit data count as lower if Schwarz's criterion falls; this decides if nothing is held out. A held-out
    error counts as lower if it falls by more than scatter explains, or by less if the fit data agree.
    """
    pays = criterion_difference(before.fit, after.fit) > 0
    if before.holdout is None or after.holdout is None:
        return "helped" if pays else "idle"
    share = after.holdout.rmse / before.holdout.rmse
    if share < 1 - WORTH or (pays and share < HELPED):
        return "helped"
    return "fitted" if pays else "idle"


def _useful(kinds: Mapping[Kind, list[Step]]) -> bool:
    """Whether any step lowers an error."""
    return any(own for kind, own in kinds.items() if kind != "idle")


# --- the answer -----------------------------------------------------------------------------------------------


def narrative(steps: Sequence[Step], last: Diagnosis | None, advice: Advice | None = None) -> Narrative:
    """The answer in a few sentences.

    Args:
        steps: the model as given first; their errors are those that `lptn compare` gives of the model's file.
        last: the diagnosis of the last step; without one nothing is said of what is missing.
        advice: what to do next, where it was worked out.
    """
    single, kinds = len(steps) == 1, kinds_of(steps)
    unexplained = last is not None and last.verdict == "unexplained"
    hopeless = unexplained and (single or explained_share(steps[0].fit, steps[0].fit.rmse, steps[-1].fit.rmse) <= 0.5)
    answers = kinds_of([steps[0], *last.steps]) if last and single else kinds
    said = [Sentence("Verdict", _verdict(steps, last, kinds))] if last else []
    for one in last.learned if last else ():
        column = goes_with(one.effect, one.driven_by or one.at)
        text = f"{said[0].text} Heat at {one.where} is {UNNAMED}{column}: learned, without a name."
        said[0] = Sentence("Verdict", text)
    groups: tuple[tuple[Label, list[Step]], ...] = (
        ("Best candidates" if hopeless else "Findings", answers["finding"]),
        ("Structure", answers["structure"]),
    )
    for label, group in groups:
        if group:
            likeliest = sorted(group, key=lambda step: -step.probability)
            said.append(Sentence(label, f"{capitalised(few([_in_full(step, steps) for step in likeliest]))}."))
    # What was refused for its size, or is less probable than nothing, predicted no held-out run.
    worse = [step for step in last.refused if step.holdout and step.probability >= LIKELY] if last and single else []
    if unexplained and (found := [step for step in worse if not step.is_structure]):
        text = capitalised(few([_in_full(step, steps) for step in found]))
        said.append(Sentence("Best candidates", f"{text}; not added, because held-out data would be predicted worse."))
    help_: dict[Kind, str] = {"helped": "", "fitted": " (lowers the error on fit data only)", "idle": " (no help)"}
    by_hand = [f"{short_name(*step.key)}{words}" for kind, words in help_.items() for step in kinds[kind]]
    if by_hand:
        said.append(Sentence("Added by hand", f"{capitalised(listed(by_hand))}."))
    said.append(Sentence("Error", errors_in_words(steps)))
    heat = [f"Most significant {for_people(advice.heat[0].text())}."] if advice and advice.heat and unexplained else []
    if advice and advice.learned:
        heat.append(_first_sentence(for_people(advice.learned.text())))
    if heat:
        said.append(Sentence("Unexplained heat", " ".join(heat)))
    if last:
        said.append(Sentence("Next", for_people(_next(steps, last, kinds, advice))))
    return Narrative(said)


def fit_narrative(step: Step, most: int | None = FEW) -> Narrative:
    """The errors of a fit, how its search ended, and what its data leave open, `most` warnings of it."""
    warnings, ended = step.fit.uncertainty.warnings, ENDED[step.fit.status]
    more = len(warnings) - len(warnings[:most])
    said = [Sentence("Error", errors_in_words([step]))]
    said.append(Sentence("Fit", f"{count_of(len(step.fit.free), 'free parameter')}; the search {ended}."))
    said += [Sentence("Warning", f"{warning}.") for warning in warnings[:most]]
    if more:
        said.append(Sentence("Warning", f"{count_of(more, 'more warning')}: --details."))
    return Narrative(said)


MORE_THAN_NOISE = "wrong by more than noise"
"""What a model is that lacks something."""
ENDED = {"converged": "converged", "not converged": "did not converge", "interrupted": "was interrupted"}
"""How a search ended, by the status of its fit."""


def _verdict(steps: Sequence[Step], last: Diagnosis, kinds: Mapping[Kind, list[Step]]) -> str:
    """What is known of the model as it is now."""
    subject = "The model as given"
    if len(steps) > 1:
        subject = (
            "The model with the effects below" if _useful(kinds) else "With or without the added effects the model"
        )
    if last.verdict == "adequate":
        beside = "" if is_met(last.lack_of_fit) else " and typical errors of air, torques and surfaces"
        return f"{subject} is adequate; what remains is no more than the sensors' noise{beside}."
    if last.only_held_out_runs_object:
        return (
            f"{subject} predicts the fit data to within noise, but not the held-out data, which contain another effect."
        )
    if last.verdict == "missing":
        if len(steps) == 1:
            return f"{subject} lacks the effects below, which explain most of its error."
        return f"{subject} still lacks {few([_short_and_sure(step) for step in last.steps])}."
    still, rest = ("", "it") if len(steps) == 1 else ("still ", "the rest")
    return f"{subject} is {still}{MORE_THAN_NOISE}, and the catalogue explains little of {rest}."


def errors_in_words(steps: Sequence[Step]) -> str:
    """RMSE as given and now, on each kind of data, and the sensors' noise."""
    given, now = steps[0], steps[-1]
    parts = []
    for data, before, after in _errors(given, now):
        change = kelvin(after) if len(steps) == 1 else f"{significant(before, 3)} → {kelvin(after)}"
        parts.append(f"{data} {change}")
    beside = "" if given.holdout else " No data were held out, so nothing tests the result."
    return f"RMSE {', '.join(parts)}; sensors' noise {kelvin(noise_alone(now.fit), 2)}.{beside}"


def _errors(given: Step, now: Step) -> list[tuple[str, float, float]]:
    """Name of each kind of data with its RMSE [K] as given and now; test and held-out data first."""
    pairs = [("test", given.test, now.test), ("held out", given.holdout, now.holdout)]
    unseen = [(data, before.rmse, after.rmse) for data, before, after in pairs if before and after]
    return [*unseen, ("fitted", given.fit.rmse, now.fit.rmse)]


def short_name(key: str, at: str) -> str:
    """An effect by its key, and where it acts, such as `conduction heater1–heater2`; no place for everywhere."""
    place = "" if at == "*" else f"{'' if '~' in at else ' at'} {place_of(at)}".replace(" at everywhere", " everywhere")
    return f"{key.replace('_', ' ')}{place}".replace("~", "–")


def _short_and_sure(step: Step) -> str:
    return f"{short_name(*step.key)} ({sure(step)})"


def sure(step: Step) -> str:
    """Probability of an answer in a word and a number; for one of several rivals also that some effect is there."""
    text = certainty(step.probability)
    if step.probability < LIKELY <= step.at_its_place:
        text += f", something there {percent(step.at_its_place)}"
    return text


def _in_full(step: Step, steps: Sequence[Step]) -> str:
    """An effect with size, certainty and rivals, such as `fan at knee (0.3 ± 0.02 W/K, very likely, 98 %)`."""
    size = size_text(step, step.fit if len(steps) == 1 else steps[-1].fit)
    text = ", ".join(filter(None, (size, sure(step))))
    if step.indistinguishable:
        more = len(step.indistinguishable) - 1
        text += f"; or {short_name(*step.indistinguishable[0])}{f' or {more} more' if more else ''}"
    return f"{short_name(*step.key)} ({text})"


def _next(steps: Sequence[Step], last: Diagnosis, kinds: Mapping[Kind, list[Step]], advice: Advice | None) -> str:
    """What to do next, in a sentence or two."""
    if advice and advice.rows:
        return advice.rows
    if kinds["idle"] and not _useful(kinds):
        return "Undo the added effects, which did not help."
    if last.verdict == "missing":
        command = "the effects above, as lptn improve does"
        answer = _short_and_sure(last.steps[0]) if len(steps) > 1 else command
        return f"Add {answer}, and see whether the error on held-out data falls."
    if advice and advice.learned and advice.learned.offered:
        return f"That heat has no name, and can be learned as a curve. {advice.learned.offer}"
    if advice and advice.differing:
        differs = advice.differing[0]
        return f"Check this difference between the runs. {differs.sentence or differs.text()}"
    if advice and advice.experiment:
        first = _first_sentence(advice.experiment.text())
        return first if advice.experiment.separates else f"{first.partition(': ')[0].rstrip('.')}."
    unnamed = [
        step for step in steps if step.indistinguishable and (not step.is_structure or last.verdict != "adequate")
    ]
    for declared in [own for step in unnamed for own in step.declarations]:
        return f"One experiment would separate the names. {experiment_for(type(declared.effect))}"
    unseen = [pair for pair in _errors(steps[0], steps[-1]) if pair[0] != "fitted"]
    if last.only_held_out_runs_object or any(after > before for _, before, after in unseen):
        return "Find the difference between fitted and held-out runs, and fit on runs like the held-out ones, too."
    if last.verdict == "adequate":
        return "Use the model; compare it again when the robot works harder, faster or in other air."
    return (
        "Look for a cause there that was not logged: touch, water, a fan, a moved sensor, an unlogged load. "
        "Log it, or leave that segment out."
    )


def _first_sentence(text: str) -> str:
    return re.split(r"(?<=[.!?]) (?=[A-Z])", text, maxsplit=1)[0]


# --- a model against logs, and against another model ---------------------------------------------------------


FAR = 2.0
"""Multiples of the noise from which an error is no longer called noise."""


def comparison_narrative(comparison: Comparison) -> Narrative:
    """How far the predictions of a model are off, and where most."""
    every, measured = comparison.all, [node for node in comparison.model.nodes if comparison.node(node).count]
    noise = sqrt(sum(comparison.floor(node) ** 2 for node in measured) / len(measured))
    error = f"RMSE {kelvin(every.rmse)}, largest error {kelvin(every.max)}; sensors' noise {kelvin(noise, 2)}."
    return Narrative([Sentence("Error", error), largest_error(comparison), *_not_fitted(comparison)])


def largest_error(comparison: Comparison) -> Sentence:
    """The node and the run with the largest RMSE, to which side the model is off there, and when most."""
    number, node = worst_view(comparison)
    prediction = comparison.predictions[number]
    errors = comparison.node(node, prediction)
    if errors.rmse <= FAR * comparison.floor(node):
        return Sentence("Worst place", "No RMSE is much larger than the sensors' noise.")
    side = "hot" if errors.mean > 0 else "cold"
    text = "" if abs(errors.mean) < ONE_SIDED * errors.rmse else f", predicted too {side}"
    run, row = prediction.segment.run, comparison.model.nodes.index(node)
    when = run.time[np.nanargmax(np.abs(prediction.error[row]))] - run.origin
    text += f"; most at {round(float(when))} s, by {kelvin(errors.max)}"
    return Sentence("Worst place", f"{node} in {run.name}, RMSE {kelvin(errors.rmse)}{text}.")


def versus_narrative(result: Versus) -> Narrative:
    """Which of two models predicts the same logs better, and by how much."""
    (one, other), whole = (f'"{name}"' for name in result.names), result.classes[-1]
    mine, others = map(sqrt, whole.square)
    verdict = f"{one} and {other} predict equally well"
    if not HELPED * others < mine < others / HELPED:
        verdict = f"{one} predicts {'better' if mine < others else 'worse'} than {other}"
    smaller = sum(pair.max[0] < pair.max[1] for pair in result.runs)
    runs = f"in {smaller} of {len(result.runs)} runs the former has the smaller one"
    error = f"RMSE {kelvin(mine)} against {kelvin(others)}, largest error {kelvin(whole.max[0])} against "
    error += f"{kelvin(whole.max[1])}{f'; {runs}' if len(result.runs) > 1 else ''}."
    both = (result.model, result.other)
    return Narrative([Sentence("Verdict", f"{verdict}."), Sentence("Error", error), *_not_fitted(*both)])


def _not_fitted(*comparisons: Comparison) -> list[Sentence]:
    """Which models have the values that somebody wrote into their files."""
    networks = [comparison.model.network for comparison in comparisons if not comparison.fitted]
    if not networks:
        return []
    names = listed([Path(network.origin).name for network in networks])
    plural = "are" if len(networks) > 1 else "is"
    return [Sentence("Not fitted", f"{names} {plural} compared with the file's own values; run lptn fit first.")]


# --- a forecast -------------------------------------------------------------------------------------------------


_LATE = 60.0  # s before a log's end, that are worth a word


def forecast_narrative(ahead: Forecast) -> Narrative:
    """Which node reaches its limit first and when, with what load, how sure, and which sensors were left out."""
    window = ahead.window
    cycles = f" ({window.cycles} gait cycles of {window.period:.3g} s)" if window.cycles and window.period else ""
    load = f"Assumed to continue as over {window.why}{cycles}."
    if ahead.late >= _LATE:
        load += f" The forecast begins {time_span(ahead.late)} before the end of the log: later inputs are unknown."
    said = [Sentence("Verdict", _first_limit(ahead)), Sentence("Load", load)]
    said.append(Sentence("Uncertainty", f"{capitalised(ahead.trust)}."))
    if ahead.doubts:
        doubts = "; ".join(map(str, ahead.doubts))
        text = f"{doubts}. From then on the forecast uses the model and the other sensors."
        said.append(Sentence("Sensors ignored", text))
    return Narrative(said)


def _first_limit(ahead: Forecast) -> str:
    """The nodes above their limits, the next to reach one, or the nearest to one."""
    nodes = list(ahead.nodes.values())
    passed = [f"{one.node} ({one.limit:g} °C)" for one in nodes if one.time_to_limit == 0]
    texts = [f"Above the limit now: {few(passed)}."] if passed else []
    coming = sorted((one for one in nodes if one.reaches and one.time_to_limit > 0), key=lambda one: one.time_to_limit)
    if coming:
        first = coming[0]
        next_ = "next" if passed else "first"
        interval = f"{percent(ahead.coverage)} interval {interval_to_limit(first)}"
        texts.append(f"{first.node} reaches {first.limit:g} °C {next_}, in {time_to_limit(first)} ({interval}).")
    elif not passed:
        nearest = max(nodes, key=lambda one: (one.chance, one.steady - one.limit))
        settles = f", which settles at {settling_temperature(nearest)} °C" if isfinite(nearest.steady) else ""
        text = f"Nearest to it is {nearest.node}{settles}; its limit is {nearest.limit:g} °C"
        texts.append(f"No node reaches its limit. {text}.")
    return " ".join(texts)


# --- monitored logs -----------------------------------------------------------------------------------------------


def monitoring_narrative(result: Monitoring) -> Narrative:
    """Which sensors and inputs have alarms, the largest error of logs without one, and where the limits are from."""
    alarms = {watched.run.name: _alarms_of(watched) for watched in result.runs}
    quiet = [watched for watched in result.runs if not alarms[watched.run.name]]
    faulty = [f"{few(names)} in {run}" for run, names in alarms.items() if names]
    sound = [watched.run.name for watched in quiet]
    verdict = [f"{begin} {few(logs)}." for begin, logs in (("Alarm at", faulty), ("No alarm in", sound)) if logs]
    said = [Sentence("Verdict", " ".join(verdict))]
    if quiet:
        error, node, run = max(
            (error, node, one.run.name) for one in quiet for node, error in one.largest_error.items()
        )
        said.append(Sentence("Largest error", f"{kelvin(error)} at {node} in {run}, which has no alarm."))
    limits = "are guesses; pass the logs of the fit as --healthy to calibrate them"
    if hours := result.calibration.healthy_hours:
        limits = f"come from {hours:.3g} h of healthy logs"
    said.append(Sentence("Uncertainty", f"The statistical detector's limits {limits}."))
    return Narrative(said)


def _alarms_of(watched: MonitoredRun) -> list[str]:
    """Sensors and inputs with alarms, each with its kind, which the statistical detector knows better."""
    alarms = (*watched.threshold_alarms, *watched.statistical_alarms)
    kinds = {alarm.channel or alarm.node: alarm.kind for alarm in alarms}
    return [f"{name} ({kind})" for name, kind in kinds.items()]


# --- logs, before any fit -------------------------------------------------------------------------------------


def logs_narrative(model: Model, runs: Sequence[Run], logs: int | None = None, unusable: int = 0) -> Narrative:
    """Whether logs can be used, what the model needs, what the logs hold, and how many effects they could show.

    Args:
        model: the model.
        runs: what was read.
        logs: how many there are; as many as runs by default.
        unusable: how many of them no other command takes.
    """
    count = len(runs) if logs is None else logs
    suspect = len({(run.source, issue.sentence) for run in runs for issue in run.issues})
    constants = _torque_constants(model, runs)
    suspect += len(constants)
    all_ = {1: "the log", 2: "both logs"}.get(count, f"all {count} logs")
    verdict = f"{all_} can be used, and nothing looks wrong"
    if unusable:
        verdict = f"{f'{unusable} of {count} logs' if count > 1 else 'the log'} can't be used yet"
    elif suspect:
        verdict = f"{count_of(suspect, 'thing')} in {all_} may be wrong, see below"
    said = [Sentence("Verdict", f"{capitalised(verdict)}.")] if count else []
    nodes = f"{count_of(len(model.nodes), 'node')} ({few(model.nodes)})"
    inputs = f"inputs {few(model.inputs)}" if model.inputs else "no input"
    text = f"{model.network.name}, {nodes}, {count_of(len(model.free), 'free parameter')}; {inputs}."
    started = [
        f" {column} is no column of the log: it is estimated from each run's first readings."
        for column in model.started
    ]
    said.append(Sentence("Model", text + "".join(started)))
    said += [*_losses(model), *(Sentence("Warning", sentence) for sentence in constants)]
    return Narrative([*said, *content_narrative(model, runs)] if runs and not unusable else said)


def _losses(model: Model) -> Iterator[Sentence]:
    """What the winding's resistance and its amperes are taken for."""
    kinds: dict[tuple[str, str, str], list[EffectInstance]] = {}
    for instance in model.network.effect_instances:
        if instance.effect.key == "copper_loss":
            words = instance.effect.chosen
            kinds.setdefault((words["resistance_of"], words["amperes"], words["input"]), []).append(instance)
    for (resistance_of, amperes, given), instances in kinds.items():
        factor = CopperLoss(resistance_of=resistance_of, amperes=amperes).factor
        resistance, constant = (_range(model, instances, name) for name in ("resistance", "torque_constant"))
        whose = f"{few([instance.ends[0] for instance in instances])}: " if len(kinds) > 1 else ""
        current = f"torque / {constant} N·m per {_AMPERES[amperes]}"
        if given == "current":
            current = f"{_AMPERES[amperes]} as logged"
        law = f"{f'{factor:g} ' if factor != 1 else ''}R I²"
        yield Sentence("Losses", f"{whose}{law}, {resistance} ohm {_RESISTANCE_OF[resistance_of]}, {current}.")


_RESISTANCE_OF = {"phase": "of one phase", "line_to_line": "between two terminals", "delta": "of one side of a delta"}
_AMPERES = {"power_invariant": "power-invariant A", "amplitude": "peak A", "rms": "RMS A", "block": "two-phase A"}


def _range(model: Model, instances: Sequence[EffectInstance], name: str) -> str:
    values = [model.values[instance.parameters[name]] for instance in instances]
    return " to ".join(dict.fromkeys(f"{value:.3g}" for value in (min(values), max(values))))


def _torque_constants(model: Model, runs: Sequence[Run]) -> list[str]:
    """A sentence on joints whose logged torque and current don't go with the torque constant."""
    joints: dict[tuple[str, str, str], list[str]] = {}
    for joint, (logged, said) in torque_per_ampere(model, runs).items():
        if words := apart(logged, said):
            joints.setdefault((f"{logged:.3g}", f"{said:.3g}", words), []).append(joint)
    return [
        f"{few(those)}: the logged torque is {logged} N·m for each logged ampere, torque_constant says {said}: "
        f'{words}; torque_constant must count the same amperes as the resistance; or write input = "current".'
        for (logged, said, words), those in joints.items()
    ]


def content_narrative(model: Model, runs: Sequence[Run]) -> Narrative:
    """What runs hold: sensors, excitation, and how many effects of the catalogue they could show."""
    bound_runs = [bind(model, run) for run in runs]
    measured = np.concatenate([bound.measured for bound in bound_runs], axis=1)
    there = np.isfinite(measured).any(axis=1)
    floors = estimate_noise(bound_runs, model.nodes).floor[there]
    without = [node for node, has_sensor in zip(model.nodes, there, strict=True) if not has_sensor]
    noise = "–".join(dict.fromkeys(f"{value:.2g}" for value in (floors.min(), floors.max())))
    sensors = f"{np.nanmin(measured):.1f} to {np.nanmax(measured):.1f} °C, noise {noise} K"
    sensors += f"; not measured: {few(without)}." if without else "."
    excited = excitation(runs, model.nodes)
    load = "no load"
    if excited.levels:
        load = f"{count_of(excited.levels, 'level')} of load, at rest {100 * excited.still:.0f} % of the time"
    air = f"which change by up to {excited.ambient:.2g} K within a run"
    base = excited.ranges.get("speed.base")
    said = (
        f"{time_span(60 * excited.minutes)}, {load}; {count_of(excited.cool_downs, 'cool-down')}; "
        f"{count_of(excited.steps, 'jump')} of load; up to {excited.rise:.3g} K above the surroundings "
        f"({air if excited.ambient > ZERO else 'constant, or not logged'}); "
        f"base speed {f'{base[0]:.2g} to {base[1]:.2g} m/s' if base else 'not logged'}."
    )
    effects = identifiability(model, runs, excited)
    lacking = Counter(each.why.removeprefix(NOT_LOGGED) for each in effects if each.why.startswith(NOT_LOGGED))
    columns = ", ".join(column for column, _ in lacking.most_common(FEW))
    could = f"{sum(each.identifiable for each in effects)} of {len(effects)} could show if present"
    could += f"; more with columns such as {columns}." if columns else "."
    return Narrative([Sentence("Sensors", sensors), Sentence("Excitation", said), Sentence("Effects", could)])


# --- the details of a search ------------------------------------------------------------------------------------


def details(history: History, data: DataSplit) -> list[str]:
    """Details of the answer: data, sizes of effects, effects that were not added."""
    texts = [_which_data(history, data)]
    if history.remaining == "adequate":
        texts.append(_covered(history.best.fit))
    texts += [_step_in_words(history, number) for number in range(1, len(history.steps))]
    if history.last.refused:
        names = [f"{named(*step.key)} ({percent(step.probability)})" for step in history.last.refused]
        texts.append(f"Fitted as well, and not added: {few(names)}.")
    return texts


def _which_data(history: History, data: DataSplit) -> str:
    """Which runs were fitted, which chose, which only test the result."""
    text = f"{history.steps[0].parameters} parameters of the model as given were fitted on {_runs(data.fit)}."
    if data.holdout:
        text += f" Held out: {_runs(data.holdout)}; only the initial temperatures are fitted there."
    if data.test:
        return f"{text} Test: {_runs(data.test)}; these runs chose nothing, so quote their error."
    if len(history.steps) == 1:
        return text
    flaw = "the held-out error, which helped to choose, is slightly optimistic" if data.holdout else "nothing tests it"
    return f"{text} There are no test runs, so {flaw}; give one more log with --test."


def _runs(segments: Sequence[Segment]) -> str:
    """Runs by name, and the segment that counts where it is not all."""
    parts = [(segment.run.name, window_text(segment.evaluation, segment)) for segment in segments]
    return few([name if part == "all" else f"{name} ({part})" for name, part in parts])


def _covered(fit: Fit) -> str:
    """For which temperatures the verdict holds."""
    bound_runs = fit.problem.bound_runs
    readings = np.concatenate([bound.measured[bound.counted] for bound in bound_runs])
    minutes = sum(len(bound) * bound.run.step for bound in bound_runs) / 60
    covered = f"{minutes:.3g} min at {readings.min():.0f} to {readings.max():.0f} °C"
    return f"The verdict holds for what the fit data cover: {covered}."


def _step_in_words(history: History, number: int) -> str:
    step = history.steps[number]
    chosen = f" ({percent(step.probability)} probable)" if step.probability else ", chosen by hand"
    size = size_in_words(step, history.best.fit)
    text = f"Step {number}, {named(*step.key)}{chosen}{f': {size}' if size else ''}."
    return " ".join(filter(None, (text, removed_in_words(history, number))))


_DIFFERENT = 2.0  # standard errors from which on a size differs from zero


def size_in_words(step: Step, last: Fit) -> str:
    """The size of an added effect against its typical value, such as `conductance 0.02 ± 0.001 W/K, 20 % of a typical
    value`, and its time constant where it has one; of an effect that is there or not, its shape.

    Args:
        step: the effect.
        last: a fit of a model that has it.
    """
    values = {instance.name: instance for instance in last.model.parameters}
    sizes, times, doubt = "", "", ""
    for declaration in step.declarations:
        for parameter in declaration.resolved.values():
            name = declaration.shared_name(parameter.name)
            if name not in last.standard_errors:
                continue
            error, value = last.standard_errors[name], values[name].value
            text = f"{parameter.name.replace('_', ' ')} {value_in_words(value, error, parameter.unit_behind)}"
            if parameter.off is None and parameter.unit == "s":
                times = text + _where_others_have(declaration, parameter, last)
            elif parameter.off is None and declaration.effect.size() != declaration.effect.amplitude():
                sizes = text
            elif parameter.off is not None:
                share = abs(value / values[name].declared.typical)
                times_as_large = f"{short_size(share)} times" if share > 1 else f"{short_size(100 * share)} % of"
                beside = " beyond what it has in common with others" if declaration.difference else ""
                others = _where_others_have(declaration, parameter, last)
                sizes = f"{text}{beside}{others}, {times_as_large} a typical value"
                doubt = "" if abs(value - parameter.off) >= _DIFFERENT * error else "; not significant"
    return "; ".join(filter(None, (sizes + doubt, times)))


def _where_others_have(declaration: EffectDeclaration, parameter: Parameter, last: Fit) -> str:
    """The common value of the other places, for a place with its own: `, where the others have 8 s`."""
    key, values = declaration.effect.key, last.model.parameters
    common = {instance.parameters[parameter.name] for instance in last.model.network.in_common(key)}
    others = [values[k].value for k in sorted(common) if values[k].name != declaration.shared_name(parameter.name)]
    if declaration.difference or declaration.run or not others:
        return ""
    return f", where the others have {short_size(others[0])} {unit_text(parameter.unit)}"


_MAIN = 0.5  # share from which on a node or a run is named


def removed_in_words(history: History, number: int) -> str:
    """Where a step lowers the error of the fit data, such as `It explains 41 % of the remaining squared error, 92 % of
    that at winding, 70 % in Run5.`; empty where it lowers none.
    """
    removed = Removed.between(history.steps[number - 1].fit, history.steps[number].fit)
    if removed.share <= 0:
        return ""
    if removed.share < 0.01:  # too little to say where
        return "It explains less than 1 % of the remaining squared error."
    text = f"It explains {100 * removed.share:.0f} % of the remaining squared error"
    for word, shares in (("at", removed.by_node), ("in", removed.by_run)):
        name = max(shares, key=shares.__getitem__)
        if len(shares) > 1 and shares[name] > _MAIN:
            text += f", {100 * min(shares[name], 1.0):.0f} % of that {word} {name}"
    return f"{text}."
