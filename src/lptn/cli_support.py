"""What the commands have in common: their options, logs opened by their jobs, processes, pictures."""

from __future__ import annotations

import io
import shlex
import sys
from collections.abc import Iterator
from concurrent.futures import Executor, ProcessPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter as Option

from lptn.errors import InputError

if TYPE_CHECKING:
    from lptn.compare import Comparison
    from lptn.evidence import Evidence
    from lptn.opening import Opened

Output = Annotated[Path, Option(name=["--output", "-o"], help="File to write.")]
OptionalOutput = Annotated[Path | None, Option(name=["--output", "-o"], help="File to write the model to.")]
Json = Annotated[Path | None, Option(name="--json", help="File to write the result to, for programs.")]
Holdout = Annotated[
    list[Path] | None,
    Option(name="--holdout", help="Logs that no fit sees.", negative="", consume_multiple=True),
]
HoldoutAfter = Annotated[
    float | None,
    Option(name="--holdout-after", help="Hold out the fitted logs' own time from here on, in s."),
]
Proof = Annotated[
    list[Path] | None,
    Option(name="--proof", help="Logs looked at once, at the end.", negative="", consume_multiple=True),
]
Map = Annotated[
    list[str] | None,
    Option(
        name="--map",
        help="Other people's column: temperature.FR_calf=T3[degF]; may be given again.",
        negative="",
    ),
]
Jobs = Annotated[int, Option(name="--jobs", help="Processes that refit candidates side by side.")]


def open_by_job(
    model: Path,
    logs: tuple[Path, ...],
    holdout: list[Path] | None,
    holdout_after: float | None,
    proof: list[Path] | None,
    mapped: list[str] | None,
) -> tuple[Opened, Evidence]:
    """The model file, and the logs arranged by what they are for."""
    from lptn.evidence import evidence
    from lptn.opening import open_model

    needs_logs(logs)
    opened = open_model(model, mapped or ())
    fitted, held, proving = (opened.runs(group) for group in (logs, holdout or [], proof or []))
    return opened, evidence(fitted, held, proving, holdout_after)


def needs_logs(logs: tuple[Path, ...]) -> None:
    """Refuse a command without a log."""
    if not logs:
        raise InputError("command line", "LOGS", "no log", "one log file or more after the model file")


@contextmanager
def executor_of(jobs: int) -> Iterator[Executor | None]:
    """A pool of processes; `None` where one process does it all."""
    if jobs <= 1:
        yield None
        return
    with ProcessPoolExecutor(jobs) as pool:
        yield pool


def write_figure(comparison: Comparison, path: Path) -> None:
    """Draw a comparison into a file of the kind that its name says."""
    from lptn.files import write_whole
    from lptn.report import comparison_figure

    kind = path.suffix.lower().removeprefix(".")
    if kind not in {"png", "svg", "pdf"}:
        raise InputError(path, "--plot", f"a file name ending in '{path.suffix}'", "one ending in .png, .svg or .pdf")
    picture = io.BytesIO()
    comparison_figure(comparison).savefig(picture, format=kind)
    write_whole(path, picture.getvalue())


def typed() -> str:
    """The command as it was typed, for the report."""
    return " ".join(["lptn", *(shlex.quote(word) for word in sys.argv[1:])])
