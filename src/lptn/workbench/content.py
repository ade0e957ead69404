"""What the page says of a study: head, steps, tiles, answers, data, and the lines that would do the same elsewhere."""

from __future__ import annotations

import shlex
from collections import Counter
from dataclasses import asdict
from itertools import combinations
from typing import Any

import numpy as np

from lptn.basics.equations import equations_of
from lptn.diagnose import answers
from lptn.diagnose.answers import Key, Step
from lptn.diagnose.diagnosis import Diagnosis
from lptn.effects import catalogue
from lptn.identify.comparison import Comparison, Errors
from lptn.identify.data import Segment
from lptn.report.narrative import content_narrative, largest_error, narrative, size_in_words
from lptn.report.shown import noise_alone, views, worst_view
from lptn.report.tables import conditions_by_quantity
from lptn.report.text import experiment_for, for_people, named, percent, place_of, short, size_text, title_of
from lptn.study import Study
from lptn.workbench.bench import Bench, names_of, segments
from lptn.workbench.opening import Opening

_JOB_NAMES = {"fit": "fitted", "holdout": "held out", "test": "test"}
_LIKELY = 0.5  # the probability from which an answer's name stands out: more probable than not
_PAIRS = 10  # of parameters: others go together less


def content_of(bench: Bench) -> dict[str, Any]:
    """The page's content, as JSON holds it; `given` and `now` name the models whose lines are drawn."""
    study, opening = bench.study, bench.opening
    content: dict[str, Any] = {
        "name": study.model.network.name,
        "nodes": list(study.model.nodes),
        "segments": [_segment(study, key, segment) for key, segment in segments(study).items()],
        "contents": [(each.label, each.text) for each in content_narrative(study.model, study.runs)],
        "issues": _issues(study),
        "stretches": [asdict(stretch) for stretch in study.stretches],
        "fitted": bool(study.steps),
        "effects": {key: one.title for key, one in sorted(catalogue().items(), key=lambda each: each[1].title)},
        "commands": commands(study, opening),
        "python": python_lines(study, opening),
        "file": study.file.text,
    }
    if not study.steps:
        return content
    names = names_of(study.steps)
    return content | {
        "given": names[0],
        "now": names[-1],
        "against": f"against {bench.against[0]}" if bench.against[0] else "",
        "head": _head(bench),
        "steps": [step_content(step) for step in study.steps],
        "undone": [step_content(step) for step in study.undone],
        "branches": [[step_content(step) for step in branch[1:]] for branch in study.branches],
        "tiles": _tiles(bench),
        "conditions": _conditions(bench),
        "parameters": _parameters(study.steps[-1]),
        "correlations": _correlations(study.steps[-1]),
        "answers": _answers(study, study.diagnosed, bench) if study.diagnosed else None,
        "advice": [for_people(sentence) for sentence in study.advised.sentences] if study.advised else [],
    }


# --- head: how far the model is off, and what is said of it -----------------------------------------------


def _head(bench: Bench) -> dict[str, Any]:
    study = bench.study
    first, last = study.steps[0], study.steps[-1]
    which = "held out" if first.holdout else "fitted"
    floor = noise_alone(first.fit)
    against = [bench.errors_against[key] for key in _unseen(bench)[1] if key in bench.errors_against]
    said = narrative(study.steps, study.diagnosed, study.advised)
    return {
        "which": which,
        "given": _error(first),
        "now": _error(last),
        "floor": floor,
        "against": Errors.of(np.concatenate([each.ravel() for each in against])).rmse if against else None,
        "said": [(each.label, each.text) for each in [*said, largest_error(_unseen(bench)[0])]],
    }


def _error(step: Step) -> float:
    return step.holdout.rmse if step.holdout else step.fit.rmse


def _unseen(bench: Bench, number: int = -1) -> tuple[Comparison, list[str]]:
    """A step's model on data that no fit saw, where there are any, and the segments that they are."""
    predictions, steps = bench.predictions(number), bench.study.steps
    judged = {key: prediction for key, prediction in predictions.items() if not key.startswith("fit")} or predictions
    return Comparison(steps[number].fit.model, tuple(judged.values()), steps[0].fit.noise), list(judged)


# --- steps, tiles, parameters --------------------------------------------------------------------------------


def step_content(step: Step) -> dict[str, Any]:
    """A row of the table of steps."""
    return {
        "name": named(*step.key) if step.effect else "as given",
        "effect": step.effect,
        "at": step.at,
        "parameters": step.parameters,
        "fit": step.fit.rmse,
        "holdout": step.holdout.rmse if step.holdout else None,
        "test": step.test.rmse if step.test else None,
    }


