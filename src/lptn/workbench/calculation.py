"""The process that holds the study: it does what the page orders, and can be killed at any time.

A refit can't be stopped from outside its thread, but a process can. So the study lives in one that the server starts,
and that puts what it has into the session's folder after each order. Once it is ended, the next one begins there.
"""

from __future__ import annotations

import io
import logging
import pickle
import sys
import traceback
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ValidationError

import lptn
from lptn.basics.errors import InputError, one_line
from lptn.basics.files import write_whole
from lptn.basics.own_folder import is_own_file, own_folder
from lptn.basics.parameters import Setting
from lptn.basics.processes import begin_as_worker
from lptn.diagnose.answers import Step
from lptn.identify.data import Stretch
from lptn.study import Study
from lptn.workbench.bench import Bench, News
from lptn.workbench.content import content_of, step_content
from lptn.workbench.desk import MODEL, Desk, is_desk, logs_in
from lptn.workbench.opening import EXAMPLES, Opening
from lptn.workbench.orders import Against, Keep, Note, Order

logger = logging.getLogger("lptn")

STUDY, STEPS, NOW, WRITTEN = "study.pickle", "steps.json", "now.toml", "notes.json"
"""Files of a session: the study as this version of lptn holds it; what was done, for any other version; its model as it
is now; and notes."""
_MOST_RECENT = 12  # studies on the page that a workbench begins with
_LONGEST_STEM = 50  # characters of a model file's name in the session's: four bytes each at most, and 255 are allowed


def work(
    pipe: Connection, opening: Opening | str | Path, sessions: Path, parent: int, after_a_stop: bool = False
) -> None:
    """Read the study, go on from where its session ended, and do orders until the other side closes.

    Files that are no study yet stand on a desk, until the page opens them. Says `("opening", what)`,
    `("opened", folder)`, `("said", text)`, `("warned", text)`, `("found", rows)`, `("shown", content, news)`,
    `("done",)`, `("failed", text)`, or `("refused", error)` where it can't begin.

    Args:
        pipe: where orders come from and answers go.
        opening: the model file, logs and options; the name of an example; or a desk's folder.
        sessions: the folder of all sessions.
        parent: the server's process.
        after_a_stop: somebody ended the work before: it does not begin by itself.
    """
    begin_as_worker(parent)
    logger.setLevel(logging.INFO)
    logger.addHandler(_Telling(pipe))
    try:
        if isinstance(opening, str):
            # Its files are written beside the sessions: nothing lands in the user's own folders.
            opening = EXAMPLES[opening].opening(own_folder(sessions / f"example-{opening}"))
        bench = _begun(pipe, opening, sessions, after_a_stop)
    except InputError as error:
        pipe.send(("refused", error))
        return
    except OSError as error:
        expected = "a folder that you can write to, and nobody else ($XDG_STATE_HOME)"
        pipe.send(("refused", InputError(sessions, "session", error.strerror or str(error), expected)))
        return
    while bench is not None:
        _show(pipe, bench)
        pipe.send(("done",))
        try:
            order = pipe.recv()
        except EOFError:
            return
        _done(pipe, bench, order)


def _begun(pipe: Connection, opening: Opening | Path, sessions: Path, after_a_stop: bool) -> Bench | None:
    """The study of some files; by way of a desk where they are on one, or where columns of a log have to be named.

    Raises:
        InputError: a file can't be used.
        OSError: a folder can't be made, or others can write to it.
    """
    desk = Desk(opening) if isinstance(opening, Path) else None
    if isinstance(opening, Opening) and opening.model is None:
        desk = Desk.of(sessions, opening)
    while True:
        if desk is not None:
            ordered = _at_desk(pipe, desk, reading=not after_a_stop)
            if ordered is None:
                return None
            opening, after_a_stop = ordered, False
        assert isinstance(opening, Opening)
        try:
            return _opened(pipe, opening, sessions, after_a_stop)
        except InputError as error:
            if desk is None:
                if not error.place.startswith("column") or error.file == str(opening.model):
                    raise
                desk = Desk.of(sessions, opening)
            pipe.send(("failed", desk.told(error)))


