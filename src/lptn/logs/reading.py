"""A log read into runs: opened, mapped, checked, split at its gaps and resampled."""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd

from lptn.basics.arrays import FloatArray
from lptn.basics.errors import InputError
from lptn.logs.columns import ColumnSource
from lptn.logs.guess import guess, recognised
from lptn.logs.quality import Suspicion, check_time, check_values, doubts_of
from lptn.logs.resampling import Samples, driven, features_of, find_stretches, grid, hold, measured, raw_keys, would_cut
from lptn.logs.run import Run, quantisation_step
from lptn.logs.tables import Table, known_columns, open_csv, open_parquet, table_of

# --- Which of a log's columns a model needs, and what to say when one is not there ----------------


@dataclass(frozen=True)
class Selection:
    """Columns to build, inputs and output temperatures, and where the raw ones and time stand."""

    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    sources: Mapping[str, ColumnSource]
    notes: tuple[str, ...]
    everything: bool  # nothing was asked for in particular


def select(
    table: Table,
    columns: Mapping[str, ColumnSource],
    inputs: Collection[str],
    outputs: Collection[str],
    optional: Collection[str] = (),
) -> Selection:
    """Resolve the wanted `<feature>.<place>` columns to raw ones, or take all if none are named.

    Optional inputs are taken where the log has them.

    Raises:
        InputError: time or an input is not in the log, or none of the outputs is.
    """
    # The convention's own names need no mapping; a mapping of the same key wins.
    known = known_columns(table, columns)
    if not inputs and not outputs:
        _require(table, known, tuple(known), "")
        features = features_of(key for key in known if key != "time")
        outputs = tuple(column for column in features if column.startswith("temperature."))
        inputs = tuple(column for column in features if column not in outputs)
        if not features:
            expected = "<quantity>.<place>, or lines in [columns] / --map torque.FR_calf=YOURNAME"
            raise InputError(table.path, "columns", f"none that is known in: {_listing(table)}", expected)
        return _selection(table, known, inputs, outputs, (), True)
    for column in inputs:
        _require(table, known, raw_keys(column, known), column)
    # What the model needs as an input has to be whole, measured node or not.
    outputs = tuple(column for column in outputs if column not in inputs)
    measured = tuple(column for column in outputs if not _absent(table, known, column))
    if outputs and not measured:
        _require(table, known, outputs[:1], "")
    notes = tuple(f"{column}: not in the log, so not measured." for column in outputs if column not in measured)
    there = [
        column
        for column in optional
        if not any(_absent(table, known, key) for key in raw_keys(column, known)) and column not in outputs
    ]
    return _selection(table, known, (*inputs, *there), measured, notes, False)


def _selection(
    table: Table,
    known: Mapping[str, ColumnSource],
    inputs: Collection[str],
    outputs: Collection[str],
    notes: tuple[str, ...],
    everything: bool,
) -> Selection:
    _require(table, known, ("time",), "")
    raw = dict.fromkeys(key for column in (*inputs, *outputs) for key in raw_keys(column, known))
    sources = {key: known[key] for key in ("time", *raw)}
    return Selection(tuple(dict.fromkeys(inputs)), tuple(dict.fromkeys(outputs)), sources, notes, everything)


def _absent(table: Table, known: Mapping[str, ColumnSource], key: str) -> tuple[str, ...]:
    """The names wanted for `key` that are not in the file; the key itself where nothing is mapped to it."""
    if key not in known:
        return (key,)
    return tuple(name for name in known[key].columns if name not in table.names)


def _require(table: Table, known: Mapping[str, ColumnSource], keys: tuple[str, ...], purpose: str) -> None:
    for key in keys:
        for name in _absent(table, known, key):
            place = f"column '{name}'" if key in known else f"column {key}"
            because = f" (for {purpose})" if purpose and purpose != key else ""
            found = f"no such column; the log has: {_listing(table)}"
            raise InputError(table.path, place + because, found, _instead(table, known, key, purpose))


