"""`model.toml` in and out: comments kept, every mistake named with its line."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

import tomlkit

from lptn.files import write_whole
from lptn.logs import ColumnSource, parse_columns
from lptn.model_mistakes import text_of, told_by_line, toml_of
from lptn.model_reader import Reader, flat_columns
from lptn.model_schema import File, FitTable
from lptn.network import EffectDeclaration, Network

_SIGNIFICANT = 6  # digits of a fitted value: more would claim what no fit knows


@dataclass(frozen=True)
class ModelFile:
    """A model file as text, and what it says.

    Args:
        path: where it was read from, for messages.
        text: its text, comments and all.
        network: the network that it declares, fitted values in place.
        columns: where the log columns stand under other names.
        step: sampling step that logs are brought to [s], `None` for each log's own.
    """

    path: Path
    text: str
    network: Network
    columns: dict[str, ColumnSource]
    step: float | None

    def with_effects(self, effects: Iterable[EffectDeclaration]) -> ModelFile:
        """The file with more `[[effects]]` at its end, everything else as it stands."""
        document = tomlkit.parse(self.text)
        tables = document.get("effects")
        if not isinstance(tables, tomlkit.items.AoT):
            written = [] if tables is None else tables.unwrap()
            tables = tomlkit.aot()
            for entry in written:  # an inline array can't be continued by [[effects]]
                tables.append(tomlkit.item(entry))
            document.pop("effects", None)
            document["effects"] = tables
        for effect in effects:
            table = _effect_table(effect)
            table.trivia.indent = "\n"
            tables.append(table)
        return parse_model(tomlkit.dumps(document), self.path)

    def with_fit(self, fitted: FitTable) -> ModelFile:
        """The file with a `[fit]` table: values, standard errors, warnings and the data's fingerprints."""
        document = tomlkit.parse(self.text)
        document.pop("fit", None)
        table = tomlkit.table()
        if fitted.rmse is not None:
            table.add("rmse", _rounded(fitted.rmse))
            table["rmse"].comment("K, over the readings that were fitted")
        if fitted.status is not None:
            table.add("status", fitted.status)
        if fitted.warnings:
            table.add("warnings", tomlkit.item(fitted.warnings).multiline(True))
        data = tomlkit.array()
        for entry in fitted.data:
            data.append(entry.model_dump())
        table.add("data", data.multiline(True))
        bounds = {unknown.name: unknown.declared.bounds for unknown in self.network.unknowns}
        parameters = tomlkit.table()
        for name, found in fitted.parameters.items():
            lower, upper = bounds.get(name, (-math.inf, math.inf))
            rounded = found.model_dump(exclude_none=True) | {"value": min(max(_rounded(found.value), lower), upper)}
            if found.error is not None:
                rounded["error"] = _rounded(found.error)
            parameters.add(name, _inline(rounded))
        table.add("parameters", parameters)
        document.add("fit", table)
        return parse_model(tomlkit.dumps(document), self.path)

    def write(self, path: Path) -> None:
        """Write it whole or not at all."""
        write_whole(path, self.text)


def load_model(path: Path) -> ModelFile:
    """Read a model file.

    Args:
        path: of the TOML file.

    Raises:
        InputError: it can't be read, is not TOML, or says something that can't be a model; with its line.
    """
    return parse_model(text_of(path, "a model file (`lptn new` writes one)"), path)


def parse_model(text: str, path: Path) -> ModelFile:
    """Read a model from the text of its file; `path` serves for messages.

    Raises:
        InputError: with the line of the mistake.
    """
    with told_by_line(path, text):
        content = toml_of(path, text)
        tables = File.model_validate(content)
        columns = parse_columns(flat_columns(tables.columns), path, "columns")
        network = Reader(path, tables).network()
    return ModelFile(path, text, network, columns, tables.model.step)


def _effect_table(effect: EffectDeclaration) -> tomlkit.items.Table:
    table = tomlkit.table()
    table.add("kind", effect.effect.key)
    table.add("at", effect.at)
    if effect.run:
        table.add("run", effect.run)
    if effect.driven_by:
        table.add("driven_by", effect.driven_by)
    for name, word in effect.effect.chosen.items():
        table.add(name, word)
    resolved = effect.resolved
    share = next(iter(resolved.values())).share
    if share != "each":
        table.add("share", share)
    for name, parameter in resolved.items():
        lower, upper = parameter.bounds
        entry: dict[str, object] = {"value": min(max(_rounded(parameter.value), lower), upper), "unit": parameter.unit}
        if parameter.bounds not in [own.bounds for own in effect.effect.parameters if own.name == name]:
            entry["bounds"] = [lower, upper]
        if parameter.fixed:
            entry["fixed"] = True
        table.add(name, _inline(entry))
    return table


def _inline(entries: Mapping[str, object]) -> tomlkit.items.InlineTable:
    table = tomlkit.inline_table()
    table.update(entries)
    return table


def _rounded(value: float) -> float:
    return float(f"{value:.{_SIGNIFICANT}g}")