def _at_desk(pipe: Connection, desk: Desk, *, reading: bool) -> Opening | None:
    """Do what the page orders of the files, until it opens them; `None` where the other side closes."""
    pipe.send(("opening", desk.folder))
    pipe.send(("opened", desk.folder))
    while True:
        for whole in (False, True) if reading else (False,):  # what takes no time at once
            content = desk.content(reading=whole)
            pipe.send(("shown", {"desk": content, "file": content["text"]}, News()))
        pipe.send(("done",))
        try:
            order = pipe.recv()
        except EOFError:
            return None
        reading = True
        with _told(pipe, desk.told):
            if (opening := desk.do(order)) is not None:
                pipe.send(("opening", opening))
                return opening


def _done(pipe: Connection, bench: Bench, order: Order | Keep) -> None:
    def found(steps: tuple[Step, ...]) -> None:
        pipe.send(("found", [step_content(step) for step in steps[1:]]))

    beside = order.study if isinstance(order, Against) else bench.against[0]
    with _told(pipe):
        if isinstance(order, Against):
            _set_against(bench, order.study)
        else:
            bench.do(order, found)
        if order.what == "diagnose":
            _show(pipe, bench)  # the answers, before the rest of them is worked out
            _save(bench)  # they stay where somebody stops the rest
        if order.what in ("diagnose", "improve"):
            bench.look_closer()
        _save(bench)
        if beside and not bench.against[0]:  # the data are others now
            _set_against(bench, beside)
            _save(bench)


def _set_against(bench: Bench, name: str) -> None:
    """Let the model of another session, as it is now, predict this one's logs.

    Raises:
        InputError: there is none of that name, or it can't predict these logs.
    """
    model = bench.folder.parent / name / NOW
    if name and not (reopened(bench.folder.parent, name) and model.is_file()):
        raise InputError(one_line(name), "study", "no model of its own yet", "one that was opened with this version")
    other = replace(bench.opening, model=model).study() if name else None
    if other is not None:
        _cut(other, bench.study.stretches)
    bench.compare_with(name, other)


@contextmanager
def _told(pipe: Connection, told: Callable[[Exception], str] = one_line) -> Iterator[None]:
    """What goes wrong within is said."""
    try:
        yield
    except InputError as error:
        pipe.send(("failed", told(error)))
    except Exception as error:  # a bug of ours: the page says it, the terminal has the rest, and the study stays
        traceback.print_exc(file=sys.stderr)
        pipe.send(("failed", f"{type(error).__name__}: {told(error)}"))


def _show(pipe: Connection, bench: Bench) -> None:
    pipe.send(("shown", content_of(bench), bench.news()))


class _Telling(logging.Handler):
    """Sends what the library logs."""

    def __init__(self, pipe: Connection) -> None:
        super().__init__(logging.INFO)
        self._pipe = pipe

    def emit(self, record: logging.LogRecord) -> None:
        self._pipe.send(("warned" if record.levelno >= logging.WARNING else "said", record.getMessage()))


# --- the session's folder -----------------------------------------------------------------------------------


class _Done(BaseModel):
    """What was done in a session, as its folder says it."""

    name: str = ""
    opening: Opening | None = None
    against: str = ""
    stretches: list[Stretch] = []
    steps: list[tuple[str, str]] = []
    settings: list[Setting] = []


def _opened(pipe: Connection, opening: Opening, sessions: Path, after_a_stop: bool) -> Bench:
    """The study as its session left it, or as its files give it.

    Raises:
        InputError: a file can't be used.
        OSError: the folder can't be made, or others can write to it.
    """
    study = opening.study()
    fingerprint = opening.fingerprint(study)
    assert opening.model is not None
    folder = own_folder(sessions / f"{opening.model.stem[:_LONGEST_STEM]}-{fingerprint[:10]}")
    pipe.send(("opened", folder))
    bench, done = Bench(study, opening, folder, fingerprint), _Done()
    with suppress(OSError, ValidationError):
        done = _Done.model_validate_json((folder / STEPS).read_bytes())
    if not _restored(bench) and not after_a_stop:
        _do_again(study, done)
        _save(bench)
    if done.against and bench.study.steps:
        with _told(pipe):
            _set_against(bench, done.against)
            _save(bench)
    return bench


