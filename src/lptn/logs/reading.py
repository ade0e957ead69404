"""A log read into runs: opened, its columns chosen, its values checked, split at its gaps and resampled."""

from __future__ import annotations

import hashlib
import math
import re
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import chain
from pathlib import Path

import numpy as np
import pandas as pd

from lptn.basics.arrays import FloatArray
from lptn.basics.errors import InputError
from lptn.basics.files import fingerprint
from lptn.logs.alike import duplicates, without_held_rows
from lptn.logs.bags import open_bag
from lptn.logs.channels import Channels, quantisation_step
from lptn.logs.clock import FEWEST_ROWS, check_time, in_order, within_stamps
from lptn.logs.columns import AMBIENT, MEANS, SAMPLES, ColumnSource, as_line_or_option, place_of
from lptn.logs.csv_files import open_csv, open_spreadsheet
from lptn.logs.guess import format_note, guess, refuse_exchanged
from lptn.logs.issue import Issue
from lptn.logs.joining import ONE_CLOCK, join
from lptn.logs.quality import check_values, issues_of, silent_channels
from lptn.logs.recorders import open_hdf5, open_mat, open_mdf, open_tdms
from lptn.logs.resampling import (
    ROUNDING,
    SEVERAL,
    STEADY_GAP,
    Grid,
    Samples,
    Span,
    features_of,
    gaps_in_words,
    raw_keys,
)
from lptn.logs.run import LATEST_FIRST, Run
from lptn.logs.scatter import scatter_of
from lptn.logs.streams import ANOTHER_SOURCE, rows_of_zeros
from lptn.logs.tables import Table, column_sources, one_line_if_broken, open_parquet, table_of
from lptn.logs.ulog import open_ulog

# --- A log opened by its path: one file or folder, or two logs of one run that are joined ---------

_PAIR = re.compile(r"(?P<first>.+?)\+(?P<second>[^+]+?)(?:@(?P<shift>[-+]?\d+(?:\.\d+)?))?")
_BAG = open_bag, "a whole ROS 2 bag; one that was not closed is mended by `mcap recover` or `ros2 bag reindex`"
OPENERS: Mapping[tuple[str, ...], tuple[Callable[[Path], Table], str]] = {
    (".csv", ".tsv", ".txt", ".csv.gz", ".tsv.gz", ".txt.gz"): (open_csv, "a whole table"),
    (".parquet",): (open_parquet, "a whole Parquet file"),
    (".xlsx", ".xlsm"): (open_spreadsheet, "a whole .xlsx file"),
    (".mcap", ".db3"): _BAG,
    (".bag",): (open_bag, "a whole ROS 1 bag; one that was not closed is mended by `rosbag reindex`"),
    (".ulg", ".ulog"): (open_ulog, "a whole PX4 ULog"),
    (".mf4", ".mdf"): (open_mdf, "a whole MDF4 file"),
    (".tdms",): (open_tdms, "a whole TDMS file"),
    (".mat",): (open_mat, "a whole MATLAB file"),
    (".h5", ".hdf5"): (open_hdf5, "a whole HDF5 file"),
}
"""How a file is opened, by the end of its name, and what is expected where it is broken: the one list of formats."""
ENDINGS = tuple(chain(*OPENERS))
_PLAIN = [ending for ending in ENDINGS if not ending.endswith(".gz")]
LOG_FILE = f"a {', '.join(_PLAIN[:-1])} or {_PLAIN[-1]} file, or the folder of a ROS 2 bag"
"""What is expected where a file is no log."""


def open_log(path: Path, columns: Mapping[str, ColumnSource]) -> tuple[Table, dict[str, ColumnSource]]:
    """Open what a path names, and give the mapping that is left for it.

    That is a log; or two logs of one run, `a.csv+b.csv`, on one clock, or with the second's set forward by so many
    seconds, `a.csv+b.csv@12.5`.

    Raises:
        InputError: a log can't be opened, or the two can't be joined.
    """
    pair = pair_of(path)
    if pair is None:
        return open_table(path), dict(columns)
    first, second, shift = pair
    return join(path, open_table(first), open_table(second), shift, columns)