def _segment(study: Study, key: str, segment: Segment) -> dict[str, Any]:
    """A run on the page; `from` and `to` are where its errors count."""
    run, (start, stop) = segment.run, segment.evaluation
    first, last = float(run.time[0]), float(run.time[-1] + run.step)
    job = key.partition(" ")[0]
    return {
        "key": key,
        "run": run.name,
        "job": _JOB_NAMES[job],
        "origin": run.origin,
        "clock": run.began is not None,
        "signals": list(run.columns),
        "start": first,
        "stop": min(stop, last) if job == "fit" else last,
        "from": max(start, first),
        "to": min(stop, last),
    }


def _tiles(bench: Bench) -> dict[str, dict[str, list[dict[str, float] | None]]]:
    """For each segment, for the models as given and now, the errors of each node; `None` where nothing is measured."""
    tiles: dict[str, dict[str, list[dict[str, float] | None]]] = {key: {} for key in segments(bench.study)}
    numbers = {"given": 0, "now": len(bench.study.steps) - 1}
    errors = {name: {key: one.error for key, one in bench.predictions(k).items()} for name, k in numbers.items()}
    for name, by_segment in (errors | {"against": bench.errors_against}).items():
        for key, error in by_segment.items():
            summaries = [Errors.of(row) for row in error]
            tiles[key][name] = [asdict(summary) if summary.count else None for summary in summaries]
    return tiles


def _conditions(bench: Bench) -> dict[str, list[dict[str, Any]]]:
    """Of the models as given and now, errors by operating condition, on data that no fit saw where there are any.

    Each condition has a tile for each node: errors [K], the limits in words, and the segment where the node is worst.
    """
    nodes = list(bench.study.model.nodes)
    by_model: dict[str, list[dict[str, Any]]] = {"given": [], "now": []}
    for number, rows in zip((0, -1), by_model.values(), strict=True):
        comparison, keys = _unseen(bench, number)
        worst = {node: keys[worst_view(comparison, node)[0]] for _, node in views(comparison)}
        for quantity, cells in conditions_by_quantity(comparison).items():
            met: Counter[str] = Counter()
            columns: dict[int, list[dict[str, Any] | None]] = {}
            for cell in cells:
                met[cell.node] += 1
                limits = f"{short(cell.lower)} to {short(cell.upper)}"
                tile = asdict(cell.errors) | {"limits": limits, "segment": worst[cell.node]}
                columns.setdefault(met[cell.node], [None] * len(nodes))[nodes.index(cell.node)] = tile
            rows += [{"group": quantity, "name": str(part), "tiles": columns[part]} for part in sorted(columns)]
    return by_model


def _parameters(step: Step) -> list[dict[str, Any]]:
    """The model's parameters, those of a declaration together; standard errors `None` where they are not determined."""
    fit = step.fit
    errors, network = fit.standard_errors, fit.model.network
    together = {name: list(owners) for owners in network.declared_at.values() for name in owners}
    return [
        {
            "name": parameter.name,
            "part": parameter.owner,
            "value": parameter.value,
            "error": errors.get(parameter.name),
            "unit": "" if parameter.declared.unit == "1" else parameter.declared.unit,
            "bounds": parameter.declared.bounds,
            "prior": parameter.declared.prior,
            "free": parameter.free,
            "together": [name for name in together.get(parameter.name, []) if name != parameter.name],
        }
        for parameter in fit.model.parameters
    ]


def _correlations(step: Step) -> list[dict[str, Any]]:
    """The pairs of free parameters whose estimates are most correlated."""
    fit = step.fit
    names = [fit.model.parameters[index].name for index in fit.problem.free]
    matrix = fit.uncertainty.correlations
    pairs = [(matrix[one, other], names[one], names[other]) for one, other in combinations(range(len(names)), 2)]
    pairs.sort(key=lambda pair: -abs(pair[0]))
    return [{"one": one, "other": other, "correlation": float(both)} for both, one, other in pairs[:_PAIRS]]


# --- answers ------------------------------------------------------------------------------------------------


