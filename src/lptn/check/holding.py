"""One log as a model sees it: its format, its columns, used and not, and the lines that would map what is missing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from lptn.errors import InputError
from lptn.logs import Run
from lptn.logs.guess import Guess, guess, missing_keys
from lptn.logs.opening import open_log
from lptn.logs.select import select
from lptn.opening import Opened, optional_columns
from lptn.simulate import needed_columns


@dataclass(frozen=True)
class Held:
    """What one log holds.

    Args:
        path: as the user wrote it.
        kind: its format.
        used: for each quantity that is used the columns that it stands in.
        unused: the other columns.
        guesses: columns that may hold what is missing; taken only where the user asked for it.
        runs: what was read; empty if the log can't be used.
        refused: why it can't.
        wanting: quantities that the model needs and that nothing in the log is known to hold.
        currents: columns that may hold the currents of joints whose torques are wanting.
    """

    path: Path
    kind: str
    used: dict[str, tuple[str, ...]]
    unused: tuple[str, ...]
    guesses: tuple[Guess, ...]
    runs: tuple[Run, ...]
    refused: InputError | None = None
    wanting: tuple[str, ...] = ()
    currents: tuple[Guess, ...] = ()

    @property
    def wrong(self) -> list[str]:
        """What can't be right, a sentence each, with the line that would mend it."""
        return list(dict.fromkeys(doubt.sentence for run in self.runs for doubt in run.doubts))

    @property
    def notes(self) -> list[str]:
        """What else was found, and how it was treated."""
        return [
            note for note in dict.fromkeys(note for run in self.runs for note in run.notes) if note not in self.wrong
        ]

    def as_json(self) -> dict[str, object]:
        """For other programs."""
        return {
            "log": str(self.path),
            "format": self.kind,
            "used": {key: list(columns) for key, columns in self.used.items()},
            "unused": list(self.unused),
            "wrong": [
                {
                    "quantity": doubt.key,
                    "column": doubt.column,
                    "found": doubt.found,
                    "mend": doubt.mend,
                    "sure": doubt.sure,
                }
                for doubt in (self.runs[0].doubts if self.runs else ())
            ],
            "notes": self.notes,
            "guesses": [
                {"quantity": each.key, "line": each.line, "map": each.option, "why": each.why} for each in self.guesses
            ],
            "wanting": list(self.wanting),
            "runs": [
                {
                    "name": run.name,
                    "step": run.step,
                    "steps": len(run),
                    "averaged": run.averaged,
                    "sha256": run.fingerprint,
                }
                for run in self.runs
            ],
            "refused": str(self.refused) if self.refused else None,
        }


def held(opened: Opened, log: Path) -> Held:
    """Look at one log.

    Args:
        opened: the model file that it is for.
        log: its path.

    Raises:
        InputError: it can't be opened at all.
    """
    inputs, outputs = needed_columns(opened.model)
    table, columns = open_log(log, opened.columns)
    guesses = tuple(guess(table, columns, inputs, outputs))
    if opened.guessing:
        columns |= {each.key: each.source for each in guesses}
    wanting = tuple(missing_keys(table, columns, inputs, outputs))
    drives = [key.replace("torque.", "current.") for key in wanting if key.startswith("torque.")]
    currents = tuple(each for each in guess(table, columns, drives, outputs) if each.key in drives)
    used: dict[str, tuple[str, ...]] = {}
    runs: Sequence[Run] = ()
    refused = None
    try:
        chosen = select(table, columns, inputs, outputs, optional_columns(opened.model))
        used = {key: source.columns for key, source in chosen.sources.items()}
        runs = opened.runs([log], strict=False)
    except InputError as error:
        refused = error
    taken = {name for names in used.values() for name in names}
    unused = tuple(name for name in dict.fromkeys(table.names) if name not in taken)
    return Held(log, table.kind, used, unused, guesses, tuple(runs), refused, wanting, currents)