def open_table(path: Path) -> Table:
    """Open a log and read its column names.

    Raises:
        InputError: there is no such file, its format is not known, or it can't be read.
    """
    if not path.exists():
        raise InputError(path, "log", "no such file", "the path of a log")
    if path.is_dir() and not (path / "metadata.yaml").is_file():
        raise InputError(path, "log", "a folder", f"{LOG_FILE} with its metadata.yaml")
    if not path.is_dir() and not path.is_file():  # which may never end, or never begin, and is read once
        raise InputError(path, "log", "a pipe or a device", LOG_FILE)
    found = (how for endings, how in OPENERS.items() if path.name.endswith(endings))
    if (how := _BAG if path.is_dir() else next(found, None)) is None:
        raise InputError(path, "log", f"the ending '{path.suffix}'", LOG_FILE)
    opened, whole = how
    with one_line_if_broken(path, whole):
        return replace(opened(path), whole=whole, digest=partial(_digest, path))


def _digest(path: Path) -> str:
    """SHA-256 of a file's bytes; of a folder that of its files' digests in order of their names."""
    if path.is_file():
        return fingerprint(path)
    lines = (f"{file.name} {fingerprint(file)}" for file in sorted(path.iterdir()) if file.is_file())
    return hashlib.sha256("\n".join(lines).encode()).hexdigest()


def pair_of(path: Path) -> tuple[Path, Path, float | None] | None:
    """The two logs that a path `a.csv+b.csv` names, and the shift that it gives; `None` for the path of one log.

    The second is looked for beside the first, and then where its own path says. Where neither is found it is one path.

    Raises:
        InputError: more than two are named.
    """
    if path.exists() or (match := _PAIR.fullmatch(str(path))) is None:
        return None
    first, second, shift = Path(match["first"]), Path(match["second"]), match["shift"]
    if "+" in match["first"] and not first.exists():
        raise InputError(path, "log", "more than two logs joined by +", "two: LOG+OTHER")
    second = beside if (beside := first.parent / second).exists() else second
    if not first.exists() and not second.exists():  # a + in the name of a folder, and no such file in it
        return None
    return first, second, None if shift is None else float(shift)


def run_name(path: Path) -> str:
    """What a run of this log is called: the file's name without its ending; of two, the first's."""
    pair = pair_of(path)
    log = pair[0] if pair else path
    if log.is_dir():
        return log.name
    name = log.name.removesuffix(".gz")
    return name.rpartition(".")[0] if name.endswith(ENDINGS) else name


# --- Which of a log's columns a model needs, and what to say when one is not there ----------------


@dataclass(frozen=True)
class ColumnChoice:
    """What is taken from a log.

    Attributes:
        inputs: `<feature>.<place>` columns that a model is driven by.
        outputs: temperature columns that it predicts.
        sources: where `time` and the raw quantities that those are formed from stand.
        notes: what is left out, a sentence each.
        everything: nothing was asked for in particular.
    """

    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    sources: Mapping[str, ColumnSource]
    notes: tuple[str, ...] = ()
    everything: bool = False

    def raw(self, columns: Collection[str]) -> set[str]:
        """The raw quantities that some of its columns are formed from."""
        return {key for column in columns for key in raw_keys(column, self.sources)}

    def without(self, lost: Collection[str]) -> ColumnChoice:
        """That without some columns, and without the raw ones that nothing else is formed from."""
        inputs, outputs = (tuple(c for c in columns if c not in lost) for columns in (self.inputs, self.outputs))
        kept = {"time", *self.raw((*inputs, *outputs)).difference(lost)}
        sources = {key: source for key, source in self.sources.items() if key in kept}
        return replace(self, inputs=inputs, outputs=outputs, sources=sources)


