"""A model file and logs opened together: the logs are read for what the model, and the catalogue, can use."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from lptn.effects import catalogue
from lptn.logs import Run, parse_map_option, read_log
from lptn.model import Model, input_column
from lptn.model_file import ModelFile, load_model
from lptn.simulate import needed_columns


@dataclass(frozen=True)
class Opened:
    """A model file, its model, and a reader that brings logs to it."""

    file: ModelFile
    model: Model
    mapped: dict[str, str]

    def runs(self, logs: Sequence[Path]) -> list[Run]:
        """Every run of the logs, in order.

        Raises:
            InputError: a log can't be used, or lacks a column that the model needs.
        """
        columns = self.file.columns | dict(parse_map_option(f"{key}={text}") for key, text in self.mapped.items())
        inputs, outputs = needed_columns(self.model)
        useful = optional_columns(self.model)
        return [
            run
            for log in logs
            for run in read_log(log, columns, step=self.file.step, inputs=inputs, outputs=outputs, optional=useful)
        ]


def open_model(path: Path, mapped: Sequence[str] = ()) -> Opened:
    """Read a model file.

    Args:
        path: the model file.
        mapped: `--map` options, such as `"temperature.FR_calf=T3[degF]"`; they win over the file's `[columns]`.

    Raises:
        InputError: the file or an option can't be used.
    """
    pairs = dict(_pair(text) for text in mapped)
    file = load_model(path)
    return Opened(file, Model(file.network), pairs)


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
