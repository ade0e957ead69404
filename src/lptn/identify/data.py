"""From files to data: a model file with its logs; which segments of which runs are fitted, held out, or test."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import pandas as pd

from lptn.basics.errors import InputError
from lptn.basics.places import is_of_run
from lptn.effects import catalogue
from lptn.logs.columns import ColumnSource, parse_map_option
from lptn.logs.reading import GUESSED, read_log
from lptn.logs.run import Run
from lptn.model.file import ModelFile, read_model_file
from lptn.model.heat_balance import input_column
from lptn.model.model import Model
from lptn.model.network import Network
from lptn.simulate.simulation import needed_columns

# --- Effects that are confined to a run which none of the logs is: a slip of the pen would switch them off in silence ---


def absent_runs(network: Network, runs: Iterable[Run]) -> list[str]:
    """What to say of each name of a run, or glob of names, that no log answers to; nothing without logs.

    Args:
        network: its effects name the runs that they act in.
        runs: all runs that were opened, whatever for.
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


def say_absent_runs(network: Network, runs: Iterable[Run]) -> None:
    """Say it on standard output, a line each."""
    for told in absent_runs(network, runs):
        print(f"Warning: {told}.")


def _listed(names: Sequence[str], most: int = 8) -> str:
    return ", ".join(names[:most]) + (f" and {len(names) - most} more" if len(names) > most else "")


# --- Which stretches of which runs fit, choose and prove a model ----------------------------------


Window = tuple[float, float]
_OPENING_SHARE = 0.1
_LEAST_OPENING = 60.0  # s
_LEAST_OPENING_STEPS = 10
_LEAST_STEPS_KEPT = 300  # a coarsened run keeps at least so many