def _instead(table: Table, known: Mapping[str, ColumnSource], key: str, purpose: str) -> str:
    """What would have been right in place of a missing column: the line to write, with a column that may be meant."""
    own = known_columns(table, {})
    mapped = {name: source for name, source in known.items() if own.get(name) != source}
    mapped = {name: source for name, source in mapped.items() if set(source.columns) <= set(table.names)}
    wanted = [purpose] if purpose and not purpose.startswith("temperature.") else []
    found = {each.key: each for each in guess(table, mapped, wanted, [key] if key.startswith("temperature.") else [])}
    proposal = found[key].option.removeprefix("--map ") if key in found else ""
    if proposal and " " not in proposal:
        proposal = proposal.strip('"')
    expected = f"a column of that name, or a line in [columns] / --map {proposal or f'{key}=YOURNAME'}"
    if proposal:
        expected += f" ({found[key].why}; `lptn check` proposes all such lines, --map guess takes them)"
    if key.startswith("temperature.") and purpose == key:
        expected += without_column(key)
    return expected


def without_column(key: str) -> str:
    """What a model file can say instead of a prescribed temperature's column."""
    place = key.partition(".")[2]
    table, name = ("[model]", "ambient") if place == "ambient" else (f"[nodes.{place}]", "temperature")
    return (
        f'; or in the model file under {table} {name} = "start" for a log that begins at rest, {name} = 22 for a '
        f"constant [degC], or {name} = {{ value = 22, fixed = false }} for one that the fit finds"
    )


def _listing(table: Table) -> str:
    more = len(table.names) - 30
    return ", ".join(table.names[:30]) + (f" and {more} more" if more > 0 else "")


# --- A log opened by its path: one file or folder, or two logs of one run that are joined ---------


_PAIR = re.compile(r"(?P<first>.+?)\+(?P<second>[^+]+?)(?:@(?P<shift>[-+]?\d+(?:\.\d+)?))?")
_FORMATS = ".csv, .csv.gz, .parquet, .mcap, .db3 or .ulg file, or the folder of a ROS 2 bag"
_ENDINGS = (".gz", ".csv", ".parquet", ".mcap", ".db3", ".ulg", ".ulog")


def open_log(path: Path, columns: Mapping[str, ColumnSource]) -> tuple[Table, dict[str, ColumnSource]]:
    """Open what a path names, and give the mapping that is left for it.

    Args:
        path: a log; or two logs of one run, `a.csv+b.csv`, joined on the onset of heating, or with the second's clock
            set forward by so many seconds, `a.csv+b.csv@12.5`.
        columns: where the quantities stand.

    Raises:
        InputError: a log can't be opened, or the two can't be joined.
    """
    pair = pair_of(path)
    if pair is None:
        return open_table(path), dict(columns)
    from lptn.logs.joining import join

    first, second, shift = pair
    return join(path, open_table(first), open_table(second), shift, columns)


def open_table(path: Path) -> Table:
    """Open a log and read its column names.

    Raises:
        InputError: there is no such file, its format is not known, or it can't be read.
    """
    if not path.exists():
        raise InputError(path, "log", "no such file", f"a {_FORMATS}")
    if path.is_dir() and not (path / "metadata.yaml").is_file():
        raise InputError(path, "log", "a folder", f"a {_FORMATS} with its metadata.yaml")
    if path.is_dir() or path.suffix in {".mcap", ".db3"}:
        from lptn.logs.bags import open_bag

        return open_bag(path)
    if path.suffix in {".ulg", ".ulog"}:
        from lptn.logs.ulog import open_ulog

        return open_ulog(path)
    if path.name.endswith(".parquet"):
        return open_parquet(path)
    if path.name.endswith((".csv", ".csv.gz")):
        return open_csv(path)
    raise InputError(path, "log", f"the ending '{path.suffix}'", f"a {_FORMATS}")


