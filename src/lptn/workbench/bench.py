"""A study on the workbench: carries out the page's orders, and collects what the page shows."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from lptn.basics.arrays import FloatArray
from lptn.basics.errors import InputError
from lptn.diagnose.answers import Step, named
from lptn.diagnose.evidence import FirstOrder
from lptn.diagnose.unexplained_heat import UnexplainedHeat
from lptn.identify.comparison import Prediction, versus
from lptn.identify.data import Segment
from lptn.identify.validation import Spread, spread_of
from lptn.report.network_drawing import NetworkCourse
from lptn.study import Study
from lptn.workbench.lines import RunLines
from lptn.workbench.opening import Opening
from lptn.workbench.orders import Add, Back, Cut, Keep, Order, Plain, Set, Try

_MOST_WEIGHED = 12  # candidates beyond the answers; less probable ones are useless


@dataclass
class News:
    """Lines that were not sent to the page yet.

    Args:
        runs: by segment, without any model's line; where there are some, all older lines are of other data.
        predicted: by segment and model.
        heat: by segment; it replaces all older one.
        spreads: by segment, of what the model as it is now predicts; they replace all older ones.
        networks: what the model as it is now predicts, by segment; it replaces all older ones.
    """

    runs: dict[str, RunLines] = field(default_factory=dict)
    predicted: dict[tuple[str, str], FloatArray] = field(default_factory=dict)
    heat: dict[str, UnexplainedHeat] = field(default_factory=dict)
    spreads: dict[str, Spread] = field(default_factory=dict)
    networks: dict[str, NetworkCourse] = field(default_factory=dict)


class Bench:
    """A study, and what was computed from it for plots.

    Args:
        study: the study.
        opening: the files and options that it was made from.
        folder: of the session; report and FMU go there, too.
        fingerprint: of those files and options.
    """

    def __init__(self, study: Study, opening: Opening, folder: Path, fingerprint: str = "") -> None:
        self.study, self.opening, self.folder, self.fingerprint = study, opening, folder, fingerprint
        self.heat: dict[str, dict[str, UnexplainedHeat]] = {}
        """Unexplained heat of each model, by segment."""
        self.against: tuple[str, dict[str, FloatArray]] = "", {}
        """What another study's model is called on the page, and what it predicts [degC], (nodes, n), by segment."""
        self._predictions: dict[str, dict[str, Prediction]] = {}
        self._spreads: dict[str, dict[str, Spread]] = {}
        self._sent: set[tuple[str, str]] = set()

    # --- what can be ordered --------------------------------------------------------------------

    def do(self, order: Order | Keep, on_step: Callable[[tuple[Step, ...]], None] = lambda _: None) -> None:
        """Do what the page ordered.

        Args:
            order: what it ordered.
            on_step: called with the best steps of a search while it goes on.

        Raises:
            InputError: it can't be done with this model and these logs.
        """
        if isinstance(order, Plain):
            self._plain(order, on_step)
        elif isinstance(order, Add | Try):
            answer = next((step for step in self._answers if step.key == (order.effect, order.at)), None)
            take = self.study.add if isinstance(order, Add) else self.study.attempt
            take(answer or order.effect, "" if answer else order.at)
        elif isinstance(order, Cut):
            self._cut(order)
        elif isinstance(order, Set):
            self._set(order)
        elif isinstance(order, Back):
            self.study.go_back(order.number)
        elif isinstance(order, Keep):
            for effect, at in order.steps:
                self.study.add(effect, at)

    def _plain(self, order: Plain, on_step: Callable[[tuple[Step, ...]], None]) -> None:
        if order.what == "improve":
            self.study.improve(on_step=on_step)
        elif order.what == "report":
            self.study.report(self.folder / "story.html")
        elif order.what == "fmu":
            self.study.export_fmu(self.folder / "model.fmu")
        elif order.what == "use_all":
            self.study.use_again()
            self._forget(of_other_data=True)
        else:
            getattr(self.study, order.what)()

    def _set(self, order: Set) -> None:
        """Set what is another than it was."""
        parameter = next((candidate for candidate in self.study.model.parameters if candidate.name == order.name), None)
        if parameter is None:
            raise InputError("parameter", order.name, "no such parameter", "one that the page lists")
        least, most = order.bounds
        old = parameter.declared.bounds
        bounds = old[0] if least is None else least, old[1] if most is None else most
        self.study.set_parameter(
            order.name,
            order.value,
            bounds=None if bounds == old else bounds,
            fixed=order.fixed if order.fixed == parameter.free else None,
        )
        self._forget()

    def _cut(self, order: Cut) -> None:
        cut = order.run, order.start, order.stop
        if order.what == "use_again":
            known = {(one.run, one.start, one.stop): one for one in self.study.stretches}
            if cut not in known:
                raise InputError("stretch", order.run, "not left out", "a stretch that was")
            self.study.use_again(known[cut])
        else:
            getattr(self.study, order.what)(*cut)
        self._forget(of_other_data=True)

    def _forget(self, of_other_data: bool = False) -> None:
        """Discard what was computed of another model as given, or of other data, which another study predicts, too."""
        if of_other_data:
            self.against = "", {}
        for results in (self.heat, self._predictions, self._spreads, self._sent):
            results.clear()

    def look_closer(self) -> None:
        """Compute what is shown after a diagnosis: each answer added alone, heat, the next experiment."""
        if self.study.diagnosed is None:
            return
        for answer in self._answers:
            self.study.attempt(answer)
        if self.model not in self.heat:
            heat = self.study.unexplained_heat()
            self.heat[self.model] = {f"fit {number}": estimate for number, estimate in enumerate(heat)}
        self.study.advise()

    @property
    def weighed_only(self) -> list[FirstOrder]:
        """The most probable of the candidates that would have any size, and are no answers."""
        diagnosis = self.study.diagnosed
        if diagnosis is None:
            return []
        refitted = {step.key for step in diagnosis.steps}
        others = [one for one in diagnosis.weighed if one.amplitude and one.candidate.key not in refitted]
        return others[:_MOST_WEIGHED]

    def compare_with(self, name: str, other: Study | None) -> None:
        """Have another study's model predict these runs, too; a node that it lacks is NaN.

        Raises:
            InputError: a run lacks an input of it, or they have no node in common.
        """
        if other is None:
            self.against = "", {}
            return
        both, theirs = segments(self.study), segments(other)
        predicted = versus(self.study.model, other.model, [*both.values()], [*theirs.values()]).other
        rows, readings = {node: row for row, node in enumerate(predicted.model.nodes)}, dict[str, FloatArray]()
        for (key, shown), prediction in zip(self.predictions(-1).items(), predicted.predictions, strict=True):
            readings[key] = np.full_like(shown.readings, np.nan)
            for k, node in enumerate(self.study.model.nodes):
                if node in rows:
                    times, line = prediction.bound.run.time, prediction.readings[rows[node]]
                    readings[key][k] = np.interp(shown.bound.run.time, times, line)
        self.against = name, readings

    @property
    def errors_against(self) -> dict[str, FloatArray]:
        """Errors of the other study's model where this one's count [K], (nodes, n), by segment."""
        now, lines = self.predictions(-1) if self.against[0] else {}, self.against[1]
        return {
            key: np.where(np.isfinite(one.error), lines[key] - one.bound.measured, np.nan) for key, one in now.items()
        }

    # --- what there is to show ------------------------------------------------------------------

    @property
    def model(self) -> str:
        """What the model as it is now is called on the page: its effects, one after the other."""
        return names_of(self.study.steps)[-1] if self.study.steps else ""

    def name_tried(self, step: Step) -> str:
        """What the model as it is now would be called with an attempt added."""
        return names_of((*self.study.steps, step))[-1]

    @property
    def _answers(self) -> tuple[Step, ...]:
        return self.study.diagnosed.steps if self.study.diagnosed else ()

    def predictions(self, step: int | Step) -> dict[str, Prediction]:
        """What the model of a step, or of an attempt, predicts, by segment."""
        name = names_of(self.study.steps)[step] if isinstance(step, int) else self.name_tried(step)
        if name not in self._predictions:
            of_all = [one for predicted in self.study.predictions(step).values() for one in predicted]
            self._predictions[name] = dict(zip(segments(self.study), of_all, strict=True))
        return self._predictions[name]

    def news(self) -> News:
        """The lines that were not sent yet."""
        news = News()
        if not self.study.steps:
            return news
        nodes = tuple(self.study.model.nodes)
        models: dict[str, int | Step] = {self.name_tried(step): step for step in self.study.attempts}
        models |= {names_of(self.study.steps)[0]: 0, self.model: -1}
        for name, step in models.items():
            for segment, prediction in self.predictions(step).items():
                if (segment, "") not in self._sent:
                    news.runs[segment] = RunLines.of(prediction, nodes)
                if (segment, f"model {name}") not in self._sent:
                    news.predicted[segment, name] = prediction.readings
                self._sent |= {(segment, ""), (segment, f"model {name}")}
        against, readings = self.against
        news.predicted |= {(key, f"against {against}"): lines for key, lines in readings.items()}
        news.heat = self.heat.get(self.model, {})
        fit, now = self.study.steps[-1].fit, self.predictions(-1)
        news.networks = {key: NetworkCourse.of(fit.model, predicted) for key, predicted in now.items()}
        if self.model not in self._spreads:
            self._spreads[self.model] = {key: spread_of(fit, predicted) for key, predicted in now.items()}
        news.spreads = self._spreads[self.model]
        return news


def segments(study: Study) -> dict[str, Segment]:
    """The study's segments by the names that the page has for them."""
    groups = study.data.by_job.items()
    return {f"{job} {number}": segment for job, group in groups for number, segment in enumerate(group)}


def name_of(step: Step) -> str:
    """An effect with its place, empty for the model as given."""
    return named(step.key) if step.effect else ""


def names_of(steps: tuple[Step, ...]) -> list[str]:
    """What the models of steps are called: each after all effects that were added up to it."""
    return ["; ".join(filter(None, map(name_of, steps[: number + 1]))) or "as given" for number in range(len(steps))]
