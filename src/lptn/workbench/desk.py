"""Where a study begins: logs, what each is for, what their columns mean, and the model file that says so.

A desk is a folder. `model.toml` there is the model, columns and all, as any command reads it; `opening.json` says which
log is fitted and which held out. All that the page shows is worked out of these files: nothing else is kept.
"""

from __future__ import annotations

import hashlib
import json
import logging
import secrets
import shutil
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path, PurePosixPath, PureWindowsPath
from typing import Any

import numpy as np
from pydantic import BaseModel, ValidationError

from lptn.basics.bounds import DESCRIPTION, TEXT, Bound
from lptn.basics.errors import MODEL_FILE, InputError, one_line
from lptn.basics.files import fingerprint, text_of, write_whole
from lptn.basics.lines import thinned
from lptn.basics.own_folder import own_folder
from lptn.basics.toml import toml_of
from lptn.effects import catalogue
from lptn.effects.copper_loss import CopperLoss
from lptn.identify.data import GUESS, LoadedModel, load_model, optional_columns
from lptn.logs.columns import (
    AMBIENT,
    SI_UNITS,
    UNITS,
    ColumnSource,
    column_unit,
    parse_columns,
    parse_map_option,
    toml_line,
)
from lptn.logs.guess import Guess
from lptn.logs.issue import Issue
from lptn.logs.reading import ENDINGS, GUESSED, LOG_FILE, open_log, run_name
from lptn.logs.tables import Table
from lptn.model.file import with_column, with_entry
from lptn.report.network_drawing import draw_network
from lptn.report.text import for_people, short
from lptn.robots.presets import PRESETS, preset_text
from lptn.robots.urdf import log_model_text, urdf_model_text
from lptn.simulate.bound_run import needed_columns
from lptn.workbench.log_content import LogContent
from lptn.workbench.opening import Opening
from lptn.workbench.orders import Air, AtDesk, Entry, HoldOutAfter, Job, Map, Model, Name, Rate, Remedy

logger = logging.getLogger("lptn")

MODEL, KEPT = "model.toml", "opening.json"
"""Files of a desk."""
FILE = Bound(8_000_000_000, "bytes")
"""Of a file that the page sends: the 500 million numbers that a log may have are 5 GB of text."""
LONGEST_NAME = Bound(150, "bytes in a file's name")
"""A file's name may have 255, and one that is written has another beside it for a while."""
_COLUMNS_SHOWN = 400  # of a log: a page of more is not read; those that mean something come first
_POINTS = 40  # of a picture of a column, each with its least and its greatest reading
_HEIGHT = 100  # of that picture, in parts
_NO_NAME = "a file's own name, with no folder in it"
_OTHER_PLACES = ("ambient", "base", "battery", "pc")
_BEGINS = "begin-"  # a desk's folder
_METADATA = "metadata.yaml"
_OF_BAG = (_METADATA, ".mcap", ".db3", ".zstd")
_NOT_READ: dict[str, Any] = {"said": "not read yet", "refused": "", "columns": [], "opened": False}


def checked_name(name: str) -> str:
    """The name of a file that a page sends, its ending in small letters, which are all that other code knows.

    A file of a ROS 2 bag's folder has that folder's name before it.

    Raises:
        InputError: it is a path, can't be shown, or is of no kind that is read.
    """
    *folder, file = parts = name.split("/")
    for part in parts:
        LONGEST_NAME.check(len(part.encode("utf-8", "replace")), one_line(name)[:50], "file")
        plain = part == PurePosixPath(part).name == PureWindowsPath(part).name and part.isprintable()
        own = folder and part.lower() in (MODEL, KEPT)  # the desk's, of which no folder takes the place
        if len(folder) > 1 or own or not part or not plain or part.startswith(".") or part != part.strip():
            raise InputError(one_line(name), "file", "a name that is a path, hidden, or not printable", _NO_NAME)
    endings, expected = (*ENDINGS, ".toml", ".urdf"), f"{LOG_FILE}; a model file (.toml), or a robot's .urdf"
    if folder:
        endings, expected = _OF_BAG, "files of a ROS 2 bag: its metadata.yaml, .mcap, .db3"
    ending = next((one for one in endings if file.lower().endswith(one)), None)
    if ending is None:
        raise InputError(name, "file", f"the ending '{Path(name).suffix}'", expected)
    return name[: -len(ending)] + ending


