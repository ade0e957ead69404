"""What one log holds as a model sees it: which columns are used, which may be meant, what is wrong, what is missing."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from lptn.basics.errors import InputError
from lptn.identify.data import LoadedModel, optional_columns
from lptn.logs.columns import ColumnSource
from lptn.logs.guess import Guess, guess, missing_keys
from lptn.logs.issue import Issue
from lptn.logs.reading import choose_columns, open_log
from lptn.logs.run import Run
from lptn.logs.tables import Table, column_sources
from lptn.report.text import time_span
from lptn.simulate.bound_run import needed_columns


@dataclass(frozen=True)
class LogContent:
    """What one log holds.

    Args:
        path: as the user wrote it.
        table: the log, opened.
        sources: where quantities stand in it, by their own names and the mapping.
        used: the columns of each quantity that is used.
        guesses: columns that may hold what is missing; taken only where the user asked for it.
        runs: what was read; empty if the log can't be used.
        refused: why it can't.
        missing: quantities that the model needs and the log lacks.
        currents: columns that may hold the currents of joints whose torques are missing.
    """

    path: Path
    table: Table
    sources: Mapping[str, ColumnSource]
    guesses: tuple[Guess, ...]
    runs: tuple[Run, ...] = ()
    used: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    refused: InputError | None = None
    missing: tuple[str, ...] = ()
    currents: tuple[str, ...] = ()

    @classmethod
    def of(cls, loaded: LoadedModel, log: Path) -> LogContent:
        """Look at one log.

        Raises:
            InputError: it can't be opened at all.
        """
        inputs, outputs = needed_columns(loaded.model)
        sources, given = loaded.sources_of(log)
        inputs = [key for key in inputs if key not in given]
        table, columns = open_log(log, sources)
        optional = [key for key in optional_columns(loaded.model) if key not in given]
        guesses = tuple(guess(table, columns, inputs, outputs, optional))
        if loaded.guessing:
            columns |= {proposal.key: proposal.source for proposal in guesses}
        missing = tuple(missing_keys(table, columns, inputs, outputs))
        currents = [key.replace("torque.", "current.") for key in missing if key.startswith("torque.")]
        logged_currents = [key for key in currents if key in table.names]
        of_currents = guess(table, columns, currents, outputs) if currents else []
        logged_currents += [proposal.source.columns[0] for proposal in of_currents if proposal.key in currents]
        used: dict[str, tuple[str, ...]] = {}
        runs: Sequence[Run] = ()
        refused = None
        try:
            chosen = choose_columns(table, columns, inputs, outputs, optional)
            used = {key: source.columns for key, source in chosen.sources.items()}
            runs = loaded.runs([log], strict=False)
        except InputError as error:
            refused = error
        where = column_sources(table, columns)
        return cls(log, table, where, guesses, tuple(runs), used, refused, missing, tuple(logged_currents))

    @property
    def kind(self) -> str:
        """Its format."""
        return self.table.kind

    @property
    def unused(self) -> tuple[str, ...]:
        """The columns that are not used."""
        taken = {name for names in self.used.values() for name in names}
        return tuple(name for name in dict.fromkeys(self.table.names) if name not in taken)

    @property
    def lengths(self) -> str:
        """How long it is, in words."""
        if not self.runs:
            return "it can't be used yet"
        steps, first = sum(len(run) for run in self.runs), self.runs[0]
        kind = "means" if first.averaged else "samples"
        pieces = f" in {len(self.runs)} pieces between gaps" if len(self.runs) > 1 else ""
        return f"{steps} {kind} of {first.step:g} s, {time_span(steps * first.step)}{pieces}"

    @property
    def issues(self) -> list[Issue]:
        """What seems wrong, run by run."""
        return [issue for run in self.runs for issue in run.issues]

    @property
    def error(self) -> InputError | None:
        """Why other commands refuse it; `None` where they take it."""
        certain = (InputError(self.path, *issue.error) for issue in self.issues if issue.certain)
        return self.refused or next(certain, None)

    @property
    def wrong(self) -> list[str]:
        """What seems wrong, each with the line that would correct it."""
        return list(dict.fromkeys(issue.sentence for issue in self.issues))

    @property
    def notes(self) -> list[str]:
        """What else was noticed, and how it was treated."""
        notes = dict.fromkeys(note for run in self.runs for note in run.notes)
        return [note for note in notes if note not in self.wrong]