@dataclass(frozen=True)
class Segment:
    """A run with the window that finds its initial temperatures and the window in which errors count.

    A model's prediction needs a start. On runs that the fit never saw it comes from the run's opening, and
    only what lies behind the opening is counted as predicted.
    """

    run: Run
    opening: Window
    counted: Window

    def coarsened(self, step: float) -> Segment:
        """The same part in steps of about `step` seconds, where the run is long enough to spare them."""
        factor = min(round(step / self.run.step), len(self.run) // _LEAST_STEPS_KEPT)
        return self if factor < 2 else replace(self, run=self.run.coarsen(factor))


@dataclass(frozen=True)
class DataSplit:
    """Three sets of data with three jobs.

    Args:
        fit: parameters are fitted, and missing effects chosen, on these.
        holdout: say where the ladder ends.
        proof: looked at once, when all is decided.
    """

    fit: tuple[Segment, ...]
    holdout: tuple[Segment, ...] = ()
    test: tuple[Segment, ...] = ()

    def coarsened(self, step: float) -> DataSplit:
        """All parts in steps of about `step` seconds."""
        parts = (self.fit, self.holdout, self.test)
        return DataSplit(*(tuple(part.coarsened(step) for part in group) for group in parts))


def split_data(
    runs: Sequence[Run],
    holdout: Sequence[Run] = (),
    test: Sequence[Run] = (),
    holdout_after: float | None = None,
) -> DataSplit:
    """Arrange runs by their jobs.

    Args:
        runs: to fit.
        holdout: runs held out whole.
        proof: runs looked at once, at the end.
        holdout_after: time [s, in each log's clock] from which the fitted runs themselves are held out.

    Raises:
        InputError: `holdout_after` leaves nothing to fit, or nothing to hold out.
    """
    if holdout_after is None:
        return DataSplit(tuple(_whole(run) for run in runs), _predicted(holdout), _predicted(test))
    fitted = [run for run in runs if (run.time < holdout_after).sum() >= _LEAST_OPENING_STEPS]
    continued = [run for run in fitted if (run.time >= holdout_after).sum() >= _LEAST_OPENING_STEPS]
    if not fitted or not continued:
        span = f"{min(run.time[0] for run in runs):g} to {max(run.time[-1] for run in runs):g} s"
        raise InputError("--holdout-after", f"{holdout_after:g} s", f"logs from {span}", "a time inside a log")
    before, after = (float("-inf"), holdout_after), (holdout_after, float("inf"))
    later = tuple(Segment(run, before, after) for run in continued)
    return DataSplit(
        tuple(Segment(run, before, before) for run in fitted), (*later, *_predicted(holdout)), _predicted(test)
    )


def predicted(run: Run) -> Segment:
    """A run to be predicted: its opening finds the start, the rest counts."""
    length = max(_OPENING_SHARE * len(run) * run.step, _LEAST_OPENING, _LEAST_OPENING_STEPS * run.step)
    # A short run can't spare so much.
    border = run.time[0] + min(length, 0.5 * len(run) * run.step)
    return Segment(run, (float("-inf"), border), (border, float("inf")))


def _predicted(runs: Sequence[Run]) -> tuple[Segment, ...]:
    return tuple(predicted(run) for run in runs)


def _whole(run: Run) -> Segment:
    everything = (float("-inf"), float("inf"))
    return Segment(run, everything, everything)


# --- A model file and logs opened together: the logs are read for what the model, and the catalogue, can use ---


GUESS = "guess"
"""What `--map` says to have columns guessed."""

Tell = Callable[[Path, str], None]
Log = str | Path | pd.DataFrame
"""A log: the path of a file or folder, or a data frame."""


def _on_stderr(log: Path, note: str) -> None:
    print(f"lptn: {log}: {note}", file=sys.stderr)


@dataclass(frozen=True)
class LoadedModel:
    """A model file, its model, and a reader that brings logs to it.

    Args:
        file: the model file.
        model: the model that it declares.
        mapped: columns mapped on the command line, over those of the file.
        guessing: columns that are still missing are guessed from names, and said.
    """

    file: ModelFile
    model: Model
    mapped: dict[str, str]
    guessing: bool = False

    @property
    def columns(self) -> dict[str, ColumnSource]:
        """Where the quantities stand, by the file and by the command line."""
        return self.file.columns | dict(parse_map_option(f"{key}={text}") for key, text in self.mapped.items())

    def runs(
        self, logs: Sequence[Log], *, strict: bool = True, tell: Tell = _on_stderr, named: str = "log"
    ) -> list[Run]:
        """Every run of the logs, in order; what was guessed or looks wrong is told.

        Args:
            logs: paths of logs, `a.csv+b.csv` for two of one run; or data frames.
            named: what runs of data frames are called, their number in `logs` behind it.
            tell: given a log and a sentence about it; by default it goes to the error stream.
            strict: refuse values that can't be in the unit they are read in, and say what is doubtful; else both are
                left to who looks at the runs' doubts.

        Raises:
            InputError: a log can't be used, or lacks a column that the model needs.
        """
        inputs, outputs = needed_columns(self.model)
        found = []
        for number, log in enumerate(logs, start=1):
            runs = read_log(
                log,
                self.columns,
                name=f"{named}{number}",
                step=self.file.step,
                inputs=inputs,
                outputs=outputs,
                optional=optional_columns(self.model),
                strict=strict,
                guessing=self.guessing,
            )
            doubts = [doubt.sentence for doubt in runs[0].doubts] if strict else []
            for note in [*(note for note in runs[0].notes if note.startswith(GUESSED)), *doubts]:
                tell(Path(runs[0].source), note)
            found += runs
        return found


def load_model(path: str | Path, mapped: Sequence[str] = ()) -> LoadedModel:
    """Read a model file.

    Args:
        path: the model file.
        mapped: `--map` options, such as `"temperature.FR_calf=T3[degF]"`; they win over the file's `[columns]`. The
            word `guess` among them has columns that are still missing guessed from names.

    Raises:
        InputError: the file or an option can't be used.
    """
    pairs = dict(_pair(text) for text in mapped if text.strip() != GUESS)
    file = read_model_file(Path(path))
    return LoadedModel(file, Model(file.network), pairs, any(text.strip() == GUESS for text in mapped))


def optional_columns(model: Model) -> list[str]:
    """Columns that the model does not need, but that effects of the catalogue could use, or figures show."""
    features = {feature for effect in catalogue().values() for feature in effect.needs}
    features |= {word for effect in catalogue().values() for words in effect.options.values() for word in words}
    columns = (input_column(feature, node) for feature in sorted(features) for node in model.nodes)
    return [column for column in dict.fromkeys(columns) if column not in model.inputs]


def _pair(text: str) -> tuple[str, str]:
    parse_map_option(text)  # refuse a malformed option before any file is read
    key, _, column = text.partition("=")
    return key.strip(), column
