"""Files of test benches opened as tables: MDF4, TDMS, MATLAB's and HDF5.

Each holds groups of channels, and the channels of a group share their times. A file of one group is a table like any
other; those of several come on the union of their times. A channel is called by its own name, or `group.name` where
another group has one of that name.
"""

from __future__ import annotations

import logging
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, closing, contextmanager, nullcontext
from dataclasses import dataclass, field
from functools import partial
from itertools import takewhile
from pathlib import Path
from traceback import walk_tb
from typing import Any

import numpy as np
import numpy.typing as npt
import pandas as pd

from lptn.basics.arrays import FloatArray
from lptn.basics.bounds import Bound
from lptn.basics.errors import InputError
from lptn.basics.words import few
from lptn.logs.columns import ColumnName, ColumnSource, is_key, quantity_of, to_si
from lptn.logs.guess import name_of_time
from lptn.logs.tables import (
    COLUMNS,
    MOST_NUMBERS,
    Source,
    Table,
    refuse_too_large,
    require_package,
    table_of_sources,
    too_large,
)

Numbers = npt.NDArray[Any]
_NUMBERS, _TIMES = "fiub", "mM"  # kinds of NumPy's types
_MOST_WIDE = 1000
"""Columns of a matrix that are taken for channels; a wider one is a picture or a map."""
_CLOCK = "time"  # what times are called that are no channel
_DEEPEST = Bound(100, "groups within each other")  # of HDF5: 1,000 take a second each time, 3,000 ten


@dataclass(frozen=True)
class Group:
    """Channels of one clock.

    Attributes:
        name: of the group, as in the file.
        channels: their names; `read` gives the numbers of some, (rows,) each.
        rows: how many numbers each has.
        clock: gives the times [s], (rows,), where no channel holds them.
        units: of channels, by their names, where the file says them.
    """

    name: str
    channels: tuple[str, ...]
    rows: int
    read: Callable[[Sequence[str]], Mapping[str, Numbers]]
    clock: Callable[[], FloatArray] | None = None
    units: Mapping[str, str] = field(default_factory=dict)

    @property
    def time(self) -> str | None:
        """The channel that holds the times, by its name."""
        return None if self.clock else name_of_time(self.channels)

    def times(self) -> FloatArray:
        """The times [s]."""
        if self.clock is not None:
            return self.clock()
        name = self.time or ""
        unit = self.units.get(name) or ColumnName.of(name).unit("time") or None
        return to_si(_seconds(self.read([name])[name]), "time", unit)


def _seconds(values: Numbers) -> FloatArray:
    """Dates in s since 1970 and durations in s, numbers as they are."""
    if values.dtype.kind in _TIMES:
        return np.asarray(values.astype(f"{values.dtype.kind}8[ns]").astype(np.int64) / 1e9)
    return np.asarray(values, dtype=np.float64)