def pair_of(path: Path) -> tuple[Path, Path, float | None] | None:
    """The two logs that a path `a.csv+b.csv` names, and the shift that it gives; `None` for the path of one log.

    The second is looked for beside the first, and then where its own path says. Where neither is found it is one path.

    Raises:
        InputError: more than two are named.
    """
    if path.exists() or "+" not in str(path):
        return None
    match = _PAIR.fullmatch(str(path))
    if match is None:
        return None
    if "+" in match["first"] and not Path(match["first"]).exists():
        raise InputError(path, "log", "more than two logs joined by +", "two: LOG+OTHER")
    first, second, shift = Path(match["first"]), Path(match["second"]), match["shift"]
    beside = first.parent / second
    second = beside if beside.exists() else second
    if not first.exists() and not second.exists():  # a + in the name of a folder, and no such file in it
        return None
    return first, second, None if shift is None else float(shift)


def run_name(path: Path) -> str:
    """What a run of this log is called: the file's name without its ending; of two, the first's."""
    pair = pair_of(path)
    name = (pair[0] if pair else path).name
    if (pair[0] if pair else path).is_dir():
        return name
    name = name.removesuffix(".gz")
    return name.rpartition(".")[0] if name.endswith(_ENDINGS) else name


# --- A log read into runs: mapped, checked, split at its gaps and resampled -----------------------


_FEWEST_STEPS = 10
_BEGINNING = 5.0  # s
GUESSED = "guessed: "
"""How notes on guessed columns begin."""


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
    a step holds about one sample.

    Args:
        log: a `.csv`, `.csv.gz`, `.parquet`, `.mcap`, `.db3` or `.ulg` file, the folder of a ROS 2 bag, two logs of one
            run with clocks of their own, `a.csv+b.csv` (see `lptn.logs.joining`), or a data frame with a column `time`
            [s], or an index of times.
        columns: where the quantities stand, for a log whose columns are not called `<quantity>.<place>`.
        name: what the run of a data frame is called; files have names of their own.
        step: s, of the runs; None for the log's own or 1 s, whichever is longer.
        max_gap: s, the longest gap in time or in an input that is bridged; None for max(10 s, 5 steps).
        inputs: `<feature>.<place>` columns that the model is driven by.
        outputs: temperature columns that the model predicts. Neither given: all columns are kept.
        optional: inputs that are kept where the log has them without a gap.
        strict: refuse values that can't be in the unit they are read in; else they are only among the runs' doubts.
        guessing: take columns whose names say what they hold for what is missing; the runs' notes say which.

    Returns:
        the runs in order of time, at least one.

    Raises:
        InputError: the file, a column or a value can't be used.
    """
    path = Path(name) if isinstance(log, pd.DataFrame) else Path(log)
    for setting, value in (("step", step), ("max_gap", max_gap)):
        if value is not None and not (math.isfinite(value) and value > 0):
            raise InputError(path, setting, f"{value:g} s", "a time above 0 s")
    if isinstance(log, pd.DataFrame):
        table, columns = table_of(log, name), dict(columns or {})
    else:
        table, columns = open_log(path, columns or {})
    guesses = guess(table, columns, inputs, outputs) if guessing else []
    columns |= {each.key: each.source for each in guesses}
    chosen = select(table, columns, inputs, outputs, optional)
    samples, notes, doubts = _load(table, chosen, strict)
    chosen, samples, spared = _without_gappy(chosen, samples, {*inputs, *outputs} or set(chosen.inputs), table.mixed)
    chosen, samples, emptied = _without_empty(table, chosen, samples)
    step, said = _grid(step, samples.period)
    max_gap = max_gap if max_gap is not None else max(10.0, 5 * step)
    if max_gap < 1.5 * samples.period:
        expected = f"more than 1.5 sampling periods of {samples.period:.3g} s"
        raise InputError(path, "max_gap", f"{max_gap:g} s", expected)
    guessed = [f"{GUESSED}{each.line} ({each.why})." for each in guesses]
    said = [*guessed, *filter(None, [recognised(table)]), *table.notes, *chosen.notes, *notes, *spared, *emptied, *said]
    return [replace(run, doubts=doubts) for run in _runs(table, chosen, samples, step, max_gap, said)]


def _load(table: Table, chosen: Selection, strict: bool) -> tuple[Samples, list[str], tuple[Suspicion, ...]]:
    """The log's samples in SI and degC, checked, notes, and what looks wrong."""
    numbers = table.numbers(name for source in chosen.sources.values() for name in source.columns)
    raw: dict[str, FloatArray] = {}
    notes: list[str] = []
    for key, source in chosen.sources.items():
        raw[key] = source.values(key, numbers)
        if key != "time":
            check_values(table, key, source, raw[key])
        if marked := source.missing(numbers):
            notes.append(f"{key}: {marked} of {raw[key].size} numbers are no readings, by its entry in [columns].")
    with np.errstate(over="ignore", invalid="ignore"):  # what overflows here is refused as a time below
        doubts = doubts_of(chosen.sources, numbers, raw)
    if strict:
        for doubt in doubts:
            if doubt.sure:
                raise InputError(table.path, f"column '{doubt.column}'", doubt.found, doubt.mend)
    time = raw.pop("time")
    keep, repeated = check_time(table, chosen.sources["time"].columns[0], time)
    if keep.size < time.size:
        time, raw = time[keep], {key: values[keep] for key, values in raw.items()}
    samples = Samples(time, raw)
    notes += [*repeated, *_temperature_notes(samples, table.mixed), *(doubt.sentence for doubt in doubts)]
    return samples, notes, doubts


