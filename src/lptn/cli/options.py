"""What the commands have in common: their options, checks before the work, processes, pictures."""

from __future__ import annotations

import io
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import Executor
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Parameter as Option
from cyclopts import Token, validators

from lptn.basics.errors import MODEL_FILE, InputError
from lptn.basics.files import PICTURES, TABLES, check_ending, real_path, text_of, write_whole
from lptn.basics.processes import pool_of
from lptn.cli.terminal import print_file, show_written

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from lptn.workbench.opening import Opening

# --- options -----------------------------------------------------------------------------------------------


WRITES = Option(name=["--output", "-o"])
"""The names of what a command writes."""
Output = Annotated[Path, WRITES, Option(help="File to write.")]
PRINTED = Path("-")
"""In place of a file's name: standard output."""
_BESIDE = "File to write; by default named after its source, in this folder; - prints the text."
Beginning = Annotated[Path | None, WRITES, Option(help=_BESIDE, allow_leading_hyphen=True)]
OptionalOutput = Annotated[Path | None, WRITES, Option(help="File to write the model to.")]
Json = Annotated[Path | None, Option(help="JSON file for the result.")]
Report = Annotated[Path | None, Option(help="HTML report to write.")]
HtmlReport = Annotated[Path | None, Option(help="HTML page to write, with zoomable charts.")]
Details = Annotated[bool, Option(help="Print all results below the answer.")]
ROWS = 6
"""Of a table in the answer; the details have all."""
Picture = Annotated[Path | None, Option(help="Picture to write: .png, .svg or .pdf.")]
Test = Annotated[
    list[Path] | None, Option(help="Test logs: only the final model predicts them.", consume_multiple=True)
]
Jobs = Annotated[int, Option(help="Number of processes.", validator=validators.Number(gte=1))]
NodeLimits = Annotated[list[str] | None, Option(help="Limit in degC, for all nodes or as NODE=90; may be repeated.")]
Coverage = Annotated[float, Option(help="Probability of the intervals.", validator=validators.Number(gt=0, lt=1))]


def _not_negative(_type: object, value: float | str) -> None:
    if not isinstance(value, str) and not value >= 0:
        raise ValueError("Must be >= 0, or auto.")


SymmetryPenalty = Annotated[
    float | Literal["auto"],
    Option(
        help="Weight of the left-right symmetry penalty; auto: the best one on held-out runs.", validator=_not_negative
    ),
]


def _time_or_after(_type: object, tokens: Sequence[Token]) -> float | str:
    """A time in the log's clock, or, with its sign kept, one after the log's start."""
    text = tokens[0].value.strip()
    try:
        float(text)
    except ValueError:
        raise ValueError(f"{text!r} is no time in s, nor seconds after the start such as +300") from None
    return text if text.startswith("+") else float(text)


@Option(name="*")
@dataclass(frozen=True)
class Columns:
    """How the columns of logs are read.

    Args:
        map: Which column is a quantity: temperature.FR_calf=T3[degF]; may be repeated. guess: by similar names.
        rate: Rows per second [Hz], for logs without a time column.
    """

    map: list[str] | None = None
    rate: Annotated[float | None, Option(validator=validators.Number(gt=0))] = None

    @property
    def texts(self) -> list[str]:
        """What both say together, as `--map` does."""
        return [*(self.map or ()), *([f"time=[rate={self.rate:.12g}]"] if self.rate is not None else [])]


@Option(name="*")
@dataclass(frozen=True)
class HeldOut(Columns):
    """What is held out of a fit.

    Args:
        holdout: Held-out logs: no parameter is fitted to them.
        holdout_after: Hold out the end of each fitted log, from this time in s; +300: from 300 s after its start.
    """

    holdout: Annotated[list[Path] | None, Option(consume_multiple=True)] = None
    holdout_after: Annotated[float | str | None, Option(converter=_time_or_after)] = None


@Option(name="*")
@dataclass(frozen=True)
class Data(HeldOut):
    """What is held out of a search, and how far its logs may be off.

    Args:
        ambient_error: Standard error of the ambient sensor in each run [K]; 0.3 by default, 0 if exact.
        torque_error: Relative standard error of torques or currents in each run; 0.015 by default, 0 if exact.
        surface_error: Relative standard error of a surface's heat loss in each run;
            0.03 by default, 0 in still or logged air.
    """

    ambient_error: Annotated[float | None, Option(validator=validators.Number(gte=0))] = None
    torque_error: Annotated[float | None, Option(validator=validators.Number(gte=0))] = None
    surface_error: Annotated[float | None, Option(validator=validators.Number(gte=0))] = None

    def opening(self, model: Path | None, logs: Sequence[Path], test: Sequence[Path] | None = None) -> Opening:
        """A model file with its logs and all this."""
        from lptn.workbench.opening import Opening

        errors = self.ambient_error, self.torque_error, self.surface_error
        held_out, columns = tuple(self.holdout or ()), tuple(self.texts)
        return Opening(model, tuple(logs), held_out, tuple(test or ()), self.holdout_after, columns, *errors)


COLUMNS, HELD_OUT, DATA = Columns(), HeldOut(), Data()
"""Nothing said of either."""