def _answers(study: Study, diagnosis: Diagnosis, bench: Bench) -> dict[str, Any]:
    shown = []
    for step in sorted(diagnosis.steps, key=lambda step: -step.probability):
        effect = catalogue()[step.effect or ""]
        shown.append(
            _place(step)
            | _tried(bench, step.key)
            | {
                "kind": "structure" if step.is_structure else "finding",
                "details": size_in_words(step, step.fit),
                "equations": equations_of(effect.__doc__ or ""),
                "looks_like": effect.signature.looks_like,
                "separate_by": experiment_for(effect),
                "same": [named(*key) for key in step.indistinguishable],
            }
        )
    return {
        "verdict": diagnosis.verdict,
        "together": _error(diagnosis.steps[-1]) if diagnosis.steps else None,
        "answers": shown,
        "refused": [_place(step) for step in diagnosis.refused],
        "weighed": [_named(*one.candidate.key) | _tried(bench, one.candidate.key) for one in bench.weighed_only],
    }


def _place(step: Step) -> dict[str, Any]:
    """What an effect that was fitted is called, how large and how probable it is."""
    size, probable = size_text(step, step.fit), percent(step.probability)
    return _named(*step.key) | {"size": size, "probable": probable, "likely": step.probability > _LIKELY}


def _named(effect: str, at: str) -> dict[str, Any]:
    return {"effect": effect, "at": at, "title": title_of(effect), "place": place_of(at)}


def _tried(bench: Bench, key: Key) -> dict[str, Any]:
    """The model with an effect added alone, where that was fitted: its name, and the errors that *Add* leaves."""
    step = next((step for step in bench.study.attempts if step.key == key), None)
    if step is None:
        return {"key": answers.named(key), "tried": ""}
    return step_content(step) | {"key": answers.named(key), "tried": bench.name_tried(step)}


# --- data -----------------------------------------------------------------------------------------------------


def _issues(study: Study) -> list[dict[str, Any]]:
    """What looks wrong in the logs; `stretch` is from and to [s], `None` for all of a log."""
    issues: dict[tuple[str, str], dict[str, Any]] = {}
    for run in study.runs:
        for issue in run.issues:
            place = issue.key.partition(".")[2]
            content = {"run": run.name, "key": issue.key, "place": place, "kind": issue.kind}
            content |= {"problem": for_people(issue.problem), "remedy": for_people(issue.remedy)}
            issues.setdefault((run.source, issue.sentence), content | {"stretch": issue.stretch})
    return list(issues.values())


# --- the same without the page --------------------------------------------------------------------------------


def commands(study: Study, opening: Opening) -> list[str]:
    """Commands that do what was done here; stretches and parameters that were set have none, Python does."""
    lines, file = [], str(opening.model)
    for number, step in enumerate(study.steps[1:], start=1):
        words = ["lptn", "add", file, step.effect or "", "--at", step.at or "", "-o", f"step{number}.toml"]
        lines.append(shlex.join(words))
        file = f"step{number}.toml"
    logs = list(map(str, opening.fit))
    options = ["--holdout-after", str(opening.holdout_after)] if opening.holdout_after is not None else []
    mapped = [word for text in opening.columns for word in ("--map", text)]
    lines.append(shlex.join(["lptn", "fit", file, *logs, *options, *mapped, "-o", "better.toml"]))
    if opening.holdout:
        lines.append(shlex.join(["lptn", "compare", "better.toml", *map(str, opening.holdout), *mapped]))
    return lines


def python_lines(study: Study, opening: Opening) -> str:
    """A script that does what was done here."""
    given = [("fit", opening.fit), ("holdout", opening.holdout), ("test", opening.test)]
    words = [repr(str(opening.model)), *(f"{name}={list(map(str, logs))}" for name, logs in given if logs)]
    options = {
        "holdout_after": opening.holdout_after,
        "columns": list(opening.columns) or None,
        "ambient_error": opening.ambient_error,
        "torque_error": opening.torque_error,
        "surface_error": opening.surface_error,
    }
    words += [f"{name}={value!r}" for name, value in options.items() if value is not None]
    lines = ["import lptn", "", f"study = lptn.Study({', '.join(words)})"]
    for stretch in study.stretches:
        call = "hold_out" if stretch.held_out else "leave_out"
        lines.append(f"study.{call}({stretch.run!r}, {stretch.start:.12g}, {stretch.stop:.12g})")
    lines.append("study.fit()")
    lines += [f"study.add({step.effect!r}, at={step.at!r})" for step in study.steps[1:]]
    for setting in study.settings:
        arguments = {"value": setting.value, "bounds": setting.bounds, "fixed": setting.fixed}
        words = [repr(setting.name), *(f"{name}={value!r}" for name, value in arguments.items() if value is not None)]
        lines.append(f"study.set_parameter({', '.join(words)})")
    return "\n".join([*lines, 'study.save("better.toml")', 'study.report("story.html")', ""])