def choose_columns(
    table: Table,
    columns: Mapping[str, ColumnSource],
    inputs: Collection[str],
    outputs: Collection[str],
    optional: Collection[str] = (),
) -> ColumnChoice:
    """Resolve the wanted `<feature>.<place>` columns to raw ones, or take all if none are named.

    Args:
        table: the log.
        columns: where quantities stand that are not called by their own names.
        inputs: columns that have to be there.
        outputs: temperatures, of which one has to be there.
        optional: inputs that are taken where the log has them.

    Raises:
        InputError: time or an input is not in the log, or none of the outputs is.
    """
    sources, everything, notes = column_sources(table, columns), not inputs and not outputs, list[str]()

    def require(keys: Collection[str], purpose: str = "") -> None:
        """Refuse a log that lacks one of the raw columns, which are for the feature `purpose`."""
        for key in keys:
            for name in _absent(table, sources, key):
                place = f"column '{name}'" if key in sources else f"column {key}"
                place += f" (for {purpose})" * bool(purpose and purpose != key)
                problem = f"no such column; the log has: {table.listing}"
                raise InputError(table.path, place, problem, _instead(table, sources, key, purpose))

    if everything:
        require(sources)
        features = features_of(key for key in sources if key != "time")
        outputs = tuple(column for column in features if column.startswith("temperature."))
        inputs = tuple(column for column in features if column not in outputs)
        if not features:
            expected = "<quantity>.<place>, or lines in [columns] / --map torque.FR_calf=YOURNAME"
            raise InputError(table.path, "columns", f"none that is known in: {table.listing}", expected)
    else:
        for column in inputs:
            require(raw_keys(column, sources), column)
        # What the model needs as an input has to be whole, measured node or not.
        predicted = tuple(column for column in outputs if column not in inputs)
        outputs = tuple(column for column in predicted if not _absent(table, sources, column))
        if not outputs:
            require(predicted[:1])
        notes += [f"{column}: not in the log, so not measured." for column in predicted if column not in outputs]
        there = [column for column in optional if column not in predicted]
        there = [c for c in there if not any(_absent(table, sources, key) for key in raw_keys(c, sources))]
        inputs = (*inputs, *there)
        lost = [key for key in columns if key not in predicted and key != "time" and _absent(table, sources, key)]
        notes += [f"{key}: mapped to a column that is not in the log; left out." for key in lost]
    require(("time",))
    inputs, outputs = tuple(dict.fromkeys(inputs)), tuple(dict.fromkeys(outputs))
    raw = dict.fromkeys(key for column in (*inputs, *outputs) for key in raw_keys(column, sources))
    return ColumnChoice(inputs, outputs, {key: sources[key] for key in ("time", *raw)}, tuple(notes), everything)


def _absent(table: Table, sources: Mapping[str, ColumnSource], key: str) -> tuple[str, ...]:
    """The names wanted for `key` that are not in the file; the key itself where nothing is mapped to it."""
    return tuple(name for name in sources[key].columns if name not in table.names) if key in sources else (key,)


def _instead(table: Table, sources: Mapping[str, ColumnSource], key: str, purpose: str) -> str:
    """What would have been right in place of a missing column: the line to write, with a column that may be meant."""
    own = column_sources(table, {})
    mapped = {k: x for k, x in sources.items() if own.get(k) != x and set(x.columns) <= set(table.names)}
    wanted = [purpose] if purpose and not purpose.startswith("temperature.") else []
    guesses = guess(table, mapped, wanted, [key] if key.startswith("temperature.") else [])
    guessed = next((candidate for candidate in guesses if candidate.key == key), None)
    proposal = guessed.option.removeprefix("--map ") if guessed else ""
    if " " not in proposal:
        proposal = proposal.strip('"')
    expected = f"a column of that name, or a line in [columns] / --map {proposal or f'{key}=YOURNAME'}"
    if guessed and proposal:
        expected += f" ({guessed.why}; `lptn check` proposes all such lines, --map guess takes them)"
    if key == "time":
        expected += "; where rows have no times but come at one rate, --rate 50 for 50 a second"
    if key.startswith("temperature.") and purpose == key:
        expected += _without_column(key, run=run_name(table.path))
    return expected


def _without_column(key: str, value: float = 22.0, run: str = "") -> str:
    """What a model file can say instead of a prescribed temperature's column, which may be about a value [degC]."""
    place = place_of(key)
    table, name = ("[model]", "ambient") if place == "ambient" else (f"[nodes.{place}]", "temperature")
    return (
        f'; or in the model file under {table} {name} = "start" for a log that begins at rest, {name} = {value:.4g} for'
        f" a constant [degC], or {name} = {{ value = 22, fixed = false }} for one that the fit finds; for one log alone"
        f' "{key}@{run}" = {{ value = {value:.4g} }}, or "start", in [columns]'
    )


# --- A log read into runs: mapped, checked, split at its gaps and resampled -----------------------

_SHORTEST_STEP = 1.0  # s, unless the user asks for less: bodies of a robot's size warm over minutes
_BRIDGED, _BRIDGED_STEPS = 10.0, 5.0  # s, and steps: the gap that is bridged unless the user says another
_SLOW = 60.0  # s from row to row, from which half of it is what a winding or a sensor lags by
_BEGINNING = 5.0  # s, of the log, whose mean reading is where a run is taken to begin
ROWS_UNKNOWN = "time: a row every "
"""How a note begins that asks whether slow rows are means."""
GUESSED = "guessed: "
"""How notes on guessed columns begin."""
OUT_OF_ORDER = "out of order, by a few steps"
"""What the note on rows says that were sorted."""