def place_for(folder: Path, name: str, based: str | None) -> Path:
    """Where in a desk's folder a file goes: model files become its model, a URDF takes an older one's place.

    Args:
        folder: the desk's.
        name: of the file.
        based: of a model that was edited in the page, the fingerprint of the text that it was made of.

    Raises:
        InputError: the name can't be used, is taken, or the model has changed since.
    """
    if not (name := checked_name(name)).endswith(".toml"):
        path = folder / name
        # Of a bag that is not whole any file may come again; with its metadata, the last, it is a log.
        there = path if path.parent == folder else path.parent / _METADATA
        if not name.endswith(".urdf") and there.exists():
            raise InputError(name, "file", "a file that is there already", "another name, or the other file removed")
        path.parent.mkdir(exist_ok=True)
        return path
    if based is not None and based != _version(folder / MODEL):
        raise InputError(MODEL, "file", "a text that was changed meanwhile, in another tab", "a change of that text")
    return folder / MODEL


def delete_unfinished(folder: Path, path: Path) -> None:
    """Delete what came of a bag to a desk's folder, one file of which did not come; of a whole one nothing."""
    if path.parent != folder and not (path.parent / _METADATA).exists():
        shutil.rmtree(path.parent, ignore_errors=True)


def bound_of(path: Path) -> Bound:
    """How much a file may hold that the page sends."""
    return {".toml": TEXT, ".yaml": TEXT, ".urdf": DESCRIPTION}.get(path.suffix, FILE)


def _version(model: Path) -> str:
    return fingerprint(model) if model.is_file() else ""


class _Kept(BaseModel):
    """`opening.json`."""

    opening: Opening
    unused: list[Path] = []


@dataclass(frozen=True)
class _Seen:
    """What was worked out of a log: of which file, and of what in the model."""

    of: tuple[object, ...]
    shown: dict[str, Any]
    names: frozenset[str] = frozenset()
    guesses: tuple[Guess, ...] = ()
    remedies: Mapping[str, Issue] = field(default_factory=dict)
    error: InputError | None = None  # where it can't be opened