def _table(path: Path, groups: Sequence[Group], kind: str) -> Table:
    """The groups as one table.

    Raises:
        InputError: there is no channel of numbers.
    """
    groups = [group for group in groups if group.channels and group.rows]
    if not groups:
        expected = f"a {kind} with channels and their times; tables of MATLAB as structs of vectors"
        raise InputError(path, "log", "no channel of two numbers or more", expected)
    notes = []
    if len(groups) > 1 and (lost := [group for group in groups if group.clock is None and group.time is None]):
        groups = [group for group in groups if group not in lost]
        named = few([group.name or few(group.channels) for group in lost])
        notes = [f"{named}: no channel called time or t of that length; left out."]
        if not groups:
            raise InputError(path, "log", f"no times in {named}", "a channel of times in each group")
    counts = Counter(name for group in groups for name in group.channels if name != group.time or len(groups) == 1)
    COLUMNS.check(sum(counts.values()), path, "columns")

    def called(group: Group, name: str) -> str:
        return name if counts[name] == 1 and name != _CLOCK else f"{group.name}.{name}".removeprefix(".")

    units = {called(group, name): unit for group in groups for name, unit in group.units.items() if unit}
    said = {name: ColumnName.of(name, unit).unit(quantity_of(name)) for name, unit in units.items() if is_key(name)}
    defaults = {name: ColumnSource((name,), unit) for name, unit in said.items() if unit}
    units = {name: unit for name, unit in units.items() if name not in defaults}
    known: dict[str, Any] = {"defaults": defaults, "units": units, "notes": notes}
    if len(groups) == 1:
        return _table_of_one(path, groups[0], kind, known)
    channels = [[(called(group, name), name) for name in group.channels if name != group.time] for group in groups]

    def sources(wanted: Sequence[str]) -> Iterator[Source]:
        for group, pairs in zip(groups, channels, strict=True):
            asked = [pair for pair in pairs if pair[0] in wanted]
            if asked or set(wanted) == {_CLOCK}:
                numbers = group.read([name for _, name in asked])
                yield group.times(), {own: _seconds(numbers[name]) for own, name in asked}

    names = (_CLOCK, *(own for pairs in channels for own, _ in pairs))
    return table_of_sources(path, names, lambda wanted: list(sources(wanted)), kind, **known)


def _table_of_one(path: Path, group: Group, kind: str, known: Mapping[str, Any]) -> Table:
    """A group as a table, with its times in front where no channel holds them."""
    clock = [_CLOCK] if group.clock else []
    names = (*clock, *(name for name in group.channels if name not in clock))

    def read(wanted: Sequence[str]) -> pd.DataFrame:
        refuse_too_large(path, group.rows, len(wanted))
        columns = dict(group.read([name for name in wanted if name not in clock]))
        columns |= {name: group.times() for name in clock if name in wanted}
        return pd.DataFrame({name: columns[name] for name in wanted}, copy=False)

    return Table(path, names, read, kind=kind, **known)


# --- The formats ------------------------------------------------------------------------------------------


def open_mdf(path: Path) -> Table:
    """Open an MDF4 file; its channels' conversions are applied, those that give words are left out.

    Raises:
        InputError: the package asammdf is not installed, or the file can't be read.
    """
    require_package(path, "asammdf", "an MDF4 file", "pip install 'lptn[bench]'")

    def numbers_of(group: int, names: Sequence[str]) -> dict[str, Numbers]:
        with _mdf(path) as file:
            return {name: file.get(group=group, index=at[group][name]).samples for name in names}

    def times_of(group: int) -> FloatArray:
        with _mdf(path) as file:
            return np.asarray(file.get_master(group), np.float64)

    kind, groups = "MDF4 file", []
    at = list[dict[str, int]]()  # of each group the channels' numbers, by their names
    with _mdf(path) as file:
        for number, group in enumerate(file.groups):
            units: dict[str, str] = {}
            at.append({})
            for index, channel in enumerate(group.channels):
                first: Numbers = file.get(group=number, index=index, record_offset=0, record_count=1).samples
                is_numeric = first.dtype.kind in _NUMBERS and first.ndim == 1
                if is_numeric and index != file.masters_db.get(number):
                    name = channel.name if channel.name not in units else f"{channel.name}:{index}"
                    units[name], at[number][name] = channel.unit or "", index
            name, rows = getattr(group.channel_group, "acq_name", ""), int(group.channel_group.cycles_nr)
            read, clock = partial(numbers_of, number), partial(times_of, number)
            groups.append(Group(name or f"group{number}", tuple(units), rows, read, clock, units))
    return _table(path, groups, kind)


@contextmanager
def _mdf(path: Path) -> Iterator[Any]:
    from asammdf import MDF
    from asammdf.blocks.mdf_v4 import MDF4

    with path.open("rb") as stream:
        try:
            file: Any = MDF(stream)
        except Exception as error:
            for frame, _ in walk_tb(error.__traceback__):
                if isinstance(half := frame.f_locals.get("self"), MDF4) and not half._closed:
                    half._closed = True  # else it closes what it never opened, and prints an error of its own
                    half._tempfile.close()
            raise
        with closing(file):
            yield file