def doubtful(notes: Sequence[str]) -> list[str]:
    """Those notes by which a log may be read otherwise than it was meant: every command says them."""
    return [
        note for note in notes if any(part in note for part in (ROWS_UNKNOWN, ANOTHER_SOURCE, ONE_CLOCK, OUT_OF_ORDER))
    ]


def read_log(
    log: str | Path | pd.DataFrame,
    columns: Mapping[str, ColumnSource] | None = None,
    *,
    name: str = "data frame",
    step: float | None = None,
    max_gap: float | None = None,
    inputs: Collection[str] = (),
    outputs: Collection[str] = (),
    optional: Collection[str] = (),
    strict: bool = True,
    guessing: bool = False,
) -> list[Run]:
    """Read a log into runs, one for each stretch between gaps in the inputs.

    Inputs hold from sample to sample; over a step torque and current keep their RMS, velocity and speed the
    mean of the absolute value. Temperatures are the mean over a step, or are interpolated at its start where
    a step holds about one sample. Where the entry of `time` says that rows are means, both are means over the row.

    Args:
        log: a file of a format in `OPENERS`, the folder of a ROS 2 bag, two logs of one run, `a.csv+b.csv@12.5` (see
            `lptn.logs.joining`), or a data frame with a column `time` [s], or an index of times.
        columns: where the quantities stand, for a log whose columns are not called `<quantity>.<place>`.
        name: what the run of a data frame is called; files have names of their own.
        step: s, of the runs; None for the log's own or 1 s, whichever is longer.
        max_gap: s, the longest gap in time or in an input that is bridged; None for max(10 s, 5 steps), and for 5 min
            in a temperature that drives the model and is steady.
        inputs: `<feature>.<place>` columns that the model is driven by.
        outputs: temperature columns that the model predicts. Neither given: all columns are kept.
        optional: inputs that are kept where the log has them without a gap.
        strict: refuse values that can't be in the unit they are read in; else they are only among the runs' issues.
        guessing: take columns whose names say what they hold for what is missing; the runs' notes say which.

    Returns:
        the runs in order of time, at least one.

    Raises:
        InputError: the file, a column or a value can't be used.

    Example:
        >>> import lptn, pandas
        >>> frame = pandas.DataFrame({"time": range(60), "current.knee": 2.0, "temperature.knee": 21.5})
        >>> (run,) = lptn.read_log(frame, name="monday")
        >>> run
        <Run monday: 60 steps of 1 s, 3 columns>
    """
    path = Path(name) if isinstance(log, pd.DataFrame) else Path(log)
    for setting, value in (("step", step), ("max_gap", max_gap)):
        if value is not None and not (math.isfinite(value) and value > 0):
            raise InputError(path, setting, f"{value:g} s", "a time above 0 s")
    rows = columns["time"].rows if columns and "time" in columns else ""
    if isinstance(log, pd.DataFrame):
        table, columns = table_of(log, name), dict(columns or {})
    else:
        table, columns = open_log(path, columns or {})
    if rows in MEANS and table.mixed:
        problem = f'"{rows}", of columns at rates of their own'
        raise InputError(path, "rows of time", problem, "rows that hold all columns")
    guesses = guess(table, columns, inputs, outputs, optional) if guessing else []
    columns |= {guessed.key: guessed.source for guessed in guesses}
    choice = choose_columns(table, columns, inputs, outputs, optional)
    samples, issues = _checked_samples(table, choice, strict)
    refuse_exchanged(path, guesses, choice.sources, Channels({"time": samples.time, **samples.raw}))
    period = float(f"{samples.period:.3g}")
    asked = _SHORTEST_STEP if step is None else step
    of_step = f"time: sampled every {period:g} s, so steps of {period:g} s are used in place of {asked:g} s."
    said, step = [of_step] * (step is not None and step < period), max(period, asked)
    steady_gap = STEADY_GAP if max_gap is None else 0.0
    max_gap = max(_BRIDGED, _BRIDGED_STEPS * step) if max_gap is None else max_gap
    if max_gap < SEVERAL * samples.period:
        expected = f"more than {SEVERAL} sampling periods of {samples.period:.3g} s"
        raise InputError(path, "max_gap", f"{max_gap:g} s", expected)
    stretches = partial(samples.stretches, max_gap=max_gap, steady_gap=steady_gap)
    # Inputs that nobody needs, and that hold nothing or would cut the log into pieces.
    needed, gaps = {*inputs, *outputs} or set(choice.inputs), {k for k, x in samples.raw.items() if np.isnan(x).any()}
    void = {key for key in gaps if np.isnan(samples.raw[key]).all()}
    kept = gaps & choice.raw(needed & {*choice.inputs, *choice.outputs}) - void - set(outputs)
    whole, gappy = list[Span](), list[str]()
    for column in choice.inputs:
        if column not in needed and (own := gaps & choice.raw([column])):
            whole = whole or stretches(kept)[0]
            with_it = stretches(kept | own)[0] if void.isdisjoint(own) else []
            lost = sum(stop - start for start, stop in whole) - sum(stop - start for start, stop in with_it)
            gappy += [column] if len(with_it) != len(whole) or lost > max_gap else []
    choice = choice.without(gappy)
    empty = _empty(table, choice, void & choice.sources.keys(), issues)
    notes = [f"{GUESSED}{guessed.line} ({guessed.why})." for guessed in guesses]
    notes += [*filter(None, [format_note(table)]), *choice.notes, *table.notes]
    notes += [f"{column}: has gaps, and the model does not need it; left out." for column in gappy]
    notes += [*(f"{key}: no value in any row; left out." for key in samples.raw if key in empty), *said]
    choice = choice.without(empty)
    samples = replace(samples, raw={key: x for key, x in samples.raw.items() if key in choice.sources})
    runs = _runs(table, choice, samples, step, max_gap, stretches, notes)
    begun = runs if choice.everything else _beginning_with_readings(runs, choice.outputs)
    return [replace(run, issues=issues) for run in begun]


