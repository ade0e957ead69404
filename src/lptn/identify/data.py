"""From files to data: a model file with its logs; which segments of which runs are fitted, held out, or test."""

from __future__ import annotations

import logging
import math
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd

from lptn.basics.arrays import FloatArray
from lptn.basics.bounds import LOGS
from lptn.basics.errors import InputError
from lptn.basics.places import is_of_run
from lptn.effects import catalogue
from lptn.logs.clock import stretch_in_words
from lptn.logs.columns import START, ColumnSource, column_unit, parse_map_option, quantity_of, to_si
from lptn.logs.joining import SECOND_TIME
from lptn.logs.plausible import PLAUSIBLE
from lptn.logs.reading import GUESSED, doubtful, read_log, run_name
from lptn.logs.repeated import repeated_stretch
from lptn.logs.resampling import raw_keys, sample_values
from lptn.logs.run import Run
from lptn.model.file import ModelFile, read_model_file
from lptn.model.heat_balance import input_column
from lptn.model.model import Model
from lptn.model.network import Network
from lptn.simulate.bound_run import needed_columns, resting_temperature

# --- Which segments of which runs are fitted, held out, or test -------------------------------------


Window = tuple[float, float]
"""From, to (exclusive) [s], in a log's clock."""

EVERYTHING: Window = (float("-inf"), float("inf"))
# The first tenth of a held-out run finds its initial temperatures: at least a minute, and ten readings.
_INITIALISATION_SHARE, _LEAST_INITIALISATION, _LEAST_INITIALISATION_STEPS = 0.1, 60.0, 10  # s for the second
_LEAST_STEPS_KEPT, _OF_A_PIECE = 300, 10  # steps that a coarsened log keeps at least, and each piece of it