def _restored(bench: Bench) -> bool:
    """Whether the session's folder holds the study as this very version of lptn left it, which is then the bench's."""
    path = bench.folder / STUDY
    try:
        # A pickle runs what it says: only this user can have put one into the folder, as the programs that they run.
        if is_own_file(path):
            stored = io.BytesIO(path.read_bytes())
            if pickle.load(stored) == _written_by(bench.fingerprint):
                kept, heat = pickle.load(stored)
                if vars(kept).keys() == vars(bench.study).keys():  # else it is of other code of the same version
                    bench.study, bench.heat = kept, heat
                    return True
    except FileNotFoundError:
        pass
    except Exception:
        logger.info("the session's study can't be read; its steps are done again")
    return False


def _do_again(study: Study, done: _Done) -> None:
    """The first fit, and the steps that a session of another version took."""
    study.fit()
    try:
        _cut(study, done.stretches)
        for effect, at in done.steps:
            study.add(effect, at)
        for setting in done.settings:
            study.set_parameter(setting.name, setting.value, bounds=setting.bounds, fixed=setting.fixed)
    except InputError as error:
        logger.warning("not all of the session's steps can be done again: %s", one_line(error))


def _cut(study: Study, stretches: Iterable[Stretch]) -> None:
    """Hold out or leave out of a study's runs what was held out or left out of the same runs elsewhere."""
    for stretch in stretches:
        (study.hold_out if stretch.held_out else study.leave_out)(stretch.run, stretch.start, stretch.stop)


def _save(bench: Bench) -> None:
    study = bench.study
    done = _Done(
        name=study.model.network.name,
        opening=bench.opening.absolute(),
        against=bench.against[0],
        stretches=list(study.stretches),
        steps=[step.key for step in study.steps[1:]],
        settings=list(study.settings),
    )
    write_whole(bench.folder / STEPS, done.model_dump_json(indent=2) + "\n")
    stored = pickle.dumps(_written_by(bench.fingerprint)) + pickle.dumps((study, bench.heat))
    write_whole(bench.folder / STUDY, stored)
    write_whole(bench.folder / NOW, study.file.text)


def _written_by(fingerprint: str) -> tuple[str, ...]:
    return lptn.__version__, sys.version, fingerprint


def written(folder: Path) -> Note:
    """What a person wrote on the study of a folder; what can't be read is put aside: no new note replaces it."""
    with suppress(OSError):
        try:
            return Note.model_validate_json((folder / WRITTEN).read_bytes())
        except ValidationError:
            (folder / WRITTEN).replace(folder / f"unread-{WRITTEN}")
    return Note()


def recent(sessions: Path) -> list[dict[str, Any]]:
    """The studies that can be opened again and the desks without one, the last that was changed first."""
    found, of_studies = list[dict[str, Any]](), set[str]()
    folders = [folder for folder in sessions.iterdir() if folder.is_dir()] if sessions.is_dir() else []
    for folder in folders:
        with suppress(OSError, ValidationError):
            done = _Done.model_validate_json((folder / STEPS).read_bytes())
            if done.opening is not None and done.opening.model is not None:
                desk = done.opening.model.parent.name
                of_studies.add(desk)
                desk = desk if is_desk(sessions / desk) else ""
                logs = [log.name for log in done.opening.logs]
                about = {"study": folder.name, "desk": desk, "name": done.name, "logs": logs, "steps": len(done.steps)}
                about |= written(folder).model_dump(include={"text", "tags"})
                found.append(about | {"changed": (folder / STEPS).stat().st_mtime})
    for folder in folders:
        if is_desk(folder) and folder.name not in of_studies:
            with suppress(OSError):
                logs = [path.name for path in logs_in(folder)]
                about = {"study": "", "desk": folder.name, "name": "", "logs": logs, "steps": 0}
                if logs or (folder / MODEL).is_file():
                    found.append(about | {"changed": folder.stat().st_mtime})
    return sorted(found, key=lambda one: -one["changed"])[:_MOST_RECENT]


def reopened(sessions: Path, name: str) -> Opening | Path:
    """What one of these is opened with.

    Raises:
        InputError: there is none of that name.
    """
    if any(one["desk"] == name for one in recent(sessions)):
        return sessions / name
    with suppress(OSError, ValidationError):
        if any(one["study"] == name for one in recent(sessions)):
            done = _Done.model_validate_json((sessions / name / STEPS).read_bytes())
            if done.opening is not None:
                return done.opening
    raise InputError(one_line(name), "study", "none of that name", "one that the page lists")