@np.errstate(over="ignore", invalid="ignore")  # what overflows is refused as a time
def _checked_samples(table: Table, choice: ColumnChoice, strict: bool) -> tuple[Samples, tuple[Issue, ...]]:
    """The log's samples in SI and degC, and what looks wrong."""
    log = _channels(table, choice.sources)
    predicted = set(choice.outputs) - set(choice.inputs)
    given = [key for key in log.of("temperature") if key not in predicted and not log.load_of(place_of(key))]
    if AMBIENT not in given and len(given) == 1:  # called something else
        log = replace(log, air=given[0])
    log, held = (log, []) if table.mixed else without_held_rows(log)
    silent = silent_channels(log, predicted)
    clean = log.without({key: [one for one in some if one.left_out] for key, some in silent.items()})
    twice = duplicates(log)
    issues = (*issues_of(log, silent, twice, predicted), *held)
    for issue in issues:
        if strict and issue.certain:
            raise InputError(table.path, *issue.error)
    raw, alike = dict(clean.values), {key for pair in twice.items() for key in pair}
    if not alike.issuperset(choice.outputs):  # of the only two sensors one is right
        raw |= {key: np.full(raw[key].size, np.nan) for key in alike}
    time, source = raw.pop("time"), choice.sources["time"]
    keep = check_time(table, "time", source, time)
    if keep.size < time.size:
        time, raw = time[keep], {key: values[keep] for key, values in raw.items()}
    samples = Samples(time, raw)
    if source.rows in MEANS:  # from the beginning of what each row is about
        samples = replace(samples, time=time - MEANS[source.rows] * samples.period, means=True)
    elif samples.period >= _SLOW and not source.rows and source.columns and not table.mixed:
        example, *others = reversed(MEANS)
        line = as_line_or_option("time", replace(source, rows=example))
        note = f"{ROWS_UNKNOWN}{samples.period:.4g} s, read as samples whose inputs hold until the next; "
        note += f'if rows are means, write {line} ({" or ".join(others)}, where it is so), else rows = "{SAMPLES}".'
        table.note(note)
    table.note(*_temperature_notes(samples, table.mixed), *(issue.sentence for issue in issues))
    return samples, issues