def _temperature_notes(samples: Samples, mixed: bool) -> list[str]:
    notes = []
    for key, values in samples.raw.items():
        if not key.startswith("temperature."):
            continue
        missing = int(np.isnan(values).sum())
        if not 0 < missing < values.size:
            continue
        stamps = samples.time[~np.isnan(values)]
        usual = float(np.median(np.diff(stamps))) if stamps.size > 1 else 0.0
        if mixed or usual > 1.5 * samples.period:
            late = int((np.diff(stamps) > 1.5 * usual).sum())
            notes.append(f"{key}: logged every {usual:.4g} s{f', {late} times later' if late else ''}.")
        else:
            notes.append(f"{key}: {missing} of {values.size} readings are missing.")
    return notes + [f"{key}: sensor steps of {step:g} K." for key, step in _resolution(samples.raw).items()]


def _resolution(raw: Mapping[str, FloatArray]) -> dict[str, float]:
    """The step, K, of each temperature sensor that moves in steps."""
    steps = {key: quantisation_step(values) for key, values in raw.items() if key.startswith("temperature.")}
    return {key: step for key, step in steps.items() if step > 0}


def _without_gappy(
    chosen: Selection, samples: Samples, needed: Collection[str], mixed: bool
) -> tuple[Selection, Samples, list[str]]:
    """Leave out inputs that nobody needs and that would cut the log into pieces."""
    kept_anyway = {key for column in needed for key in raw_keys(column, samples.raw)}
    gappy = would_cut(samples.time, samples.period, samples.raw, kept_anyway.difference(chosen.outputs), mixed)
    spared = [
        column
        for column in chosen.inputs
        if column not in needed and not gappy.isdisjoint(raw_keys(column, samples.raw))
    ]
    if not spared:
        return chosen, samples, []
    inputs = tuple(column for column in chosen.inputs if column not in spared)
    kept = {key for column in (*inputs, *chosen.outputs) for key in raw_keys(column, samples.raw)}
    raw = {key: values for key, values in samples.raw.items() if key in kept}
    notes = [f"{column}: has gaps, and the model does not need it; left out." for column in spared]
    return replace(chosen, inputs=inputs), replace(samples, raw=raw), notes