@dataclass(frozen=True)
class Segment:
    """A run with the window that finds its initial temperatures and the window in which errors count.

    A model's prediction needs a start. On runs that the fit never saw it comes from the initialisation window, and
    only what lies behind that window is counted as predicted. A fitted run is both throughout.
    """

    run: Run
    initialisation: Window
    evaluation: Window

    def coarsened(self, step: float, length_of_log: int = 0) -> Segment:
        """The same segment in steps of about `step` seconds, where the run is long enough to spare them.

        Args:
            step: s.
            length_of_log: in steps, of all pieces of the log together, where the run is one of them.
        """
        long_enough = max(len(self.run), length_of_log) // _LEAST_STEPS_KEPT
        factor = min(round(step / self.run.step), long_enough, max(1, len(self.run) // _OF_A_PIECE))
        return self if factor < 2 else replace(self, run=self.run.coarsen(factor))


@dataclass(frozen=True)
class DataSplit:
    """Three sets of data with three jobs.

    Args:
        fit: parameters are fitted, and missing effects chosen, on these.
        holdout: choose among models that the fit data can't tell apart, and end the forward selection.
        test: looked at once, when all is decided.
    """

    fit: tuple[Segment, ...]
    holdout: tuple[Segment, ...] = ()
    test: tuple[Segment, ...] = ()

    @property
    def segments(self) -> tuple[Segment, ...]:
        """All of them: fitted, held out, for the test."""
        return (*self.fit, *self.holdout, *self.test)

    @property
    def by_job(self) -> dict[str, tuple[Segment, ...]]:
        """The segments by what they are for: `"fit"`, `"holdout"`, `"test"`."""
        return {"fit": self.fit, "holdout": self.holdout, "test": self.test}

    def coarsened(self, step: float) -> DataSplit:
        """All segments in steps of about `step` seconds."""

        def coarsened(group: tuple[Segment, ...]) -> tuple[Segment, ...]:
            # Between its gaps a log is as long as it is: its pieces spare what all of it can.
            lengths = Counter[tuple[str, str]]()
            for segment in group:
                lengths[_log_of(segment.run)] += len(segment.run)
            return tuple(segment.coarsened(step, lengths[_log_of(segment.run)]) for segment in group)

        return DataSplit(*map(coarsened, (self.fit, self.holdout, self.test)))

    def lacking(self) -> dict[str, list[str]]:
        """The inputs that a run lacks and others have, by the run's name; temperatures are no inputs."""
        runs = [segment.run for segment in self.segments]
        inputs = dict.fromkeys(name for run in runs for name in run.columns if not name.startswith("temperature."))
        by_run = {run.name: [name for name in inputs if name not in run.columns] for run in runs}
        return {run: names for run, names in by_run.items() if names}

    def of_common_inputs(self) -> DataSplit:
        """The same without inputs that a run lacks: what acts through them could not be predicted for all runs."""
        absent = {name for names in self.lacking().values() for name in names}

        def common(segment: Segment) -> Segment:
            columns = {name: values for name, values in segment.run.columns.items() if name not in absent}
            return replace(segment, run=replace(segment.run, columns=columns))

        groups = (self.fit, self.holdout, self.test)
        return DataSplit(*(tuple(map(common, group)) for group in groups)) if absent else self


def _log_of(run: Run) -> tuple[str, str]:
    return run.source, run.fingerprint


def refuse_repeated(groups: Mapping[str, Sequence[Run]]) -> None:
    """A log that is fitted twice counts double; one that is fitted and held out proves nothing.

    Raises:
        InputError: the same data stand in two places.
    """
    places: dict[tuple[str, float], tuple[str, str]] = {}
    for job, runs in groups.items():
        for run in runs:
            data = run.fingerprint, float(run.time[0])  # pieces of one log begin at times of their own
            if data in places:
                before, where = places[data]
                same = f"the same data as {before} ({where})"
                raise InputError(run.source, job, same, "each log once: to fit, to hold out, or for the test")
            places[data] = run.source, job
    jobs = [(job, run) for job, runs in groups.items() for run in runs]
    for number, (job, run) in enumerate(jobs):
        for before, earlier in jobs[:number]:
            if run.source != earlier.source and (stretch := repeated_stretch(earlier, run)) is not None:
                when = stretch_in_words(*stretch, run.origin)
                same = f"the same readings as {earlier.source} ({before}), {when}"
                raise InputError(run.source, job, same, "each stretch once: to fit, to hold out, or for the test")


def split_data(
    runs: Sequence[Run],
    holdout: Sequence[Run] = (),
    test: Sequence[Run] = (),
    holdout_after: float | str | None = None,
) -> DataSplit:
    """Arrange runs by their jobs.

    Args:
        runs: to fit.
        holdout: runs held out whole.
        test: runs looked at once, at the end.
        holdout_after: time [s, in each log's clock] from which the fitted runs themselves are held out; `"+300"` for
            300 s after each log's start, which all pieces of a split log share.

    Raises:
        InputError: `holdout_after` leaves nothing to fit, or nothing to hold out.

    Example:
        >>> import lptn
        >>> loaded = lptn.load_model("examples/tclab/two_heaters.toml")
        >>> data = lptn.split_data(loaded.runs(["examples/tclab/log.csv"]), holdout_after=300)
        >>> [segment.evaluation for segment in data.holdout]
        [(300, inf)]
    """
    later = tuple(holdout_segment(run) for run in holdout)
    at_the_end = tuple(holdout_segment(run) for run in test)
    if holdout_after is None:
        return DataSplit(tuple(Segment(run, EVERYTHING, EVERYTHING) for run in runs), later, at_the_end)
    borders = _borders(runs, holdout_after)
    fitted = [(run, at) for run, at in borders if (run.time < at).sum() >= _LEAST_INITIALISATION_STEPS]
    continued = [(run, at) for run, at in fitted if (run.time >= at).sum() >= _LEAST_INITIALISATION_STEPS]
    if not fitted or not continued:
        span = (
            f"{min(run.time[0] for run in runs):.10g} to {max(run.time[-1] for run in runs):.10g} s"  # since 1970, too
        )
        expected = "a time inside a log"
        if not isinstance(holdout_after, str):
            expected += "; with a plus, such as +300, so many seconds after each log's start"
        written = holdout_after if isinstance(holdout_after, str) else f"{holdout_after:g}"
        raise InputError("--holdout-after", f"{written} s", f"logs from {span}", expected)
    first = tuple(Segment(run, (-math.inf, at), (-math.inf, at)) for run, at in fitted)
    rest = tuple(Segment(run, (-math.inf, at), (at, math.inf)) for run, at in continued)
    return DataSplit(first, (*rest, *later), at_the_end)


def _borders(runs: Sequence[Run], holdout_after: float | str) -> list[tuple[Run, float]]:
    """Each run with the time, s of its clock, from which it is held out."""
    if not isinstance(holdout_after, str):
        return [(run, holdout_after) for run in runs]
    try:
        seconds = float(holdout_after)
    except ValueError:
        seconds = math.nan
    if not (holdout_after.startswith("+") and math.isfinite(seconds)):
        expected = 'a time in s, or with a plus the seconds after each log\'s start, such as "+300"'
        raise InputError("--holdout-after", "its value", f"'{holdout_after}'", expected)
    start: dict[str, float] = {}
    for run in runs:
        start[run.fingerprint] = min(start.get(run.fingerprint, math.inf), float(run.time[0]))
    return [(run, start[run.fingerprint] + seconds) for run in runs]


def holdout_segment(run: Run) -> Segment:
    """A run to be predicted: its first tenth finds the start, the rest is evaluated."""
    length = max(
        _INITIALISATION_SHARE * len(run) * run.step, _LEAST_INITIALISATION, _LEAST_INITIALISATION_STEPS * run.step
    )
    most_initialisation_share = 0.5  # a short run can't spare more
    border = run.time[0] + min(length, most_initialisation_share * len(run) * run.step)
    return Segment(run, (float("-inf"), border), (border, float("inf")))


# --- Stretches that somebody looked at and does not want to fit: a door stood open, or the fit is to be tried there ---


@dataclass(frozen=True)
class Stretch:
    """A stretch of a run that is not fitted.

    Args:
        run: name of the run, as it was read.
        start: s, in the log's clock.
        stop: s; the stretch ends before it.
        held_out: it is held out; else it is left out wholly.
    """

    run: str
    start: float
    stop: float
    held_out: bool = False


def without_stretches(data: DataSplit, stretches: Sequence[Stretch]) -> DataSplit:
    """The data without stretches of their runs; those that are to be held out stand among the held-out data.

    A run is cut there as it is at a gap: the pieces, `monday#1` and `monday#2`, each have a start of their own, since
    what went on in a stretch that was left out is not known.

    Args:
        data: the runs as they were given.
        stretches: in any order; what two have in common is left out or held out once.

    Raises:
        InputError: a stretch is in no run or too short to be held out, or nothing is left to fit.
    """
    runs = dict.fromkeys(segment.run.name for segment in (*data.fit, *data.holdout, *data.test))
    for stretch in stretches:
        if stretch.run not in runs:
            raise InputError("stretch", stretch.run, "no such run", f"one of {_listed(list(runs))}")
    pieces: dict[tuple[int, float, float], Run] = {}  # fitted and held-out segments of one run share its pieces
    fit = [piece for segment in data.fit for piece in _outside(segment, stretches, pieces)]
    held = [_inside(data, stretch, pieces) for stretch in stretches if stretch.held_out]
    holdout = [piece for segment in data.holdout for piece in _outside(segment, stretches, pieces)]
    test = [piece for segment in data.test for piece in _outside(segment, stretches, pieces)]
    if data.fit and not fit:
        raise InputError("stretch", stretches[-1].run, "nothing is left to fit", "a shorter stretch")
    return DataSplit(tuple(fit), (*holdout, *held), tuple(test))


def all_but(data: DataSplit, stretch: Stretch, left_out: Sequence[Stretch] = ()) -> tuple[Stretch, ...]:
    """What has to be held out for a stretch to be fitted alone: all else that is fitted.

    Args:
        data: the runs as they were given.
        stretch: what is to be fitted.
        left_out: stretches that stay left out; so do pieces that are too short to be held out.

    Raises:
        InputError: the stretch is too short, or in no run that is fitted.
    """
    kept = (*left_out, stretch)
    held: list[Stretch] = []
    steps = 0
    for segment in data.fit:
        run, (first, last) = segment.run, segment.evaluation
        begin, end = max(float(run.time[0]), first), min(float(run.time[-1] + run.step), last)
        own = sorted((span for span in kept if span.run == run.name), key=lambda span: span.start)
        steps += _steps_in(run, (max(stretch.start, begin), min(stretch.stop, end))) if stretch in own else 0
        for span in [*own, Stretch(run.name, end, end)]:
            if span.start > begin:
                enough = _steps_in(run, (begin, span.start)) >= _LEAST_PIECE
                held.append(Stretch(run.name, begin, min(span.start, end), held_out=enough))
            begin = max(begin, span.stop)
    if steps < _LEAST_PIECE:
        interval = f"{stretch.start:.10g} to {stretch.stop:.10g} s"
        raise InputError(stretch.run, "stretch to fit", interval, f"{_LEAST_PIECE} fitted steps or more")
    return (*left_out, *held)


Pieces = dict[tuple[int, float, float], Run]


def _outside(segment: Segment, stretches: Sequence[Stretch], pieces: Pieces) -> list[Segment]:
    """The pieces of a segment outside the stretches of its run."""
    run = segment.run
    own = sorted((stretch for stretch in stretches if stretch.run == run.name), key=lambda stretch: stretch.start)
    if not own:
        return [segment]
    rest, begin, end = [], float(run.time[0]), float(run.time[-1] + run.step)
    for number, stretch in enumerate([*own, Stretch(run.name, end, end)], start=1):
        piece = _piece(run, begin, min(stretch.start, end), f"#{number}", pieces)
        begin = max(begin, stretch.stop)
        if piece is not None and _steps_in(piece, segment.evaluation) >= _LEAST_INITIALISATION_STEPS:
            started = _steps_in(piece, segment.initialisation) >= _LEAST_INITIALISATION_STEPS
            windows = segment.initialisation, segment.evaluation
            rest.append(Segment(piece, *windows) if started else holdout_segment(piece))
    return rest


def _inside(data: DataSplit, stretch: Stretch, pieces: Pieces) -> Segment:
    """A stretch of a fitted run as a held-out segment."""
    for segment in data.fit:
        if segment.run.name == stretch.run:
            first, last = segment.evaluation
            start, stop = max(stretch.start, first), min(stretch.stop, last)
            if (piece := _piece(segment.run, start, stop, f"#{start:g}s", pieces)) is not None:
                return holdout_segment(piece)
    interval = f"{stretch.start:.10g} to {stretch.stop:.10g} s"
    raise InputError(stretch.run, "stretch to hold out", interval, f"{_LEAST_PIECE} fitted steps or more")


_LEAST_PIECE = 2 * _LEAST_INITIALISATION_STEPS  # steps: half of them find the start of what is held out


def _piece(run: Run, start: float, stop: float, name: str, pieces: Pieces) -> Run | None:
    """A run from start to stop [s], `None` where it would be too short."""
    if _steps_in(run, (start, stop)) < _LEAST_PIECE:
        return None
    key = id(run), start, stop
    if key not in pieces:
        pieces[key] = replace(run.slice(start, stop), name=f"{run.name}{name}")
    return pieces[key]


def _steps_in(run: Run, window: Window) -> int:
    return int(((run.time >= window[0]) & (run.time < window[1])).sum())


# --- A model file and the logs read for it: columns that the model needs, or that the catalogue could use ---


GUESS = "guess"
"""What `--map` says to have columns guessed."""

Notify = Callable[[Path, str], None]
Log = str | Path | pd.DataFrame
"""A log: the path of a file or folder, or a data frame."""


logger = logging.getLogger(__name__)


@dataclass(frozen=True)
class LoadedModel:
    """A model file, its model, and a reader that brings logs to it.

    Args:
        file: the model file.
        model: the model that it declares.
        mapped: columns mapped on the command line, over those of the file.
        guessing: columns that are still missing are guessed from names, and reported.
    """

    file: ModelFile
    model: Model
    mapped: dict[str, str]
    guessing: bool = False

    @property
    def columns(self) -> dict[str, ColumnSource]:
        """Where the quantities stand, by the file and by the command line."""
        return self.file.columns | dict(parse_map_option(f"{key}={text}") for key, text in self.mapped.items())

    def sources_of(self, log: Log, named: str = "log") -> tuple[dict[str, ColumnSource], dict[str, ColumnSource]]:
        """Where quantities stand in one log, and those that hold a value throughout it.

        An entry for this log, by its name with or without the ending, goes before one for a glob, that before others.

        Args:
            log: the log.
            named: what it is called, if it is a data frame.
        """
        name = named if isinstance(log, pd.DataFrame) else run_name(Path(log))
        file = name if isinstance(log, pd.DataFrame) else Path(log).name
        entries: list[dict[str, ColumnSource]] = [{}, {}, {}]  # of all logs, of a glob, of this log
        for key, source in self.columns.items():
            quantity, at, pattern = key.partition("@")
            if not at:
                entries[0][quantity] = source
            elif pattern in (name, file):
                entries[2][quantity] = source
            elif is_of_run(name, pattern):
                entries[1][quantity] = source
        sources = entries[0] | entries[1] | entries[2]
        given = {key: source for key, source in sources.items() if source.value is not None}
        return {key: source for key, source in sources.items() if key not in given}, given

    def runs(
        self,
        logs: Sequence[Log],
        *,
        strict: bool = True,
        notify: Notify = lambda log, note: logger.warning("%s: %s", log, note),
        named: str = "log",
    ) -> list[Run]:
        """Every run of the logs, in order; columns that were guessed, and doubtful values, are reported.

        Args:
            logs: paths of logs, `a.csv+b.csv` for two of one run; or data frames.
            named: what runs of data frames are called, with their number in `logs` behind it if there are several.
            notify: called with a log and a sentence about it; by default it is logged as a warning.
            strict: refuse values that can't be in the unit they are read in, and say what is doubtful; else both are
                left to who looks at the runs' issues.

        Raises:
            InputError: a log can't be used, or lacks a column that the model needs.
        """
        LOGS.check(len(logs), self.file.path, "logs")
        inputs, outputs = needed_columns(self.model)
        optional = optional_columns(self.model)
        all_runs: list[Run] = []
        said: list[str] = []
        for number, log in enumerate(logs, start=1):
            name = named if len(logs) == 1 else f"{named}{number}"
            columns, given = self.sources_of(log, name)
            if sensors := [key for key in given if key in outputs]:
                raise InputError(self.file.path, f"[columns] {sensors[0]}", "a value", "a column, for it is predicted")
            runs = read_log(
                log,
                columns,
                name=name,
                step=self.file.step,
                inputs=[key for key in inputs if given.keys().isdisjoint(raw_keys(key))],
                outputs=outputs,
                optional=[key for key in optional if given.keys().isdisjoint(raw_keys(key))],
                strict=strict,
                guessing=self.guessing,
            )
            issues = [issue.sentence for issue in runs[0].issues] if strict else []
            guessed = [note for note in runs[0].notes if note.startswith(GUESSED)]
            if guessed and guessed == said:
                guessed = [f"{GUESSED}the same {len(guessed)} columns as in {all_runs[0].source}."]
            elif not said:
                said = guessed
            for note in [*guessed, *doubtful(runs[0].notes) * strict, *issues]:
                notify(Path(runs[0].source), note)
            all_runs += [self._with_values(run, given, inputs, optional) for run in runs]
        return all_runs

    def _with_values(
        self, run: Run, given: Mapping[str, ColumnSource], inputs: Sequence[str], optional: Sequence[str]
    ) -> Run:
        """A run with what holds a value throughout it."""
        columns = dict(run.columns)
        for column in (*inputs, *optional):
            raw = {key: given[key] for key in raw_keys(column) if key in given}
            if not raw:
                continue
            lacking = [key for key in raw_keys(column) if key not in given and key not in columns]
            if lacking and column in optional:
                continue
            if lacking:
                raise InputError(run.source, f"column {lacking[0]}", "no such column", f"what {column} is made of")
            held = dict(columns) | {key: self._held(source, key, run) for key, source in raw.items()}
            columns[column] = sample_values(column, held)
        return replace(run, columns=columns)

    def _held(self, source: ColumnSource, key: str, run: Run) -> FloatArray:
        if source.value == START:
            return np.full(len(run), resting_temperature(self.model, run))
        values = to_si(np.full(len(run), source.value), quantity_of(key), source.unit)
        usual = PLAUSIBLE.get(quantity_of(key))
        if usual is not None and np.abs(values).max() > usual.most:
            found = f"{source.value:g}, read in {column_unit(key)}"
            raise InputError(self.file.path, f"[columns] {key}", found, f"at most {usual.most:g}, or its unit with it")
        return values


def load_model(path: str | Path, mapped: Sequence[str] = ()) -> LoadedModel:
    """Read a model file.

    Args:
        path: the model file.
        mapped: `--map` options, such as `"temperature.FR_calf=T3[degF]"`; they win over the file's `[columns]`. The
            word `guess` among them has columns that are still missing guessed from names.

    Raises:
        InputError: the file or an option can't be used.

    Example:
        >>> import lptn
        >>> loaded = lptn.load_model("examples/tclab/two_heaters.toml")
        >>> loaded.model
        <Model two heaters: 2 states, 3 inputs, 3 free parameters>
        >>> [run.name for run in loaded.runs(["examples/tclab/log.csv"])]
        ['log']
    """
    pairs = dict(_pair(text) for text in mapped if text.strip() != GUESS)
    file = read_model_file(Path(path))
    errors = {name: entry.error for name, entry in file.fit.parameters.items() if entry.error is not None}
    loaded = LoadedModel(file, Model(file.network, errors), pairs, any(text.strip() == GUESS for text in mapped))
    columns = [*loaded.model.inputs, *(f"temperature.{node}" for node in loaded.model.nodes)]
    usable = {key for column in (*columns, *optional_columns(loaded.model)) for key in (column, *raw_keys(column))}
    # A slip of the pen would be without effect, in silence.
    for key in sorted({key.partition("@")[0] for key in pairs} - usable - {"time", SECOND_TIME}):
        expected = f"a quantity at a place of the model, such as {' or '.join(columns[::-1][:3])}"
        raise InputError("--map", key, "nothing that the model could use", expected)
    return loaded


def optional_columns(model: Model) -> list[str]:
    """Columns that the model does not need, but that effects of the catalogue could use, or figures show."""
    features = {feature for effect in catalogue().values() for feature in effect.needs}
    features |= {word for effect in catalogue().values() for word in effect.options.get("input", ())}
    columns = (input_column(feature, node) for feature in sorted(features) for node in model.nodes)
    return [column for column in dict.fromkeys(columns) if column not in model.inputs]


def _pair(text: str) -> tuple[str, str]:
    parse_map_option(text)  # refuse a malformed option before any file is read
    key, _, column = text.partition("=")
    return key.strip(), column


# --- Effects confined to runs that are not there --------------------------------------------------


def absent_runs(network: Network, runs: Iterable[Run]) -> list[str]:
    """A warning for each run that an effect is confined to and that is not among the logs; none without logs.

    A slip of the pen in a run's name would switch an effect off in silence.

    Args:
        network: its effects name the runs that they act in, or globs of them.
        runs: all runs that were read, whatever for.
    """
    names = list(dict.fromkeys(run.name for run in runs))
    if not names:
        return []
    asked = {effect.run: effect for effect in network.effects if effect.run}
    return [
        f'{effect.effect.key} at {effect.at} acts only in run "{pattern}", and no log is that run '
        f"(here: {_listed(names)}): it is off"
        for pattern, effect in asked.items()
        if not any(is_of_run(name, pattern) for name in names)
    ]


def warn_of_absent_runs(network: Network, runs: Iterable[Run]) -> None:
    """Log these warnings."""
    for warning in absent_runs(network, runs):
        logger.warning(warning)


def _listed(names: Sequence[str], most: int = 8) -> str:
    return ", ".join(names[:most]) + (f" and {len(names) - most} more" if len(names) > most else "")