def _channels(table: Table, sources: Mapping[str, ColumnSource]) -> Channels:
    """The file's columns as they stand there, and the quantities in SI and degC, in order of time."""
    sensors = {name for key, source in sources.items() if key.startswith("temperature.") for name in source.columns}
    numbers = table.numbers((name for source in sources.values() for name in source.columns), sensors)
    table.note(sources["time"].counted)
    raw = dict[str, FloatArray]()
    for key, source in sources.items():
        raw[key] = source.values(key, numbers)
        if key != "time":
            check_values(table, key, source, raw[key])
        if marked := source.missing(numbers):
            table.note(f"{key}: {marked} of {raw[key].size} numbers are no readings, by its entry in [columns].")
    where = None if table.mixed else table.where
    if (order := in_order(raw["time"])) is not None:
        raw, numbers = ({key: values[order] for key, values in columns.items()} for columns in (raw, numbers))
        late, where = int((np.diff(order) < 0).sum()), None
        table.note(f"time: {late} row{'s' * (late > 1)} {OUT_OF_ORDER}; sorted.")
    zeros, of_zeros = rows_of_zeros(Channels(raw, sources))
    if of_zeros:
        raw |= {key: np.where(zeros, np.nan, raw[key]) for key in of_zeros}
        said = f"zero in {zeros.sum()} rows between rows of other values, as if {ANOTHER_SOURCE}; these are left out."
        table.note(f"{', '.join(of_zeros)}: {said}")
    if not table.mixed:
        others = {key: values for key, values in raw.items() if key != "time"}
        raw["time"] = within_stamps(table, sources["time"], raw["time"], others)
    return Channels(raw, sources, numbers, table.units, where)


def _temperature_notes(samples: Samples, mixed: bool) -> list[str]:
    """How often each temperature is logged, and how many readings are missing."""
    notes = []
    for key, values in samples.raw.items():
        missing = int(np.isnan(values).sum())
        if not key.startswith("temperature.") or not 0 < missing < values.size:
            continue
        stamps = samples.time[~np.isnan(values)]
        usual = float(np.median(np.diff(stamps))) if stamps.size > 1 else 0.0
        if mixed or usual > SEVERAL * samples.period:
            late = np.diff(stamps)[np.diff(stamps) > SEVERAL * usual]
            silent = f"; {gaps_in_words(late)}" if late.size else ""
            notes.append(f"{key}: logged every {usual:.4g} s{silent}.")
        else:
            notes.append(f"{key}: {missing} of {values.size} readings are missing.")
    return notes


def _empty(table: Table, choice: ColumnChoice, empty: Collection[str], issues: Collection[Issue]) -> list[str]:
    """Raw columns that hold no number, and inputs formed from them; refused where the model can't do without."""
    lost = [column for column in choice.inputs if not choice.raw([column]).isdisjoint(empty)]
    none_left = choice.outputs or len(lost) == len(choice.inputs)
    if empty and ((lost and not choice.everything) or (none_left and set(choice.outputs).issubset(empty))):
        needed, in_order = choice.raw(lost), [key for key in choice.sources if key in empty]
        key = next((key for key in in_order if key in needed), in_order[0])
        for issue in (issue for issue in issues if issue.key == key):
            raise InputError(table.path, *issue.error)  # which is why nothing of it is left
        place = f"column '{choice.sources[key].columns[0]}'"
        raise InputError(table.path, place, "no value in any row", f"numbers for {key}")
    return [*empty, *lost]


