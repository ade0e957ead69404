"""A model file and logs opened together: the logs are read for what the model, and the catalogue, can use."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from lptn.effects import catalogue
from lptn.logs import ColumnSource, Run, parse_map_option, read_log
from lptn.logs.read import GUESSED
from lptn.model import Model, input_column
from lptn.model_file import ModelFile, load_model
from lptn.simulate import needed_columns

GUESS = "guess"
"""What `--map` says to have columns guessed."""

Tell = Callable[[Path, str], None]


def _on_stderr(log: Path, note: str) -> None:
    print(f"lptn: {log}: {note}", file=sys.stderr)


@dataclass(frozen=True)
class Opened:
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

    def runs(self, logs: Sequence[Path], *, strict: bool = True, tell: Tell = _on_stderr) -> list[Run]:
        """Every run of the logs, in order; what was guessed or looks wrong is told.

        Args:
            logs: paths of logs; `a.csv+b.csv` for two of one run.
            tell: given a log and a sentence about it; by default it goes to the error stream.
            strict: refuse values that can't be in the unit they are read in, and say what is doubtful; else both are
                left to who looks at the runs' doubts.

        Raises:
            InputError: a log can't be used, or lacks a column that the model needs.
        """
        inputs, outputs = needed_columns(self.model)
        found = []
        for log in logs:
            runs = read_log(
                log,
                self.columns,
                step=self.file.step,
                inputs=inputs,
                outputs=outputs,
                optional=optional_columns(self.model),
                strict=strict,
                guessing=self.guessing,
            )
            doubts = [doubt.sentence for doubt in runs[0].doubts] if strict else []
            for note in [*(note for note in runs[0].notes if note.startswith(GUESSED)), *doubts]:
                tell(log, note)
            found += runs
        return found


def open_model(path: Path, mapped: Sequence[str] = ()) -> Opened:
    """Read a model file.

    Args:
        path: the model file.
        mapped: `--map` options, such as `"temperature.FR_calf=T3[degF]"`; they win over the file's `[columns]`. The
            word `guess` among them has columns that are still missing guessed from names.

    Raises:
        InputError: the file or an option can't be used.
    """
    pairs = dict(_pair(text) for text in mapped if text.strip() != GUESS)
    file = load_model(path)
    return Opened(file, Model(file.network), pairs, any(text.strip() == GUESS for text in mapped))


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