def open_tdms(path: Path) -> Table:
    """Open a TDMS file; a group's times are its waveforms' or those of its channel of times.

    Raises:
        InputError: the package npTDMS is not installed, or the file can't be read.
    """
    require_package(path, "nptdms", "a TDMS file", "pip install 'lptn[bench]'")
    from nptdms import TdmsFile
    from nptdms.log import log_manager

    log_manager.set_level(logging.ERROR)  # it prints what it finds odd

    def numbers_of(group: str, names: Sequence[str]) -> dict[str, Numbers]:
        with path.open("rb") as stream, TdmsFile.open(stream) as file:
            return {name: np.asarray(file[group][name][:]) for name in names}

    def times_of(group: str, name: str) -> FloatArray:
        with path.open("rb") as stream, TdmsFile.open(stream) as file:
            channel = file[group][name]
            channel.properties.setdefault("wf_start_offset", 0.0)  # which some writers leave out
            return _seconds(channel.time_track(absolute_time="wf_start_time" in channel.properties))

    kind, groups = "TDMS file", []
    with path.open("rb") as stream, TdmsFile.open(stream) as file:
        for group in file.groups():
            numeric = [channel for channel in group.channels() if channel.dtype.kind in _NUMBERS + _TIMES]
            lengths = dict.fromkeys(map(len, numeric))
            for rows in lengths:  # a slow channel and a fast one may share a group
                units = {c.name: str(c.properties.get("unit_string", "")) for c in numeric if len(c) == rows}
                first = next(channel for channel in numeric if len(channel) == rows)
                name = group.name if len(lengths) == 1 else f"{group.name}.{rows}"
                clock = partial(times_of, group.name, first.name) if "wf_increment" in first.properties else None
                groups.append(Group(name, tuple(units), rows, partial(numbers_of, group.name), clock, units))
    return _table(path, groups, kind)


def open_mat(path: Path) -> Table:
    """Open a MATLAB file, of version 7.3 or before: its vectors, matrices and structs of them.

    Raises:
        InputError: it can't be read.
    """
    from scipy.io import loadmat, whosmat

    kind = "MATLAB file"
    if _is_hdf5(path):
        return open_hdf5(path, kind)
    with path.open("rb") as file:
        stream: Any = file  # not by its path: of a broken file the library leaves it open
        numbers = sum(int(np.prod(shape, dtype=float)) for _, shape, _ in whosmat(stream))
        if numbers > MOST_NUMBERS:
            raise too_large(path, f"{numbers} numbers")
        content = loadmat(stream, simplify_cells=True, verify_compressed_data_integrity=True)
    arrays = dict(_arrays({name: value for name, value in content.items() if not name.startswith("__")}))
    return _table(path, _by_length(lambda: nullcontext(arrays)), kind)


def _arrays(content: Mapping[str, Any], within: str = "") -> Iterator[tuple[str, Any]]:
    """All that structs hold, by names such as `log.motor.T`."""
    for name, value in content.items():
        if isinstance(value, Mapping):
            yield from _arrays(value, f"{within}{name}.")
        else:
            yield f"{within}{name}", value


def open_hdf5(path: Path, kind: str = "HDF5 file") -> Table:
    """Open an HDF5 file: its datasets of one column, of several, or of named fields.

    Raises:
        InputError: the package h5py is not installed, or the file can't be read, or leads to another folder's files.
    """
    require_package(path, "h5py", f"an HDF5 file ({kind})", "pip install 'lptn[bench]'")
    import h5py

    @contextmanager
    def datasets() -> Iterator[dict[str, Any]]:
        found: dict[str, Any] = {}

        def visit(name: str, item: Any) -> None:
            _DEEPEST.check(name.count("/"), path, "log")
            text = item.attrs.get("MATLAB_class", b"") == b"char"
            if isinstance(item, h5py.Dataset) and not text and not name.startswith("#"):
                others = [file for file, *_ in item.external or ()]
                others += [source.file_name for source in item.virtual_sources()] if item.is_virtual else []
                if far := [file for file in others if file not in (".", Path(file).name)]:  # "." is the log
                    expected = "numbers in the log itself, or in files beside it"
                    raise InputError(path, name, f"numbers of the file {far[0]!r}", expected)
                found[name.replace("/", ".")] = item

        with h5py.File(path) as file:
            file.visititems(visit)
            yield found

    return _table(path, _by_length(datasets), kind)


