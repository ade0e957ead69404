"""A study: a model, the runs it is fitted to and tested on, and the history of the effects that were added.

The object to use in a notebook; the commands, the workbench and the report wrap it. A third of the file are docstrings
of what people call; the rest keeps track of steps, data and settings, each of which can be changed and taken back.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import replace
from functools import partial
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, overload

import pandas as pd

from lptn.basics.errors import InputError
from lptn.basics.files import write_whole
from lptn.basics.parameters import Setting
from lptn.basics.progress import shown_in_notebook
from lptn.basics.tables import rows_html
from lptn.diagnose.advice import Advice, advise
from lptn.diagnose.answers import Step
from lptn.diagnose.candidates import AMBIENT_ERROR, SURFACE_ERROR, TORQUE_ERROR
from lptn.diagnose.diagnosis import Diagnosis, diagnose, for_search
from lptn.diagnose.improvement import History, effects_added, improve, table_of_steps
from lptn.diagnose.refits import refit
from lptn.diagnose.unexplained_heat import UnexplainedHeat, unexplained_heat
from lptn.identify.comparison import Prediction, compare, predict, versus
from lptn.identify.data import (
    DataSplit,
    Log,
    Segment,
    Stretch,
    all_but,
    holdout_segment,
    load_model,
    refuse_repeated,
    split_data,
    warn_of_absent_runs,
    without_stretches,
)
from lptn.identify.fitting import Checkpoint, Fit, finished
from lptn.identify.noise import estimate_noise
from lptn.identify.validation import SymmetryTrial, fit_split
from lptn.logs.beside import refuse_doubtful, refuse_other_units
from lptn.logs.run import Run
from lptn.model.file import ModelFile, added
from lptn.model.model import Model
from lptn.report.results import StudyComparison, StudyForecast, StudyVersus
from lptn.simulate.bound_run import bind

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from lptn.fmu.exporter import Exported
    from lptn.online.operating_point import WindowChoice
    from lptn.report.network_drawing import Drawing
    from lptn.report.sentences import Narrative

logger = logging.getLogger(__name__)


Logs = Log | Run | Iterable[Log | Run]
"""One log, or several: paths, data frames, or runs that were read before."""


class Study:
    """A model, its data, and the history of steps.

    A notebook shows what a long search is doing; elsewhere it is logged: `logging.basicConfig(level="INFO")`.

    Example:
        >>> import lptn, pandas
        >>> frame = pandas.read_csv("examples/tclab/log.csv")  # a path does as well
        >>> study = lptn.Study("examples/tclab/two_heaters.toml", fit=[frame], holdout_after=300)
        >>> study.fit()
        <Fit: converged, 3 free parameters, RMSE 0.655 K>
        >>> study.compare()
        <StudyComparison: 1 run, RMSE 4.72 K, largest error 9.94 K, mean +3.92 K>
        >>> axes = study.compare().plot()
        >>> study.diagnose()
        <Diagnosis: missing: RMSE 0.655 K fitted, 4.72 K held out;
        sensor_lag at *, constant_heat at *, natural_convection at *>
        >>> study.add("sensor_lag", at="*")
        <Step: sensor_lag at *, 4 parameters, RMSE 0.504 K fitted, 3.88 K held out>
        >>> study.add("conduction", at="heater1~heater2")
        <Step: conduction at heater1~heater2, 5 parameters, RMSE 0.405 K fitted, 0.999 K held out>
        >>> study.history[["effect", "place", "parameters"]]
               effect            place  parameters
        0                                        3
        1  sensor_lag                *           4
        2  conduction  heater1~heater2           5
        >>> study.undo()
        <Study of two heaters: runs: 1 fitted, 1 held out; effects added: 1>
        >>> study.save("better.toml"); study.report("story.html")

    Args:
        model: the path of a model file.
        fit: logs whose runs parameters are fitted to, and missing effects sought in.
        holdout: logs that no fit sees; they tell apart what the fitted runs can't, and end the selection.
        test: logs looked at once, in the report, when all is decided.
        holdout_after: time [s, in each log's clock] from which the logs to fit are held out themselves; `"+300"` for
            300 s after each log's start.
        columns: other people's column names, such as `"temperature.FR_calf=T3[degF]"`; `"guess"` to have them guessed.
        ambient_error: how far the ambient sensor may be off in each run [K], one standard deviation; 0.3 by default.
        torque_error: how far each joint's torque or current may be off in each run, as a share, one standard deviation;
            0.015 by default.
        surface_error: how far each surface's loss to the air may be off in each run, as a share, one standard
            deviation; 0.03 by default.
        executor: where refits run; here, one after the other, by default.

    Raises:
        InputError: a file can't be used, a log stands in two places, or lacks a column that the model needs.
    """

    def __init__(
        self,
        model: str | Path,
        fit: Logs = (),
        holdout: Logs = (),
        test: Logs = (),
        *,
        holdout_after: float | str | None = None,
        columns: Sequence[str] = (),
        ambient_error: float | None = None,
        torque_error: float | None = None,
        surface_error: float | None = None,
        executor: Executor | None = None,
    ) -> None:
        self._loaded = load_model(model, columns)
        self._logs: dict[str, str | Path] = {}  # the file of each run, by the run's source
        self.ambient_error = AMBIENT_ERROR if ambient_error is None else ambient_error
        self.torque_error = TORQUE_ERROR if torque_error is None else torque_error
        self.surface_error = SURFACE_ERROR if surface_error is None else surface_error
        self.executor = executor
        groups = {name: self._read(name, logs) for name, logs in (("fit", fit), ("holdout", holdout), ("test", test))}
        refuse_repeated(groups)
        refuse_other_units([run for runs in groups.values() for run in runs])
        self._given = split_data(groups["fit"], groups["holdout"], groups["test"], holdout_after)
        self.data: DataSplit = self._given
        """The segments of the runs that are fitted, held out, and kept for the test."""
        self.stretches: tuple[Stretch, ...] = ()
        """What was left out or held out of the runs as they were read."""
        self.settings: tuple[Setting, ...] = ()
        """What was set of parameters, the latest last."""
        self._steps: list[Step] = []
        self._undone: list[Step] = []
        self._attempts: list[tuple[object, Step, Step]] = []  # the effect, the step before it, and the step with it
        self.branches: tuple[tuple[Step, ...], ...] = ()
        """Other ways that were gone from the model as given, and left by `undo` and another `add`; the latest last."""
        self._diagnoses: dict[Step | None, Diagnosis] = {}  # of each step; `None`: of the model without added effects
        self._searched: tuple[Step, int, History] | None = (
            None  # the last search: its last step, its first one's number
        )
        self._advice: tuple[Diagnosis, Advice] | None = None  # the last one, and what it follows from
        self.symmetry_trials: tuple[SymmetryTrial, ...] = ()
        """The symmetry penalties that the last fit tried, with their errors on held-out runs."""
        warn_of_absent_runs(self._loaded.model.network, self.runs)

    # --- what there is ------------------------------------------------------------------------

    @property
    def runs(self) -> list[Run]:
        """All runs, each once: fitted ones, held-out ones, those for the test."""
        return list({id(segment.run): segment.run for segment in self.data.segments}.values())

    @property
    def shown(self) -> Sequence[Segment]:
        """The segments that `compare` predicts: held-out ones, or the fitted runs where none is held out.

        Raises:
            InputError: there is no run.
        """
        segments = self.data.holdout or tuple(holdout_segment(segment.run) for segment in self.data.fit)
        if not segments:
            raise InputError("study", "fit, holdout", "no run", "one log or more")
        return segments

    @property
    def model(self) -> Model:
        """The model as it is now: fitted if it was, else as the file gives it."""
        return self._steps[-1].fit.model if self._steps else self._loaded.model

    @property
    def _added(self) -> Step | None:
        """The last step that added an effect."""
        return self._steps[-1] if len(self._steps) > 1 else None

    @property
    def _search(self) -> tuple[int, History] | tuple[None, None]:
        """The last search, and the number of the step that it began with; none where the model is another by now."""
        if self._searched is None or self._steps[-1:] != [self._searched[0]]:
            return None, None
        return self._searched[1:]

    @property
    def _fitted(self) -> bool:
        return bool(self._steps) or self._loaded.file.fit.rmse is not None or not self.model.free

    @property
    def file(self) -> ModelFile:
        """The model file as it is now, with the effects that were added and the fitted values."""
        if not self._steps:
            return self._loaded.file
        return self._loaded.file.with_effects(effects_added(self._steps)).with_fit(self._steps[-1].fit.table())

    @property
    def steps(self) -> tuple[Step, ...]:
        """The models so far: as given and fitted, then one for each effect that was added; empty before any fit."""
        return tuple(self._steps)

    @property
    def history(self) -> pd.DataFrame:
        """A row for each step: effect, place, free parameters, errors [K] on fitted, held-out and test data."""
        return table_of_steps(self._steps)

    @property
    def undone(self) -> tuple[Step, ...]:
        """The steps that `redo` would add again, the next one first."""
        return tuple(reversed(self._undone))

    @property
    def diagnosed(self) -> Diagnosis | None:
        """What `diagnose` said of the model as it is now; `None` where it was not asked yet."""
        return self._diagnoses.get(self._added)

    @property
    def advised(self) -> Advice | None:
        """What `advise` said of the model as it is now; `None` where it was not asked yet."""
        return self._advice[1] if self._advice and self._advice[0] is self.diagnosed else None

    def __repr__(self) -> str:
        data = (("fitted", self.data.fit), ("held out", self.data.holdout), ("test", self.data.test))
        runs = ", ".join(f"{len(segments)} {job}" for job, segments in data if segments) or "none"
        return f"<Study of {self.model.network.name}: runs: {runs}; effects added: {max(len(self._steps) - 1, 0)}>"

    def _repr_html_(self) -> str:
        from lptn.report.narrative import narrative

        said = narrative(self._steps, self.diagnosed, self.advised) if self._steps else self.check()
        return f"<p>{escape(repr(self))}</p>\n{said._repr_html_()}{rows_html(self.history) if self._steps else ''}"

    # --- what to do ---------------------------------------------------------------------------

    def check(self) -> Narrative:
        """Say whether the logs can be used, what the model needs, what they hold and which effects they could show."""
        from lptn.report.narrative import logs_narrative

        return logs_narrative(self.model, self.runs)

    def fit(
        self,
        *,
        symmetry_penalty: float | Literal["auto"] = 0.0,
        checkpoint: Callable[[float], Checkpoint] | None = None,
    ) -> Fit:
        """Fit the model as it is now to the runs that are there to fit.

        Args:
            symmetry_penalty: λ of the pull of left and right parameters towards each other; `"auto"` for the one best
                on held-out runs.
            checkpoint: where the search keeps its best point, for the λ that it uses; by default nowhere.

        Returns:
            The fitted model, with standard errors and warnings.

        Raises:
            InputError: there is nothing to fit, or λ can't be chosen from these runs.
        """
        self._needs_fit_data()
        with shown_in_notebook("fitting"):
            done, trials = fit_split(self.model, self.data, symmetry_penalty, checkpoint=checkpoint, report=logger.info)
        self.symmetry_trials = tuple(trials)
        self._steps.append((replace(self._steps.pop(), fit=done) if self._steps else Step(done)).judged_on(self.data))
        return done

    @overload
    def compare(self, against: None = None) -> StudyComparison: ...

    @overload
    def compare(self, against: Study) -> StudyVersus: ...

    def compare(self, against: Study | None = None) -> StudyComparison | StudyVersus:
        """Predict the held-out runs, or the fitted ones where none is held out, and set them against what was measured.

        Args:
            against: another study of the same runs, to compare two models.

        Raises:
            InputError: there is no run, or one lacks an input of the model.
        """
        if against is not None:
            both = versus(self.model, against.model, self.shown, against.shown)
            return StudyVersus(replace(both.model, fitted=self._fitted), replace(both.other, fitted=against._fitted))
        compared = compare(self.model, self.shown)
        as_given = partial(compare, self._steps[0].fit.model, self.shown) if len(self._steps) > 1 else None
        return StudyComparison(compared.model, compared.predictions, compared.noise, self._fitted, as_given)

    def forecast(
        self,
        limits: float | Mapping[str, float],
        cycles: int = 10,
        coverage: float = 0.9,
        *,
        window: WindowChoice = "steady",
    ) -> StudyForecast:
        """When each node reaches its limit if the robot goes on as it does at the end of the last run.

        Arguments and errors are those of `lptn.forecast`. The errors of the model are those that its fit knows, and the
        gait is that of the log at its own rate.
        """
        from lptn.online.forecasting import forecast
        from lptn.online.operating_point import gait_of
        from lptn.online.present import ModelUncertainty

        if not self.runs:
            raise InputError("study", "fit, holdout, test", "no run", "one log or more")
        run = self.runs[-1]
        noise = estimate_noise([bind(self.model, run)], self.model.nodes)
        known = ModelUncertainty.of_table(self.model, self.file.fit, noise.floor)
        log = self._logs.get(run.source)
        gait = None if log is None else gait_of(self._loaded, log)
        ahead = forecast(self.model, run, limits, cycles, coverage, known, window=window, gait=gait)
        return StudyForecast(ahead)

    def predictions(self, step: int | Step = -1) -> dict[str, list[Prediction]]:
        """What the model of a step predicts on every run: fitted ones as the fit leaves them, others freely.

        Args:
            step: its number in `steps`, or an attempt; the last step by default.

        Returns:
            Predictions by the jobs of their runs, `"fit"`, `"holdout"` and `"test"`.

        Raises:
            InputError: nothing was fitted yet.
        """
        if not self._steps:
            raise InputError("study", "predictions", "no fitted model", "fit() before")
        fit = (self._steps[step] if isinstance(step, int) else step).fit
        others = {"holdout": self.data.holdout, "test": self.data.test}
        return {"fit": fit.predictions} | {
            job: [predict(fit.model, segment) for segment in segments] for job, segments in others.items()
        }

    def unexplained_heat(self) -> list[UnexplainedHeat]:
        """The heat that each fitted run asks for beyond the model as it is now, in the steps of a search."""
        return unexplained_heat(self.diagnose().fit)

    def diagnose(self) -> Diagnosis:
        """Say which effect of the catalogue is missing, where, how sure, and what else would look the same.

        Raises:
            InputError: there is nothing to fit, or a channel of what is fitted may be in another unit.
        """
        self._needs_conclusive_data()
        return self._diagnosis_of(self._added)

    def advise(self) -> Advice:
        """What to do next: the experiment that tells rivals apart, where heat is unexplained, runs that differ."""
        last = self.diagnose()
        if self._advice is None or self._advice[0] is not last:
            _, history = self._search
            first = history.first if history else last  # the candidates of the search
            with shown_in_notebook("looking for the next experiment"):
                self._advice = last, advise(first, last, for_search(self.data), logger.info)
        return self._advice[1]

    def add(
        self, effect: str | Step, at: str = "", *, run: str = "", settings: Mapping[str, str | float] | None = None
    ) -> Step:
        """Add an effect to the model and refit, one step further.

        Args:
            effect: its key, such as `"forced_convection"`, or an answer of `diagnose`, which knows its place, or the
                step of the curve that `advise` has learned.
            at: a node, an edge `"a~b"`, a pattern `"*_calf"`, or `"*"`.
            run: the only run in which it acts; all by default.
            settings: words for its options and values of its parameters, in SI units; the effect's own by default.

        Raises:
            InputError: there is no such effect, it can't stand there, or there is nothing to fit.
        """
        step = self.attempt(effect, at, run=run, settings=settings)
        self._leave()
        self._steps.append(step)
        return step

    def attempt(
        self, effect: str | Step, at: str = "", *, run: str = "", settings: Mapping[str, str | float] | None = None
    ) -> Step:
        """Fit the step that `add` would take, and do not take it: `add` then takes this one, without another fit.

        Arguments and errors are those of `add`.
        """
        if not self._steps:
            self.fit()
        last, asked = self._steps[-1], (effect, at, run, dict(settings or {}))
        for earlier, before, done in self._attempts:
            if before is last and earlier == asked:
                return done
        if isinstance(effect, str):
            step = Step(last.fit, added(self.file, effect, at, run, settings).network.effects[-1])
        else:
            step = effect
        if step.declaration is None:
            raise InputError("study", "add", "the model as given", "an effect's key, or an answer of diagnose()")
        with shown_in_notebook(f"fitting {step.effect} at {step.at}"):
            logger.info("fitting %s at %s", step.effect, step.at)
            fitted = finished(refit(last.fit, step.declaration))
        done = replace(step, fit=fitted).judged_on(self.data)
        # Among other answers a size may be sure that is not so alone.
        done = replace(done, probability=min(done.probability, done.told_from_none))
        self._attempts.append((asked, last, done))
        return done

    @property
    def attempts(self) -> tuple[Step, ...]:
        """What `attempt` fitted beside the model as it is now."""
        return tuple(done for _, before, done in self._attempts if self._steps and before is self._steps[-1])

    def undo(self) -> Study:
        """Take the last added effect back."""
        if len(self._steps) > 1:
            self._undone.append(self._steps.pop())
        return self

    def redo(self) -> Study:
        """Add again what was last taken back."""
        if self._undone:
            self._steps.append(self._undone.pop())
        return self

    def go_back(self, number: int = -1) -> Study:
        """Go on from a way that was left; the present one is kept among `branches` in its place.

        Args:
            number: of the way in `branches`; the one left last by default.

        Raises:
            InputError: no way has that number.
        """
        if not -len(self.branches) <= number < len(self.branches):
            raise InputError("study", "branch", f"{number}", f"one of {len(self.branches)} that were left")
        chosen, left = self.branches[number], (*self._steps, *self.undone)
        others = [branch for branch in self.branches if branch is not chosen]
        gone_on = left == chosen[: len(left)]
        self.branches = tuple(others if gone_on else [*others, left])
        self._steps = list(chosen)
        self._undone.clear()
        return self

    def improve(self, most: int = 6, on_step: Callable[[tuple[Step, ...]], None] = lambda _: None) -> Study:
        """Find what is missing, add it and refit: what is wrong with one part or run, then what every part has.

        Args:
            most: how many findings to add at most, beside what all parts have in common.
            on_step: called after each step with the best steps so far, the model as it is now first.

        Raises:
            InputError: there is nothing to fit, or a channel of what is fitted may be in another unit.
        """
        self._needs_conclusive_data()
        with shown_in_notebook("searching for missing effects"):
            history = improve(self._searched_from(self._added), self.data, most=most, on_step=on_step, **self._options)
        self._leave()
        self._steps = self._steps or [history.steps[0]]
        before = len(self._steps) - 1
        self._diagnoses[self._added] = history.first
        self._steps += history.steps[1:]
        self._diagnoses[self._added] = history.last
        self._searched = self._steps[-1], before, history
        return self

    def leave_out(self, run: str, start: float, stop: float) -> Study:
        """Leave a stretch out: it is neither fitted nor predicted, as if the log had a gap there; then fit again.

        Args:
            run: name of a run as it was read, or of a piece of it.
            start: s, in the log's clock.
            stop: s.

        Raises:
            InputError: no such run, or nothing would be left to fit.
        """
        return self._use(*self.stretches, Stretch(self._as_read(run), start, stop))

    def hold_out(self, run: str, start: float, stop: float) -> Study:
        """Hold a stretch of a fitted run out, so that it tests the model in place of shaping it; then fit again.

        Arguments and errors are those of `leave_out`.
        """
        return self._use(*self.stretches, Stretch(self._as_read(run), start, stop, held_out=True))

    def fit_on(self, run: str, start: float, stop: float) -> Study:
        """Fit a stretch of a fitted run alone, and hold out all else that was fitted; what was left out stays so.

        Arguments and errors are those of `leave_out`.
        """
        left_out = [stretch for stretch in self.stretches if not stretch.held_out]
        return self._use(*all_but(self._given, Stretch(self._as_read(run), start, stop), left_out))

    def use_again(self, stretch: Stretch | None = None) -> Study:
        """Take back that a stretch was left out or held out, and fit again.

        Args:
            stretch: one of `stretches`; all by default.
        """
        return self._use(*(other for other in self.stretches if stretch is not None and other != stretch))

    def set_parameter(
        self,
        name: str,
        value: float | None = None,
        *,
        bounds: tuple[float, float] | None = None,
        fixed: bool | None = None,
    ) -> Study:
        """Change what is known of a parameter beforehand; then fit all steps again, if there are any.

        Args:
            name: of the parameter, such as `"resistance.FR_hip~ambient"`, at its place or group of places.
            value: in its SI unit; where a free parameter's search starts, or what a fixed one is.
            bounds: least and largest possible value; for all places that its declaration is for.
            fixed: `True` keeps fits away from it, `False` frees it; for all these places.

        Raises:
            InputError: no such parameter, or a value outside its bounds.

        Example:
            >>> import lptn
            >>> study = lptn.Study("examples/tclab/two_heaters.toml", fit="examples/tclab/log.csv", holdout_after=300)
            >>> study.set_parameter("capacity.heater*", 4.0, fixed=True).fit()
            <Fit: converged, 2 free parameters, RMSE 0.805 K>
        """
        setting = Setting(name, value, bounds, fixed)
        added = list(self._steps[1:])
        if name in (parameter.name for parameter in self._loaded.model.parameters):
            file = self._loaded.file.with_setting(setting)
            loaded = replace(self._loaded, file=file, model=Model(file.network))
        else:
            own = [
                (k, parameter.declared.name)
                for k, step in enumerate(added)
                for parameter in step.fit.model.parameters
                if step.declaration and parameter.effect == step.declaration.name and parameter.name == name
            ]
            if not own:
                names = ", ".join(parameter.name for parameter in self.model.parameters)
                raise InputError("parameter", name, "no such parameter", f"one of {names}")
            number, key = own[0]
            loaded, added[number] = self._loaded, added[number].with_setting(key, setting)
        self._loaded, self.settings = loaded, (*self.settings, setting)
        return self._fit_again(added)

    # --- what to take away --------------------------------------------------------------------

    def save(self, path: str | Path) -> None:
        """Write the model file as it is now, whole or not at all."""
        self.file.write(Path(path))

    def selection(self) -> History:
        """The steps with the verdicts on the first and on the last of them, as the report and other programs read them.

        Raises:
            InputError: there is nothing to fit.
        """
        before, history = self._search
        if history and before == 0:
            return history
        if not self._steps:
            self.fit()
        last = self.diagnose()
        first = self._diagnosis_of(None)
        return History(tuple(self._steps), first, last)

    def narrative(self) -> Narrative:
        """Verdict, findings, structure, errors and what to do next, in the sentences of terminal, page and report."""
        from lptn.report.narrative import narrative

        history = self.selection()
        return narrative(history.steps, history.last, self.advise())

    def plot_history(self, ax: Axes | None = None) -> Axes:
        """Draw the RMSE [K] of each step on fitted, held-out and test data, above what sensor noise alone would leave.

        Args:
            ax: where to draw; a new figure of pyplot's by default.

        Raises:
            InputError: nothing was fitted yet.
        """
        from lptn.report.diagnosis_figures import plot_history

        if not self._steps:
            raise InputError("study", "history", "no fitted model", "fit() before")
        return plot_history(self._steps, ax)

    def draw_network(self) -> Drawing:
        """Draw the network, with temperatures and heat flows when a node of the held-out or fitted runs is hottest.

        Returns:
            SVG, which a notebook shows; without a run, of the network alone.
        """
        from lptn.report.network_drawing import draw_network, hottest_moment

        return hottest_moment(self.compare())[0] if self.runs else draw_network(self.model)

    def report(self, path: str | Path, commands: Sequence[str] = ()) -> None:
        """Write the whole story as one HTML file: data, fit, where it fails, what is missing, held-out errors.

        Args:
            path: of the file, written whole or not at all.
            commands: what was typed, shown at the end of the page.
        """
        from lptn.report.pages import story_html

        page = story_html(self.selection(), self.data, self.model.network.name, commands, self.advise())
        write_whole(Path(path), page)

    def export_fmu(self, path: str | Path, **options: Any) -> Exported:
        """Write the model as it is now as an FMU; `options` as for `lptn.fmu.export`."""
        from lptn.fmu.exporter import export

        return export(self.file, path, **options)

    # --- inside -------------------------------------------------------------------------------

    def _read(self, name: str, logs: Logs) -> list[Run]:
        """The runs of logs, and those that were read before as they are."""
        several = [logs] if isinstance(logs, str | Path | pd.DataFrame | Run) else list(logs)
        runs: list[Run] = []
        for number, log in enumerate(several, start=1):
            read = [log] if isinstance(log, Run) else self._loaded.runs([log], named=f"{name}{number}")
            if isinstance(log, str | Path):
                self._logs |= {run.source: log for run in read}
            runs += read
        return runs

    def _as_read(self, run: str) -> str:
        """The name of the run that a piece was cut from."""
        names = (segment.run.name for segment in self._given.segments)
        return next((name for name in names if run == name or run.startswith(f"{name}#")), run)

    def _use(self, *stretches: Stretch) -> Study:
        """Fit all steps again, on the data without these stretches."""
        data = without_stretches(self._given, stretches)
        self.stretches, self.data = stretches, data
        return self._fit_again(self._steps[1:])

    def _fit_again(self, added: Sequence[Step]) -> Study:
        """Fit the model as given and all steps again, since the data or what is given are others now."""
        fitted = bool(self._steps)
        self.branches = ()
        for outdated in (self._steps, self._undone, self._attempts, self._diagnoses):
            outdated.clear()
        if fitted:
            self.fit()
        for step in added:
            self.add(replace(step, probability=0.0, indistinguishable=()))  # said of other data
        return self

    def _needs_fit_data(self) -> None:
        if not self.data.fit:
            raise InputError("study", "fit", "no run", "one log or more to fit")

    def _needs_conclusive_data(self) -> None:
        self._needs_fit_data()
        refuse_doubtful([segment.run for segment in self.data.fit])
        for run, names in self.data.lacking().items():
            what = f"{names[0]} and {len(names) - 1} others" if len(names) > 2 else " and ".join(names)
            logger.warning(f"{run} lacks {what}, which other runs have: effects that need them are not tested")

    def _leave(self) -> None:
        """Keep what was undone as a branch, where the study goes another way now."""
        if self._undone:
            self.branches = (*self.branches, (*self._steps, *self.undone))
            self._undone.clear()

    @property
    def _options(self) -> dict[str, Any]:
        """Of a search."""
        errors = {name: getattr(self, name) for name in ("ambient_error", "torque_error", "surface_error")}
        return errors | {"executor": self.executor, "report": logger.info}

    def _searched_from(self, step: Step | None) -> Model:
        """What a search begins with: without added effects the file's own values, whether or not they were fitted."""
        return step.fit.model if step else self._loaded.model

    def _diagnosis_of(self, step: Step | None) -> Diagnosis:
        """What is missing in a step's model; sought once."""
        if step not in self._diagnoses:
            with shown_in_notebook("searching for missing effects"):
                self._diagnoses[step] = diagnose(self._searched_from(step), self.data, **self._options)
        return self._diagnoses[step]
