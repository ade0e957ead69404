"""`model.toml` in and out: read into a network, edited as text with its comments kept, written back."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import tomlkit

from lptn.basics.errors import MODEL_FILE, InputError, one_line, shown
from lptn.basics.files import text_of, write_whole
from lptn.basics.parameters import Parameter, Setting, Share
from lptn.basics.places import is_glob, run_label
from lptn.basics.toml import editable, mistakes_by_line, toml_of
from lptn.basics.units import convert
from lptn.effects import effect_named
from lptn.logs.columns import ColumnSource, parse_columns, toml_line
from lptn.model.network import EffectDeclaration, Key, Network
from lptn.model.tables import AMBIENT, File, FitTable, FittedTable, Reader, flat_columns


@dataclass(frozen=True, repr=False)
class ModelFile:
    """A model file as text, and what it says.

    Args:
        path: where it was read from, for messages.
        text: its text, comments and all.
        network: the network that it declares, fitted values in place.
        columns: where the log columns stand under other names.
        step: sampling step that logs are brought to [s], `None` for each log's own.
        fit: what the file says of the fit that its values come from.
    """

    path: Path
    text: str
    network: Network
    columns: dict[str, ColumnSource]
    step: float | None
    fit: FitTable

    def __repr__(self) -> str:
        return f"<ModelFile {self.path}: {self.network.name}>"

    def with_effects(self, effects: Iterable[EffectDeclaration]) -> ModelFile:
        """The file with more `[[effects]]` at its end, everything else as it stands."""
        document = editable(self.path, self.text)
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

    def with_setting(self, setting: Setting) -> ModelFile:
        """The file with what is set of a parameter, where it is declared.

        Its bounds, and whether it is fixed, are those of all places that the declaration is for.

        Raises:
            InputError: no such parameter, it can't be set in the file, or the value lies outside the bounds.
        """
        declared = {parameter.name: parameter.declared for parameter in self.network.parameters}
        if setting.name not in declared:
            raise InputError(self.path, setting.name, "no such parameter", f"one of {', '.join(declared)}")
        parameter = setting.of(declared[setting.name])
        document = editable(self.path, self.text)
        key, owners = next((key, own) for key, own in self.network.declared_at.items() if setting.name in own)
        table, name = _declaring(document, key)
        if name == "capacity" and name not in table and "element" in table:
            raise InputError(
                self.path, setting.name, "it follows from a material", "its density or specific heat changed"
            )
        old = table.get(name)
        entry = dict(old) if isinstance(old, Mapping) else {} if old is None else {"value": old}
        unit = str(entry.setdefault("unit", parameter.unit))
        if setting.bounds is not None:
            entry["bounds"] = [convert(bound, parameter.unit, unit) for bound in parameter.bounds]
        if setting.fixed is not None:
            entry["fixed"] = parameter.fixed
        by_owner = {owner: declared[full_name].value for full_name, owner in owners.items()} | {
            owners[setting.name]: parameter.value
        }
        written = {owner: _rounded(convert(value, parameter.unit, unit)) for owner, value in by_owner.items()}
        same = len(set(written.values())) == 1
        entry["value"] = next(iter(written.values())) if same else _inline(written)
        table[name] = _inline(entry)
        document.get("fit", {}).get("parameters", {}).pop(setting.name, None)
        return parse_model(tomlkit.dumps(document), self.path)

    def with_fit(self, fitted: FitTable) -> ModelFile:
        """The file with fitted values where their parameters are declared, and a `[fit]` table that says how well.

        A parameter that places have for themselves gets a table of values, `value = { FR_hip = 301.2, … }`. `[fit]` has
        the error, warnings, the data's fingerprints and the values' standard errors.
        """
        document = editable(self.path, self.text)
        document.pop("fit", None)
        declared = {parameter.name: parameter.declared for parameter in self.network.parameters}
        values = {name: parameter.value for name, parameter in declared.items()}
        values |= {name: entry.value for name, entry in fitted.parameters.items()}
        elsewhere = dict(fitted.parameters)
        for key, owners in self.network.declared_at.items():
            if owners.keys().isdisjoint(fitted.parameters.keys() | self.fit.parameters.keys()):
                continue
            by_owner = {owner: values[name] for name, owner in owners.items()}
            if _set_values(document, key, by_owner, declared[next(iter(owners))]):
                for name in owners:
                    elsewhere.pop(name, None)
        document.add("fit", _fit_table(fitted, declared, elsewhere))
        return parse_model(tomlkit.dumps(document), self.path)

    def write(self, path: Path) -> None:
        """Write it whole or not at all."""
        write_whole(path, self.text)


def read_model_file(path: Path) -> ModelFile:
    """Read a model file.

    Args:
        path: of the TOML file.

    Raises:
        InputError: it can't be read, is not TOML, or says something that can't be a model; with its line.
    """
    return parse_model(text_of(path, MODEL_FILE), path)


def parse_model(text: str, path: Path) -> ModelFile:
    """Read a model from the text of its file; `path` serves for messages.

    Raises:
        InputError: with the line of the mistake.
    """
    with mistakes_by_line(path, text):
        content = toml_of(path, text)
        tables = File.model_validate(content)
        columns = parse_columns(flat_columns(tables.columns), path, "columns")
        network = Reader(path, tables).network()
    values = {parameter.name: parameter.value for parameter in network.parameters}
    errors = {name: error for name, error in tables.fit.standard_errors.items() if name in values}
    entries = {name: FittedTable(value=values[name], error=error) for name, error in errors.items()}
    fit = tables.fit.model_copy(update={"parameters": entries | tables.fit.parameters})
    return ModelFile(path, text, network, columns, tables.model.step, fit)


def with_column(text: str, path: Path, key: str, source: ColumnSource | None, why: str = "") -> str:
    """The text of a model file with an entry of `[columns]`, all else as it stands.

    Args:
        text: of the file, which need not be a whole model yet.
        path: for messages.
        key: `time` or `<quantity>.<place>`, perhaps with `@` and a run's name.
        source: where it stands; `None` takes the entry away.
        why: a comment behind the entry.

    Raises:
        InputError: the text is not TOML.
    """
    document = editable(path, text)
    if "columns" not in document:
        document["columns"] = tomlkit.table()
    table: Any = document["columns"]
    if not isinstance(table, Mapping):
        raise InputError(path, "columns", shown(table), "a table [columns]")
    quantity, _, place = key.partition(".")
    if isinstance(table.get(quantity), Mapping) and place in table[quantity]:  # without quotes: a table in the table
        table, key = table[quantity], place
    if source is None:
        table.pop(key, None)
        return tomlkit.dumps(document)
    item: Any = next(iter(tomlkit.parse(toml_line(key, source)).values()))
    item.trivia.trail = "\n"
    if key in table:
        table[key] = item
    else:
        _append(table, key, item)
    trivia = table[key].trivia  # of an entry that is replaced tomlkit keeps the comment
    trivia.comment_ws, trivia.comment = ("   ", f"# {one_line(why)}") if why else ("", "")
    return tomlkit.dumps(document)


def _effect_table(effect: EffectDeclaration) -> tomlkit.items.Table:
    table = tomlkit.table()
    table.add("kind", effect.effect.key)
    table.add("at", effect.at)
    if effect.run:
        table.add("run", effect.run)
    if effect.driven_by:
        table.add("driven_by", effect.driven_by)
    if effect.difference:
        table.add("difference", True)
    for name, word in effect.effect.chosen.items():
        table.add(name, word)
    resolved = effect.resolved
    share = next(iter(resolved.values())).share
    if share != "each":
        table.add("share", share)
    for name, parameter in resolved.items():
        lower, upper = parameter.bounds
        entry: dict[str, object] = {"value": min(max(_rounded(parameter.value), lower), upper), "unit": parameter.unit}
        stated = effect.effect.stated(effect.difference)
        if parameter.bounds not in [own.bounds for own in stated if own.name == name]:
            entry["bounds"] = [lower, upper]
        if parameter.prior is not None:
            entry["prior"] = list(parameter.prior)
        if parameter.fixed:
            entry["fixed"] = True
        table.add(name, _inline(entry))
    return table


def _declaring(document: Any, key: Key) -> tuple[Any, str]:
    """The table in which a parameter is declared, and its key there."""
    if key == AMBIENT and "ambient" not in document.get("nodes", {}):
        return document["model"], "ambient"
    table = document
    for step in key[:-1]:
        table = table[step]
    return table, str(key[-1])


def _set_values(document: Any, key: Key, values: Mapping[str, float], declared: Parameter) -> bool:
    """Write values, by owner, where their parameter is declared; `False` if the file has no place for them."""
    table, name = _declaring(document, key)
    if name == "capacity" and name not in table and "element" in table:
        return False  # it follows from the element's material
    old = table.get(name)
    entry = old if isinstance(old, Mapping) else {}
    unit = str(entry.get("unit", declared.unit))
    lower, upper = entry.get("bounds") or [convert(bound, declared.unit, unit) for bound in declared.bounds]
    written: dict[str, float] = {}
    for owner, value in values.items():
        written[owner] = min(max(_rounded(convert(value, declared.unit, unit)), float(lower)), float(upper))
    same = len(set(written.values())) == 1
    if same and (entry.get("value") if entry else old) == next(iter(written.values())):
        return True  # as its author wrote it: 1, not 1.0
    new = tomlkit.item(next(iter(written.values()))) if same else _inline(written)
    if isinstance(old, tomlkit.items.InlineTable) and not same:  # the long one last
        table[name] = _inline({other: entry[other] for other in entry if other != "value"} | {"value": new})
    elif isinstance(old, tomlkit.items.InlineTable) and "value" not in old:  # it began at its prior, or in its bounds
        new_entry = _inline({"value": new} | {other: entry[other] for other in entry})
        new_entry.trivia.comment_ws, new_entry.trivia.comment = old.trivia.comment_ws, old.trivia.comment
        table[name] = new_entry
    elif entry:
        entry["value"] = new  # type: ignore[index]  # tomlkit's tables can be written to
    elif old is not None:
        table[name] = new if same else _inline({"value": new})
    else:
        _append(table, name, _inline({"value": new, "unit": unit}))
    return True


def with_entry(text: str, path: Path, keys: Sequence[str | int], value: object) -> str:
    """The text of a model file with one value in it, all else as it stands.

    Args:
        text: of the file, which need not be a whole model yet.
        path: for messages.
        keys: what leads to the value: of tables their names, of lists a number, one beyond the last for another entry.
        value: as JSON has it; `None` takes the entry away.

    Raises:
        InputError: the text is not TOML, or the keys lead nowhere in it.
    """
    document = editable(path, text)
    table: Any = document
    *above, last = keys
    try:
        for key, below in zip(above, keys[1:], strict=True):
            if isinstance(key, str) and key not in table:
                table[key] = tomlkit.aot() if isinstance(below, int) else tomlkit.table()
            table = table[key]
        if value is None:
            del table[last]
        else:
            item: Any = value
            if isinstance(value, Mapping):
                entries = {name: _inline(x) if isinstance(x, Mapping) else x for name, x in value.items()}
                within = len(above) > 1 or isinstance(table, tomlkit.items.Array | tomlkit.items.InlineTable)
                item = _inline(entries) if within else tomlkit.table()
                item.update(entries)
            if isinstance(last, int) and last == len(table):
                table.append(item)
            else:
                table[last] = item
    except (LookupError, TypeError, ValueError, tomlkit.exceptions.TOMLKitError) as error:
        place = ".".join(map(str, keys))
        raise InputError(path, place, "nothing that could be changed", "an entry of the model file") from error
    return tomlkit.dumps(document)


def _append(table: Any, name: str, item: Any) -> None:
    """A new last key of a table, before the blank lines and comments that lead over to what follows."""
    if isinstance(table, tomlkit.items.InlineTable):
        table[name] = item
        return
    body = table.value.body
    after = []
    while body and body[-1][0] is None:
        after.append(body.pop())
    table.add(name, item)
    body.extend(reversed(after))


def _fit_table(
    fitted: FitTable, declared: Mapping[str, Parameter], elsewhere: Mapping[str, FittedTable]
) -> tomlkit.items.Table:
    """`[fit]`; `elsewhere` are the values that could not be written where their parameters are declared."""
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
    table.add("standard_errors", _errors_table(fitted, declared, elsewhere))
    if elsewhere:
        parameters = tomlkit.table()
        for name, estimate in elsewhere.items():
            number = _rounded(estimate.value)
            if name in declared:
                number = min(max(number, declared[name].bounds[0]), declared[name].bounds[1])
            error = {} if estimate.error is None else {"error": _rounded(estimate.error)}
            parameters.add(name, _inline({"value": number} | error))
        table.add("parameters", parameters)
    return table


def _errors_table(
    fitted: FitTable, declared: Mapping[str, Parameter], elsewhere: Mapping[str, FittedTable]
) -> tomlkit.items.Table:
    table = tomlkit.table()
    table.comment("of the fitted values, which stand where their parameters are declared")
    for name, estimate in fitted.parameters.items():
        if estimate.error is not None and name not in elsewhere:
            table.add(name, _rounded(estimate.error))
            table[name].comment(declared[name].unit)
    return table


def _inline(entries: Mapping[str, object]) -> tomlkit.items.InlineTable:
    table = tomlkit.inline_table()
    table.update(entries)
    return table


def _rounded(value: float) -> float:
    significant = 6  # digits of a fitted value: more would claim what no fit knows
    return float(f"{value:.{significant}g}")


# --- An effect added to a model file, at the size at which it is usually met ------------------------


def added(
    file: ModelFile, key: str, at: str, run: str = "", settings: Mapping[str, str | float] | None = None
) -> ModelFile:
    """The model file with one more effect; where `at` is a pattern, its places share the parameters.

    Where the place shares the effect with others already, it is the place's difference from them.

    Args:
        file: the model file.
        key: the effect's.
        at: a node, an edge `"a~b"`, a pattern, or `"*"`; perhaps with the run behind it as `lptn diagnose` prints it,
            `"FR_thigh@fit2"`.
        run: name of the only run in which it acts, or a pattern of such names; every run by default.
        settings: words for its options, values of its parameters in SI units, the place that is `driven_by`; by default
            the effect's own.

    Raises:
        InputError: no such effect, it can't stand there, two runs are named, or a setting that it does not have.
    """
    kind = effect_named(key, "add", "EFFECT")
    names = {*file.network.dynamic, *file.network.prescribed}
    place, separator, printed = (at, "", "") if at in names else at.rpartition("@")
    if separator and run and printed != run_label(run):
        raise InputError("add", "--run", f'run "{run}" for a place "{at}" of another run', f'"{place}", or no --run')
    if separator:
        # A printed name has commas for characters that a name can't have; a pattern finds the run they stood in.
        at, run = place, run or printed.replace(",", "?")
    share: Share = "all" if is_glob(at) or "{" in at else "each"
    difference = kind.adds_up() and not run and at in {instance.place for instance in file.network.in_common(key)}
    parameters = {one.name: replace(one.switched_on, share=share) for one in kind.stated(difference)}
    words, driven_by = {}, ""
    for name, given in (settings or {}).items():
        if name in kind.options:
            if given not in kind.options[name]:
                raise InputError("add", "--set", f"{name}={given}", f"one of {', '.join(kind.options[name])}")
            words[name] = str(given)
        elif name == "driven_by":
            driven_by = str(given)
        elif name in parameters:
            try:
                value = float(given)
            except ValueError as error:
                raise InputError("add", "--set", f"{name}={given}", f"a number, in {parameters[name].unit}") from error
            parameters[name] = Setting(name, value).of(parameters[name])
        else:
            known = ", ".join((*kind.options, "driven_by", *parameters))
            raise InputError("add", "--set", f'"{name}"', f"one of {known}")
    effect = EffectDeclaration(
        kind(**words), at, tuple(parameters.values()), driven_by=driven_by, run=run, difference=difference
    )
    return file.with_effects([effect])