def limits_of(
    texts: Sequence[str] | None, every: str, option: str = "--limit", unit: str = "degC", place: str = "NODE"
) -> dict[str, float]:
    """Limits by place, or by pattern of places, those of all places first: the limit of one overrides it.

    Args:
        texts: `60` or `PLACE=60`.
        every: what stands for all places.
        option: the option's name, for messages.
        unit: of the limits, for messages.
        place: what a place is called, for messages.

    Raises:
        InputError: a text is no limit.
    """
    limits = {}
    for text in texts or ():
        name, equals, number = text.rpartition("=")
        try:
            value = float(number)
        except ValueError:
            value = float("nan")
        if not isfinite(value) or (equals and not name.strip()):
            raise InputError("command line", option, f"'{text}'", f"{unit} or {place}={unit}, such as 60 or {place}=70")
        limits[name.strip() if equals else every] = value
    return {every: limits.pop(every), **limits} if every in limits else limits


# --- checks before the work -------------------------------------------------------------------------------


def needs_logs(logs: tuple[Path, ...]) -> None:
    """Refuse a command without a log."""
    if not logs:
        raise InputError("command line", "LOGS", "no log", "one log file or more after the model file")


def check_inputs(model: Path, *logs: Path) -> None:
    """Refuse missing files before their readers are imported, which takes a second.

    Args:
        model: the model file.
        logs: logs; joined ones are left to the reader, which says more.

    Raises:
        InputError: the model file can't be read, or there is no such log.
    """
    text_of(model, MODEL_FILE)
    check_logs(*logs)


def check_logs(*logs: Path) -> None:
    """Refuse missing logs; as `check_inputs`."""
    for log in logs:
        if "+" not in str(log) and not log.exists():
            raise InputError(log, "log", "no such file", "the path of a log")


def check_outputs(
    *paths: Path | None,
    pictures: Sequence[Path | None] = (),
    tables: Sequence[Path | None] = (),
    drawings: Sequence[Path | None] = (),
    inputs: Iterable[Path] = (),
) -> None:
    """Refuse outputs that can't be written before the work begins.

    Args:
        paths: files that will be written.
        pictures: figures that will be.
        tables: tables that will be.
        drawings: networks that will be drawn.
        inputs: files that are read, and must not be lost.

    Raises:
        InputError: its folder does not exist, it is a folder itself, two results would go to one file, a result would
            take the place of what is read, or its name has not the ending of its kind.
    """
    given = [path for path in (*paths, *pictures, *tables, *drawings) if path is not None]
    for path in given:
        _check_output(path)
    read = {real_path(file) for path in inputs for file in _files_of(path)}
    for path in given:
        if real_path(path) in read:
            raise InputError(path, "output", "a file that is read", "another file, for this one would be lost")
    for number, path in enumerate(given):
        if path.absolute() in [other.absolute() for other in given[:number]]:
            raise InputError(path, "output", "one file for two results", "a file of its own for each")
    for some, endings in ((pictures, PICTURES), (tables, TABLES), (drawings, (".svg",))):
        for path in filter(None, some):
            check_ending(path, *endings)


def _check_output(path: Path) -> None:
    """Refuse a file that can't be written."""
    try:
        path.stat()
    except FileNotFoundError:
        pass
    except OSError as error:  # links in a circle, a file in place of a folder, a name that is too long
        raise InputError(path, "output", error.strerror or str(error), "a file that can be written") from error
    if path.is_dir():
        raise InputError(path, "output", "a folder", "a file in it")
    if not path.absolute().parent.is_dir():
        raise InputError(path, "output", "no such folder", "a file in a folder that exists")


def write_beginning(path: Path, text: str, what: str, next_: str, *, edited: bool = True) -> None:
    """Write a file that a person goes on with, and say what it is and what to do next; `-` prints it.

    Args:
        path: of the file.
        text: what stands in it.
        what: what it is.
        next_: what to do next.
        edited: whether a person edits it: results can be made again and are replaced, what was edited can't.

    Raises:
        InputError: an edited file is there and says something else, or it can't be written.
    """
    if path == PRINTED:
        print_file(text)
        return
    nothing_lost = (b"", text.encode("utf-8", "backslashreplace"))
    if edited and path.is_file() and path.read_bytes() not in nothing_lost:
        expected = "a new name, for what was changed in this one would be lost; or delete it first"
        raise InputError(path, "output", "a file that is there already", expected)
    write_whole(path, text)
    show_written({what: path}, next_)


def _files_of(path: Path) -> tuple[Path, ...]:
    """The files behind a path: of `a.csv+b.csv` both."""
    if "+" not in str(path):
        return (path,)
    from lptn.logs.reading import pair_of

    pair = pair_of(path)
    return (path,) if pair is None else pair[:2]


# --- work and its results ---------------------------------------------------------------------------------


def executor_of(jobs: int) -> AbstractContextManager[Executor | None]:
    """A pool of processes; `None` where one process does it all."""
    return pool_of(jobs) if jobs > 1 else nullcontext()


def write_figure(path: Path | None, made: Callable[[], Figure]) -> None:
    """Write a figure into a file of the kind that its name says (see `check_outputs`); nothing without a file.

    Args:
        path: of the file.
        made: makes the figure, if it is wanted.
    """
    if path is not None:
        picture = io.BytesIO()
        made().savefig(picture, format=path.suffix.lower().removeprefix("."))
        write_whole(path, picture.getvalue())


def write_page(path: Path | None, made: Callable[[], str]) -> None:
    """Write a page or a drawing; as `write_figure`."""
    if path is not None:
        write_whole(path, made())
