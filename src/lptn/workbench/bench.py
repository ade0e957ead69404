"""A study on the workbench: it does what the page orders, and knows what the page has to be told of it."""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from lptn.basics.arrays import FloatArray
from lptn.basics.errors import InputError
from lptn.diagnose.answers import Key, Step
from lptn.diagnose.diagnosis import Diagnosis, for_search
from lptn.diagnose.evidence import FirstOrder
from lptn.diagnose.previews import Previews
from lptn.diagnose.refits import refit
from lptn.diagnose.unexplained_heat import UnexplainedHeat
from lptn.identify.comparison import Errors, Prediction, predict
from lptn.identify.data import Segment
from lptn.report.network_course import NetworkCourse
from lptn.simulate.bound_run import BoundRun
from lptn.study import Study
from lptn.workbench.lines import Attempt, RunLines
from lptn.workbench.orders import Add, Back, Cut, Keep, Order, Plain, Set

logger = logging.getLogger("lptn")

_MOST_WEIGHED = 12  # candidates beyond the answers; what is less probable helps nobody
JOBS = ("fit", "holdout", "test")
"""What a run may be there for, in the order in which a page shows them."""


@dataclass
class News:
    """Lines that the page's side does not have yet.

    Args:
        runs: by segment, without any model's line; where there are some, all older lines are of other data.
        predicted: by segment and model.
        attempts: by segment and answer; they replace all older ones.
        heat: by segment; it replaces all older one.
        networks: what the model as it is now predicts, by segment; it replaces all older ones.
    """

    runs: dict[str, RunLines] = field(default_factory=dict)
    predicted: dict[tuple[str, str], FloatArray] = field(default_factory=dict)
    attempts: dict[tuple[str, str], Attempt] = field(default_factory=dict)
    heat: dict[str, UnexplainedHeat] = field(default_factory=dict)
    networks: dict[str, NetworkCourse] = field(default_factory=dict)