class Desk:
    """The files that a study is made of.

    Args:
        folder: where they are.

    Raises:
        OSError: it can't be made, or others can write to it.
        InputError: its `opening.json` can't be read.
    """

    def __init__(self, folder: Path) -> None:
        self.folder, self.model = own_folder(folder), folder / MODEL
        self._seen: dict[Path, _Seen] = {}
        self._pictures: dict[tuple[object, ...], dict[str, dict[str, Any]]] = {}
        kept = _Kept(opening=Opening(self.model))
        if (folder / KEPT).is_file():
            try:
                kept = _Kept.model_validate_json((folder / KEPT).read_bytes())
            except ValidationError as error:
                raise InputError(folder / KEPT, "file", one_line(error), "what a workbench wrote") from error
        self.opening, self._unused = kept.opening, kept.unused

    @classmethod
    def of(cls, sessions: Path, opening: Opening) -> Desk:
        """The desk for files of a command line; the same files have the same one, with what was done there.

        Args:
            sessions: the folder of all sessions.
            opening: the files, which stay where they are; a model file is copied.

        Raises:
            OSError: its folder can't be made.
            InputError: the model file can't be read.
        """
        text, opening = text_of(opening.model, MODEL_FILE) if opening.model else "", opening.absolute()
        words = "\n".join([text, *map(str, opening.logs), *opening.columns])
        desk = cls(sessions / f"{_BEGINS}{hashlib.sha256(words.encode(errors='replace')).hexdigest()[:10]}")
        if not (desk.folder / KEPT).is_file():
            desk._keep(replace(opening, model=desk.model))
            if text:
                desk._set_model(text)
        return desk

    @property
    def text(self) -> str:
        """The model file's."""
        return text_of(self.model, MODEL_FILE) if self.model.is_file() else ""

    def _keep(self, opening: Opening, unused: Iterable[Path] = ()) -> None:
        write_whole(self.folder / KEPT, _Kept(opening=opening, unused=list(unused)).model_dump_json(indent=2) + "\n")
        self.opening, self._unused = opening, list(unused)

    def _logs(self) -> dict[Path, str]:
        """Each log with its job; one that nobody sorted is fitted."""
        groups = {job: getattr(self.opening, job) for job in ("fit", "holdout", "test")} | {"unused": self._unused}
        known = {path: job for job, group in groups.items() for path in group}
        there = {path: job for path, job in known.items() if path.parent != self.folder or path.exists()}
        return there | {path: "fit" for path in logs_in(self.folder) if path not in there}

    def _used(self) -> list[Path]:
        return [path for path, job in self._logs().items() if job != "unused"]

    def _urdfs(self) -> list[Path]:
        return sorted(self.folder.glob("*.urdf"))

    def _named(self, name: str) -> Path:
        """The log that the page calls so.

        Raises:
            InputError: there is none.
        """
        found = next((path for path in self._logs() if self._name(path) == name), None)
        if found is None:
            raise InputError(one_line(name), "log", "no such log here", "one that the page lists")
        return found

    def _name(self, path: Path) -> str:
        return path.name if path.parent == self.folder else str(path)

    # --- what the page orders -------------------------------------------------------------------

    def do(self, order: AtDesk) -> Opening | None:
        """Do what the page ordered.

        Returns:
            what a study is to be opened with, where that was ordered.

        Raises:
            InputError: it can't be done.
        """
        result: Opening | None = getattr(self, f"_do_{order.what}")(order)
        return result

    def _do_look(self, _: Name) -> None:
        """Take in what has come; what is no log that can be opened is refused, and nothing is left of it."""
        known = {*self.opening.logs, *self._unused}
        strange = [path for path in self._logs() if path not in known and not self._of(path).shown["opened"]]
        refused = [error for path in strange if (error := self._of(path).error) is not None]
        for path in strange:
            _delete(path)
        self._sort(self._logs())
        if refused:
            names = ", ".join(path.name for path in strange)
            raise InputError(names, refused[0].place, refused[0].found, refused[0].expected)

    def _do_begin(self, _: Name) -> Opening:
        self._sort(self._logs())
        if not self.opening.fit:
            raise InputError("the study", "logs", "none to fit", "one log or more to fit")
        return replace(self.opening, columns=())  # which stand in the model file

    def _do_remove(self, order: Name) -> None:
        path = self._named(order.name)
        self._sort({log: job for log, job in self._logs().items() if log != path})
        if path.parent == self.folder:
            _delete(path)

    def _do_job(self, order: Job) -> None:
        self._sort(self._logs() | {self._named(order.log): order.job})

    def _sort(self, jobs: Mapping[Path, str]) -> None:
        fit, holdout, test, unused = (
            tuple(path for path, job in jobs.items() if job == one) for one in ("fit", "holdout", "test", "unused")
        )
        self._keep(replace(self.opening, fit=fit, holdout=holdout, test=test), unused)

    def _do_holdout_after(self, order: HoldOutAfter) -> None:
        after = None if order.seconds is None else f"+{order.seconds:g}"
        self._keep(replace(self.opening, holdout_after=after), self._unused)

    def _do_guesses(self, _: Name) -> None:
        for path, guess in [(log, guess) for log in self._used() for guess in self._of(log).guesses]:
            self._write(path, guess.key, guess.source, f"{GUESSED}{guess.why}")

    def _do_air(self, order: Air) -> None:
        self._write(self._named(order.log), AMBIENT, ColumnSource(value=order.value))

    def _do_rate(self, order: Rate) -> None:
        self._write(self._named(order.log), "time", ColumnSource(rate=order.rate))

    def _do_model(self, order: Model) -> None:
        """A model from the logs' columns, from a URDF on the desk, or a ready one.

        Raises:
            InputError: it can't be made.
        """
        source = order.source
        if source == "columns":
            text = self._model_of_columns()
        elif source in PRESETS:
            preset, _, variant = source.partition(".")
            text = preset_text(preset, variant or None)
        else:
            urdf = self.folder / source
            if urdf not in self._urdfs():
                raise InputError(one_line(source), "model", "no such URDF here", "one that the page lists")
            try:
                text = urdf_model_text(urdf)
            except InputError:
                urdf.unlink()  # as a log that can't be opened
                raise
            self._set_model(text)
            if any(self._of(path).shown.get("currents") for path in self._used()):
                text = urdf_model_text(urdf, CopperLoss(input="current"))
        self._set_model(text)

    def _set_model(self, text: str) -> None:
        """Write a model file, with what a command line said of columns."""
        for option in self.opening.columns:
            if option.strip() != GUESS:
                text = with_column(text, self.model, *parse_map_option(option))
        write_whole(self.model, text)

    def _model_of_columns(self) -> str:
        """A model of the first log that has the air, or else of the first.

        Raises:
            InputError: no log names a joint.
        """
        first, refused = "", InputError("the study", "logs", "none", "a log, whose columns name the joints")
        for path in self._used():
            logger.info("a model of the columns of %s", path.name)
            try:
                text = log_model_text(path)
            except InputError as error:
                refused = error
                continue
            if f'"{AMBIENT}" =' in text:
                return text
            first = first or text
        if not first:
            raise refused
        return first

    def _do_entry(self, order: Entry) -> None:
        write_whole(self.model, with_entry(self.text, self.model, order.keys, order.value))

    def _do_map(self, order: Map) -> None:
        """Say what a column means, in place of what it meant, or that it means nothing."""
        path, names = self._named(order.log), (order.column,)
        old = {key: source for key, source in self._entries(path).items() if source.columns == names}
        for key in old:
            if key.partition("@")[0] != order.key:
                self._edit(key, None)
        if order.key:
            entry = {"column": order.column} | ({"unit": order.unit} if order.unit else {})
            source = parse_columns({order.key: entry}, self.model, "columns")[order.key]
            known = next((own for key, own in old.items() if key.partition("@")[0] == order.key), source)
            self._write(path, order.key, replace(known, unit=source.unit))

    def _do_remedy(self, order: Remedy) -> None:
        path = self._named(order.log)
        issue = self._of(path).remedies.get(order.line)
        if issue is None or issue.corrected is None:
            raise InputError(one_line(order.line), "remedy", "none of this log now", "one that the page lists")
        of_all = all(order.line in self._of(other).remedies for other in self._used())
        self._write(path, issue.key, issue.corrected, alone=not of_all)

    def _entries(self, path: Path) -> dict[str, ColumnSource]:
        """The entries of `[columns]` that are for a log, by their keys in the file."""
        try:
            columns = load_model(self.model).columns
        except InputError:
            return {}
        name, file = run_name(path), path.name
        return {key: source for key, source in columns.items() if key.partition("@")[2] in ("", name, file)}

    def _write(self, path: Path, key: str, source: ColumnSource, why: str = "", *, alone: bool = False) -> None:
        """Write where a quantity stands: for all logs, or for this one where another needs the entry that there is."""
        entries, run = self._entries(path), run_name(path)
        of_run, of_file = f"{key}@{run}", f"{key}@{path.name}"
        shared = of_file in entries or any(run_name(other) == run for other in self._logs() if other != path)
        alone = alone or of_run in entries or of_file in entries
        there = entries[key].columns if key in entries else source.columns
        others = [self._names(other) for other in self._used() if other != path]
        needed = any(names.issuperset(there) and not names.issuperset(source.columns) for names in others)
        own = of_file if shared else of_run  # the names of two logs may differ in their endings alone
        self._edit(own if alone or needed or not source.columns else key, source, why)

    def _names(self, path: Path) -> frozenset[str]:
        """A log's columns, whatever the model file says of them."""
        return (self._seen[path] if path in self._seen else self._of(path)).names

    def _edit(self, key: str, source: ColumnSource | None, why: str = "") -> None:
        write_whole(self.model, with_column(self.text, self.model, key, source, why))

    # --- what the page shows --------------------------------------------------------------------

    def content(self, *, reading: bool = True) -> dict[str, Any]:
        """All that the page shows of the desk, as JSON holds it.

        Args:
            reading: look into logs that are used and were not looked at yet, which takes a minute a gigabyte.
        """
        text, wrong, loaded, tables = "", "", None, dict[str, Any]()
        try:
            if reading and not self.model.is_file() and self._used():
                self._set_model(self._model_of_columns())
            text = self.text
            with suppress(InputError):  # which is said where the model is read
                document = toml_of(self.model, text)
                tables = {name: document.get(name) for name in ("nodes", "links", "effects")}
                tables = json.loads(json.dumps(tables, default=str))  # a date, too, is only read as a mistake
            loaded = load_model(self.model) if text else None
        except InputError as error:
            wrong = self.told(error)
        shown = list[dict[str, Any]]()
        comments = self._comments(text)
        for path, job in self._logs().items():
            known = self._of(path, loaded) if reading and job != "unused" else self._seen.get(path)
            log = known.shown if known else _NOT_READ
            rows = [row | {"why": comments.get(row.get("entry"), row["why"])} for row in log["columns"]]
            shown.append(log | {"name": self._name(path), "job": job, "size": _size(path), "columns": rows})
        used = [each for each in shown if each["job"] != "unused"]
        nodes = list(loaded.model.nodes) if loaded else []
        return {
            "text": text,
            "based": _version(self.model),
            "wrong": wrong,
            "tables": tables,
            "drawing": draw_network(loaded.model) if loaded else "",
            "effects": {
                key: {"title": effect.title, "units": {one.name: one.unit for one in effect.parameters}}
                for key, effect in sorted(catalogue().items(), key=lambda one: one[1].title)
            },
            "about": f"{len(nodes)} nodes, {len(loaded.model.parameters)} parameters" if loaded else "",
            "places": [*nodes, *(place for place in _OTHER_PLACES if place not in nodes)],
            "units": {name: [unit, *dict.fromkeys(UNITS.get(name, {}).values())] for name, unit in SI_UNITS.items()},
            "presets": {name: about for name, (_, _, about) in PRESETS.items()},
            "urdfs": [path.name for path in self._urdfs()],
            "air": loaded is not None and AMBIENT in loaded.model.inputs,
            "logs": shown,
            "holdout_after": self.opening.holdout_after,
            "ready": bool(
                loaded and not wrong and used and all(each["opened"] and not each["refused"] for each in used)
            ),
        }

    def told(self, error: Exception) -> str:
        """In lptn's own line, files of the desk by their names alone."""
        return one_line(error).replace(f"{self.folder}/", "")

    def _of(self, path: Path, loaded: LoadedModel | None = None) -> _Seen:
        """What is in a log, looked for once for each mapping: of the model only what it takes from the log counts."""
        with suppress(InputError):
            loaded = loaded or (load_model(self.model) if self.model.is_file() else None)
        stamp, last = _stamp(path), self._seen.get(path)
        of = (stamp, loaded and _taken(loaded, path))
        if last is not None and (last.of == of or (loaded is None and last.of[0] == stamp)):
            return last
        logger.info("reading %s", path.name)
        try:
            seen = self._judged(of, path, loaded) if loaded else self._plain(of, path)
        except InputError as error:
            seen = _Seen(of, {"refused": self.told(error), "columns": [], "opened": False}, error=error)
        self._seen[path] = seen
        return seen

    def _plain(self, of: tuple[object, ...], path: Path, table: Table | None = None) -> _Seen:
        """A log as it is without a model."""
        table = table or open_log(path, {})[0]
        rows, pictures = list[dict[str, Any]](), self._pictured(path, table)
        for name in dict.fromkeys(table.names):
            own = {"name": name, "usual": table.units.get(name, ""), "picture": pictures.get(name)}
            rows.append({"key": "", "unit": "", "how": "", "why": "", "issues": [], **own})
        return _Seen(of, {"opened": True, "refused": "", "said": table.kind, "columns": rows}, frozenset(table.names))

    def _judged(self, of: tuple[object, ...], path: Path, loaded: LoadedModel) -> _Seen:
        """A log as the model sees it: what its columns mean or may mean, and what is wrong with them."""
        content = LogContent.of(loaded, path)
        plain = self._plain(of, path, content.table)
        rows = {row["name"]: row for row in plain.shown["columns"]}
        mapped = {key.partition("@")[0]: key for key in self._entries(path)}
        for guess in content.guesses:
            said = {"key": guess.key, "unit": guess.source.unit or "", "how": "guessed", "why": guess.why}
            for name in guess.source.columns:
                rows[name] |= said
        for key, source in content.sources.items():
            how = {"how": "mapped", "entry": mapped[key]} if key in mapped else {"how": "own"}
            for name in rows.keys() & set(source.columns):
                rows[name] |= {"key": key, "unit": source.unit or "", **how}
        issues = {issue.sentence: issue for issue in content.issues}.values()
        remedies = {toml_line(issue.key, issue.corrected): issue for issue in issues if issue.corrected is not None}
        for issue in issues:
            found = {"problem": for_people(issue.problem), "remedy": for_people(issue.remedy), "sure": issue.certain}
            line = toml_line(issue.key, issue.corrected) if issue.corrected is not None else ""
            if issue.column in rows:
                rows[issue.column]["issues"].append({**found, "line": line})
        for row in rows.values():
            row["usual"] = column_unit(row["key"]) or row["usual"]
        columns = sorted(rows.values(), key=lambda row: row["key"] == "")
        given = loaded.sources_of(path)[1].get(AMBIENT)
        shown = {
            "refused": self.told(content.error) if content.error else "",
            "said": content.lengths,
            "missing": list(content.missing),
            "currents": list(content.currents),
            "guesses": len(content.guesses),
            "notes": [for_people(note) for note in content.notes],
            "air": {"value": given and given.value, "column": next(iter(content.used.get(AMBIENT, ())), "")},
            "columns": columns[:_COLUMNS_SHOWN],
            "more": max(0, len(columns) - _COLUMNS_SHOWN),
        }
        return replace(plain, shown=plain.shown | shown, guesses=content.guesses, remedies=remedies)

    @staticmethod
    def _comments(text: str) -> dict[str, str]:
        """What stands behind the entries of `[columns]`, by their keys."""
        lines = (line.partition("#") for line in text.splitlines() if GUESSED in line)
        found = ((before.partition("=")[0].strip().strip('"'), comment.strip()) for before, _, comment in lines)
        return {key: comment.removeprefix(GUESSED) for key, comment in found}

    def _pictured(self, path: Path, table: Table) -> dict[str, dict[str, Any]]:
        """A small picture of each column, made once: its least and greatest reading in each of some pieces."""
        stamp = _stamp(path)
        if stamp not in self._pictures:
            numbers = table.some_numbers(list(dict.fromkeys(table.names))[:_COLUMNS_SHOWN])
            pictures = {name: picture for name, x in numbers.items() if (picture := _picture(x)) is not None}
            self._pictures[stamp] = pictures
        return self._pictures[stamp]