def _is_hdf5(path: Path) -> bool:
    """Whether a file begins as HDF5 does, at once or behind MATLAB's 512 bytes, or as MATLAB says of one."""
    with path.open("rb") as stream:
        return stream.read(10) == b"MATLAB 7.3" or any(
            stream.seek(start) == start and stream.read(8) == b"\x89HDF\r\n\x1a\n" for start in (0, 512)
        )


Arrays = Callable[[], AbstractContextManager[Mapping[str, Any]]]
"""Opens all arrays of a file, by their names."""


def _vectors(arrays: Mapping[str, Any]) -> Iterator[tuple[str, tuple[int, str, Any]]]:
    """The columns of numbers by their names: how many each has, the array that it is of, and its index there."""
    for name, value in arrays.items():
        dtype: Any = getattr(value, "dtype", None)
        shape: tuple[int, ...] = getattr(value, "shape", ()) or ()  # of an empty dataset there is none
        if dtype is None or not 1 <= len(shape) <= 2 or 0 in shape:
            continue
        if dtype.names:
            plain = [part for part in dtype.names if dtype[part].kind in _NUMBERS + _TIMES and not dtype[part].shape]
            yield from ((f"{name}.{part}", (shape[0], name, part)) for part in plain)
        elif dtype.kind in _NUMBERS + _TIMES and len(shape) == 1:
            yield name, (shape[0], name, ...)
        elif dtype.kind in _NUMBERS + _TIMES and min(shape) <= _MOST_WIDE:
            on_its_side = shape[0] < shape[1]  # as MATLAB lays a matrix in HDF5
            for part in range(wide := min(shape)):
                index = (part, slice(None)) if on_its_side else (slice(None), part)
                yield name if wide == 1 else f"{name}.{part}", (max(shape), name, index)


def _by_length(opened: Arrays) -> list[Group]:
    """Groups of one length; where several of that length have times of their own, of one parent and length."""
    with opened() as arrays:
        vectors = dict(_vectors(arrays))
    groups: dict[tuple[int, str], list[str]] = {}
    for rows in dict.fromkeys(rows for rows, _, _ in vectors.values() if rows > 1):
        names = [name for name, vector in vectors.items() if vector[0] == rows]
        parents: dict[str, list[str]] = {}
        for name in names:
            parents.setdefault(name.rpartition(".")[0], []).append(name)
        timed = [parent for parent, own in parents.items() if name_of_time(own)]
        if len(timed) > 1:
            for parent, own in parents.items():  # what has no times of its own has those of what it is in
                above = [other for other in timed if f"{parent}.".startswith(f"{other}." if other else "")]
                groups.setdefault((rows, max(above, key=len, default=parent)), []).extend(own)
        else:
            levels = zip(*(parent.split(".") for parent in parents), strict=False)
            common = takewhile(lambda words: len(set(words)) == 1, levels)
            groups[rows, ".".join(words[0] for words in common)] = names

    def read(full: Mapping[str, str], wanted: Sequence[str]) -> dict[str, Numbers]:
        with opened() as arrays:
            of = {name: vectors[full[name]][1:] for name in wanted}
            return {name: np.asarray(arrays[array][index]).reshape(-1) for name, (array, index) in of.items()}

    return [
        Group(parent, tuple(full), rows, partial(read, full))
        for (rows, parent), names in groups.items()
        for full in [{name.removeprefix(f"{parent}."): name for name in names}]
    ]