class Bench:
    """A study, and what was worked out of it for plots.

    Args:
        study: the study.
        folder: of the session; report and FMU go there, too.
        fingerprint: of the files and options that the study was made from.
    """

    def __init__(self, study: Study, folder: Path, fingerprint: str) -> None:
        self.study, self.folder, self.fingerprint = study, folder, fingerprint
        self.attempts: dict[str, dict[tuple[str, str], Attempt]] = {}
        """Lines of the answers to the diagnosis of each model, by segment and answer."""
        self.heat: dict[str, dict[str, UnexplainedHeat]] = {}
        """Unexplained heat of each model, by segment."""
        self._predictions: dict[str, dict[str, Prediction]] = {}
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
        elif isinstance(order, Add):
            answer = next((step for step in self._answers if step.key == (order.effect, order.at)), None)
            self.study.add(answer or order.effect, "" if answer else order.at)
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
            self._forget()
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
        if order.what == "use_again":
            again = [
                stretch
                for stretch in self.study.stretches
                if (stretch.run, stretch.start, stretch.stop) == _stretch(order)
            ]
            if not again:
                raise InputError("stretch", order.run, "not left out", "a stretch that was")
            self.study.use_again(again[0])
        else:
            getattr(self.study, order.what)(*_stretch(order))
        self._forget()

    def _forget(self) -> None:
        """All that was worked out of other data."""
        for results in (self.attempts, self.heat, self._predictions, self._sent):
            results.clear()

    def look_closer(self) -> None:
        """What takes time and may come after a diagnosis: what each answer would change, heat, the next experiment."""
        name = self.model
        if self.study.diagnosed is None:
            return
        self.attempts[name] = self.tries() | self._attempted(self.study.diagnosed)
        if name not in self.heat:
            heat = self.study.unexplained_heat()
            self.heat[name] = {f"fit {number}": estimate for number, estimate in enumerate(heat)}
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

    def tries(self) -> dict[tuple[str, str], Attempt]:
        """What all runs would look like with each answer: fitted where that is done, else to first order."""
        if self.study.diagnosed is None:
            return {}
        if self.model not in self.attempts:
            self.attempts[self.model] = self._linearised(self.study.diagnosed)
        return self.attempts[self.model]

    def _linearised(self, diagnosis: Diagnosis) -> dict[tuple[str, str], Attempt]:
        """To first order alone: there as soon as the answers are."""
        answers = {step.key for step in diagnosis.steps}
        shown = [one for one in diagnosis.weighed if one.amplitude and one.candidate.key in answers]
        candidates = [*shown, *self.weighed_only]
        if not candidates:
            return {}
        first_order, coarse = Previews(diagnosis.fit, candidates), for_search(self.study.data)
        runs = list(zip(diagnosis.fit.problem.bound_runs, first_order.of_fitted_runs(), strict=True))
        try:
            for segment in (*coarse.holdout, *coarse.test):
                predicted = first_order.of(segment)
                runs.append((predicted[0].bound, np.array([prediction.readings for prediction in predicted])))
        except InputError as error:  # a run lacks what a candidate goes by
            logger.info("held-out runs are tried once they are refitted: %s", error)
        return {
            (name, key_of(one.candidate.key)): _attempt(bound, readings, linearised=True)
            for name, (bound, of_all) in zip(segments(self.study), runs, strict=False)
            for one, readings in zip(candidates, of_all, strict=True)
        }

    def _attempted(self, diagnosis: Diagnosis) -> dict[tuple[str, str], Attempt]:
        """What the page's runs would look like with each answer added alone."""
        coarse = for_search(self.study.data)
        lines = {}
        for step in diagnosis.steps:
            assert step.declaration is not None
            alone = refit(diagnosis.fit, step.declaration)
            problem = alone.problem
            fitted = [
                (bound, bound.measured + error)
                for bound, error in zip(problem.bound_runs, alone.residuals, strict=True)
            ]
            others = [predict(alone.model, segment, problem.sigma) for segment in (*coarse.holdout, *coarse.test)]
            runs = [*fitted, *((prediction.bound, prediction.readings) for prediction in others)]
            for segment, (bound, readings) in zip(segments(self.study), runs, strict=True):
                lines[segment, name_of(step)] = _attempt(bound, readings, linearised=False)
        return lines

    # --- what there is to show ------------------------------------------------------------------

    @property
    def model(self) -> str:
        """What the model as it is now is called on the page: its effects, one after the other."""
        return names_of(self.study.steps)[-1] if self.study.steps else ""

    @property
    def _answers(self) -> tuple[Step, ...]:
        return self.study.diagnosed.steps if self.study.diagnosed else ()

    def predictions(self, number: int) -> dict[str, Prediction]:
        """What the model of a step predicts, by segment."""
        name = names_of(self.study.steps)[number]
        if name not in self._predictions:
            by_job = self.study.predictions(number)
            of_all = [prediction for job in JOBS for prediction in by_job[job]]
            self._predictions[name] = dict(zip(segments(self.study), of_all, strict=True))
        return self._predictions[name]

    def news(self) -> News:
        """The lines that were not sent yet."""
        news = News()
        if not self.study.steps:
            return news
        nodes = tuple(self.study.model.nodes)
        for number in {0, len(self.study.steps) - 1}:
            name = names_of(self.study.steps)[number]
            for segment, prediction in self.predictions(number).items():
                if (segment, "") not in self._sent:
                    news.runs[segment] = RunLines.of(prediction, nodes)
                if (segment, f"model {name}") not in self._sent:
                    news.predicted[segment, name] = prediction.readings
                self._sent |= {(segment, ""), (segment, f"model {name}")}
        news.attempts = self.tries()
        news.heat = self.heat.get(self.model, {})
        last = len(self.study.steps) - 1
        now = self.study.steps[last].fit.model
        news.networks = {key: NetworkCourse.of(now, predicted) for key, predicted in self.predictions(last).items()}
        return news


def segments(study: Study) -> dict[str, Segment]:
    """The study's segments by the names that the page has for them."""
    groups = zip(JOBS, (study.data.fit, study.data.holdout, study.data.test), strict=True)
    return {f"{job} {number}": segment for job, group in groups for number, segment in enumerate(group)}


def name_of(step: Step) -> str:
    """An effect with its place, empty for the model as given."""
    return key_of(step.key) if step.effect else ""


def key_of(key: Key) -> str:
    """What the page calls an effect at a place."""
    return f"{key[0]} at {key[1]}"


def _attempt(bound: BoundRun, readings: FloatArray, *, linearised: bool) -> Attempt:
    run = bound.run
    middles = run.time + (run.step / 2 if run.averaged else 0.0)  # a mean over a step is what was there in its middle
    error = Errors.of(np.where(bound.counted, readings - bound.measured, np.nan))
    return Attempt(middles, readings, linearised, error)


def names_of(steps: tuple[Step, ...]) -> list[str]:
    """What the models of steps are called: each after all effects that were added up to it."""
    return ["; ".join(filter(None, map(name_of, steps[: number + 1]))) or "as given" for number in range(len(steps))]


def _stretch(order: Cut) -> tuple[str, float, float]:
    return order.run, order.start, order.stop