def _picture(values: Any) -> dict[str, Any] | None:
    finite = values[np.isfinite(values)]
    if not finite.size:
        return None
    least, most = float(finite.min()), float(finite.max())
    scale = _HEIGHT / (most - least) if most > least else 0.0
    _, (thin,) = thinned(np.arange(values.size, dtype=float), np.asarray(values)[None], 2 * _POINTS)
    line = [None if not np.isfinite(x) else round(_HEIGHT - (x - least) * scale) for x in thin]
    return {"line": line, "least": short(least), "most": short(most)}


def _taken(loaded: LoadedModel, path: Path) -> tuple[object, ...]:
    """All of a model that decides what is read of a log, and how."""
    wanted = needed_columns(loaded.model), optional_columns(loaded.model)
    return loaded.sources_of(path), wanted, loaded.file.step


def _stamp(path: Path) -> tuple[object, ...]:
    status = path.stat() if path.exists() else None
    return (str(path), status.st_mtime_ns, status.st_size) if status else (str(path),)


def _size(path: Path) -> int:
    return sum(file.stat().st_size for file in (path, *path.rglob("*")) if file.is_file())


def _delete(log: Path) -> None:
    shutil.rmtree(log) if log.is_dir() else log.unlink()


def new_desk(sessions: Path) -> Path:
    """A folder for a desk that a page begins.

    Raises:
        OSError: it can't be made.
    """
    return own_folder(sessions / f"{_BEGINS}{secrets.token_hex(5)}")


def delete_if_empty(folder: Path) -> None:
    """Delete a desk on which there is no file of a person's, nor one that is on its way."""
    if folder.is_dir() and {path.name for path in folder.iterdir()} <= {KEPT, "lock"}:
        shutil.rmtree(folder)


def logs_in(folder: Path) -> list[Path]:
    """The logs that came to a desk's folder: files, and folders of bags."""

    def is_log(path: Path) -> bool:
        return (path / _METADATA).is_file() or (path.is_file() and path.name.endswith(ENDINGS))

    return sorted(one for one in folder.iterdir() if not one.name.startswith(".") and is_log(one))


def is_desk(folder: Path) -> bool:
    """Whether a folder of the sessions is a desk."""
    return folder.name.startswith(_BEGINS) and folder.is_dir()