def _runs(
    table: Table,
    choice: ColumnChoice,
    samples: Samples,
    step: float,
    max_gap: float,
    stretches_of: Callable[[Collection[str]], tuple[list[Span], list[str]]],
    notes: list[str],
) -> list[Run]:
    """One run for each stretch of the log that is long enough; refused where none is."""
    needed = {key: values for key, values in samples.raw.items() if key not in choice.outputs}
    stretches, gaps = stretches_of(needed)
    if table.mixed:  # rows of several clocks follow each other at any distance
        gaps = [note for note in gaps if not (note.startswith("time: ") and "bridged" in note)]
    counts = [math.floor((stop - start) / step + ROUNDING) for start, stop in stretches]
    kept = [(start, n) for (start, _), n in zip(stretches, counts, strict=True) if n >= FEWEST_ROWS]
    if not kept:

        def long_enough(inputs: Collection[str]) -> bool:
            return any(stop - start >= step * FEWEST_ROWS for start, stop in stretches_of(inputs)[0])

        for key in sorted(needed, key=lambda key: int(np.isfinite(needed[key]).sum())):
            if not long_enough(needed.keys() - {key}) or long_enough([key]):
                continue  # without this input there would be a stretch
            values = needed[key][np.isfinite(needed[key])]
            problem = f"{values.size} value{'s' * (values.size != 1)} of {key} in {samples.time.size} rows"
            expected = f"values no more than {max_gap:g} s apart, or hold = true in its entry of [columns] if it is "
            expected += "logged on change, or once"
            if key.startswith("temperature."):
                expected += _without_column(key, np.median(values), run_name(table.path))
            raise InputError(table.path, f"column '{choice.sources[key].columns[0]}'", problem, expected)
        problem = f"at most {max(counts, default=0)} steps of {step:g} s in one stretch"
        expected = f"a stretch of at least {FEWEST_ROWS} steps without a gap over {max_gap:g} s"
        raise InputError(table.path, "log", problem, expected)
    if len(kept) < len(stretches):
        dropped = f"{len(stretches) - len(kept)} of {len(stretches)} stretches"
        gaps.append(f"log: {dropped} hold fewer than {FEWEST_ROWS} steps of {step:g} s; dropped.")
    stem, sensors = run_name(table.path), {k: x for k, x in samples.raw.items() if k.startswith("temperature.")}
    resolution = {key: apart for key, values in sensors.items() if (apart := quantisation_step(values)) > 0}
    notes = [*notes, *(f"{key}: sensor steps of {apart:g} K." for key, apart in resolution.items()), *gaps]
    early = samples.time < samples.time[0] + max(_BEGINNING, samples.period)
    first = {key: values[early][np.isfinite(values[early])] for key, values in sensors.items()}
    subjects: dict[str, list[str]] = {}  # of notes that say the same of several columns
    for subject, _, text in (note.partition(": ") for note in notes):
        subjects.setdefault(text, []).append(subject)
    scatter = {key: scatter_of(samples.time, x, resolution.get(key, 0.0)) for key, x in sensors.items()}
    whole = Run(
        name=stem,
        step=step,
        time=samples.time,
        columns={},
        averaged=samples.averaged(step),
        source=str(table.path),
        fingerprint=table.digest(),
        notes=tuple(f"{', '.join(names)}: {text}" for text, names in subjects.items()),
        resolution=resolution,
        scatter={} if samples.means else scatter,
        beginning={key: float(readings.mean()) for key, readings in first.items() if readings.size},
        log_start=float(samples.time[0]),
        log_end=float(samples.time[-1]) + samples.period * samples.means,
    )
    missing = {key: pd.Series(x).ffill() for key, x in needed.items() if np.isnan(x).any()}  # no copy of the others
    held = replace(samples, raw={**needed, **{key: np.asarray(x, np.float64) for key, x in missing.items()}})
    runs = []
    for number, (start, n) in enumerate(kept, start=1):
        on = Grid(start, step, n)
        columns = held.inputs(choice.inputs, on) | samples.temperatures(choice.outputs, on, max_gap)
        name = f"{stem}#{number}" if len(stretches) > 1 else stem
        runs.append(replace(whole, name=name, time=on.starts, columns=columns))
    return runs


def _beginning_with_readings(runs: list[Run], outputs: Collection[str]) -> list[Run]:
    """The runs in which a temperature of the model was read; behind a gap, each from its first reading on.

    A stretch between gaps may lie in a longer gap of the sensors, or begin in one. Nothing says then how warm the
    robot is where it begins. How warm it was at the beginning of the log, the model may know.
    """
    kept, late = [], []
    for run in runs:
        reads = np.any([np.isfinite(run.columns[key]) for key in outputs if run.has(key)], axis=0)
        if not np.any(reads):
            continue
        first = int(np.argmax(reads))
        if run is runs[0] or first * run.step <= LATEST_FIRST:
            kept.append(run)
        elif len(run) - first >= FEWEST_ROWS:
            kept.append(run.slice(float(run.time[first]), np.inf))
            late.append(f"{run.name} by {first * run.step:.4g} s")
    if not kept:
        return runs
    notes = [f"log: cut to the first reading of a temperature: {', '.join(late)}."] if late else []
    if len(kept) < len(runs):
        silent = len(runs) - len(kept)
        notes.append(f"log: {silent} of {len(runs)} stretches hold next to no reading of a node of the model; dropped.")
    return [replace(run, notes=(*run.notes, *notes)) for run in kept]
