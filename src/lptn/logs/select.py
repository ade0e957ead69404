"""Which of a log's columns a model needs, and what to say when one is not there."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass

from lptn.errors import InputError
from lptn.logs.columns import ColumnSource
from lptn.logs.features import features_of, raw_keys
from lptn.logs.guess import guess
from lptn.logs.tables import Table, known_columns


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