def _without_empty(table: Table, chosen: Selection, samples: Samples) -> tuple[Selection, Samples, list[str]]:
    """Leave out columns that hold no number at all, unless the model can't do without."""
    empty = [key for key, values in samples.raw.items() if np.isnan(values).all()]
    if not empty:
        return chosen, samples, []
    rest = {key: values for key, values in samples.raw.items() if key not in empty}
    lost = [column for column in chosen.inputs if not all(key in rest for key in raw_keys(column, rest))]
    outputs = tuple(column for column in chosen.outputs if column in rest)
    inputs = tuple(column for column in chosen.inputs if column not in lost)
    none_left = not outputs and (chosen.outputs or not inputs)
    if (lost and not chosen.everything) or none_left:
        needed = {key for column in lost for key in raw_keys(column, samples.raw)}
        key = next((key for key in empty if key in needed), empty[0])
        place = f"column '{chosen.sources[key].columns[0]}'"
        raise InputError(table.path, place, "no value in any row", f"numbers for {key}")
    notes = [f"{key}: no value in any row; left out." for key in empty]
    return replace(chosen, inputs=inputs, outputs=outputs), replace(samples, raw=rest), notes


def _grid(step: float | None, period: float) -> tuple[float, list[str]]:
    """The runs' step, s, and a note where it is not what was asked for."""
    own = float(f"{period:.3g}")
    if step is None:
        return max(own, 1.0), []
    if step < own:
        return own, [f"time: sampled every {own:g} s, so steps of {own:g} s are used in place of {step:g} s."]
    return step, []


def _runs(
    table: Table, chosen: Selection, samples: Samples, step: float, max_gap: float, notes: list[str]
) -> list[Run]:
    path = table.path
    needed = {key: values for key, values in samples.raw.items() if key not in chosen.outputs}
    spans, gaps = find_stretches(samples.time, samples.period, needed, max_gap)
    if table.mixed:  # rows of several clocks follow each other at any distance
        gaps = [note for note in gaps if not (note.startswith("time: ") and "bridged" in note)]
    counts = [math.floor((stop - start) / step + 1e-6) for start, stop in spans]
    kept = [(start, n) for (start, _), n in zip(spans, counts, strict=True) if n >= _FEWEST_STEPS]
    if not kept:
        found = f"at most {max(counts, default=0)} steps of {step:g} s in one stretch"
        expected = f"a stretch of at least {_FEWEST_STEPS} steps without a gap over {max_gap:g} s"
        raise InputError(path, "log", found, expected)
    if len(kept) < len(spans):
        dropped = f"{len(spans) - len(kept)} of {len(spans)} stretches"
        gaps.append(f"log: {dropped} hold fewer than {_FEWEST_STEPS} steps of {step:g} s; dropped.")
    stem = run_name(path)
    whole = Run(
        name=stem,
        step=step,
        time=samples.time,
        columns={},
        averaged=step >= 1.5 * samples.period,
        source=str(path),
        fingerprint=table.digest(),
        notes=_merged([*notes, *gaps]),
        resolution=_resolution(samples.raw),
        beginning=_beginning(samples),
    )
    held = replace(samples, raw={key: hold(values) for key, values in needed.items()})
    runs = []
    for number, (start, n) in enumerate(kept, start=1):
        columns = driven(held, chosen.inputs, start, step, n) | measured(
            samples, chosen.outputs, start, step, n, max_gap
        )
        name = f"{stem}#{number}" if len(spans) > 1 else stem
        runs.append(replace(whole, name=name, time=grid(start, step, n), columns=columns))
    return runs


def _beginning(samples: Samples) -> dict[str, float]:
    """Mean of each temperature's readings in the log's first seconds; those that come later are left out."""
    early = samples.time < samples.time[0] + max(_BEGINNING, samples.period)
    found = {}
    for key, values in samples.raw.items():
        readings = values[early][np.isfinite(values[early])]
        if key.startswith("temperature.") and readings.size:
            found[key] = float(readings.mean())
    return found


def _merged(notes: list[str]) -> tuple[str, ...]:
    """Notes that say the same of several columns made one."""
    subjects: dict[str, list[str]] = {}
    for note in notes:
        subject, _, text = note.partition(": ")
        subjects.setdefault(text, []).append(subject)
    return tuple(f"{', '.join(names)}: {text}" for text, names in subjects.items())
