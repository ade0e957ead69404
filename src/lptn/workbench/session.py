"""A session: the process with the study, its messages so far, and its state as every tab sees it."""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import threading
import time
from dataclasses import replace
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import platformdirs

from lptn.basics.arrays import FloatArray
from lptn.basics.errors import InputError
from lptn.basics.files import finite, held, write_whole
from lptn.report.network_drawing import NetworkCourse
from lptn.report.text import for_people
from lptn.workbench.bench import News
from lptn.workbench.calculation import NOW, WRITTEN, recent, reopened, work, written
from lptn.workbench.desk import FILE, checked_name, delete_if_empty, new_desk, place_for
from lptn.workbench.lines import RunLines
from lptn.workbench.opening import EXAMPLES, Opening
from lptn.workbench.orders import (
    AtDesk,
    Keep,
    Leave,
    LinesAsked,
    Model,
    Name,
    NetworkAsked,
    Note,
    Open,
    Order,
    Recent,
    ResidualsAsked,
    SpecialAsked,
)
from lptn.workbench.residuals import Residuals, residuals
from lptn.workbench.special import Special, special

_MOST_SAID = 200  # sentences of one order that are kept
_HEARS_CTRL_C = 0.5  # s after which a wait looks whether somebody pressed it
_GRACE = 2.0  # s in which a process that was ended is gone

_BEGINNING = "reading"
_WORDS = {
    "fit": "fitting the model as given",
    "diagnose": "searching for missing effects",
    "improve": "adding missing effects, step by step",
    "keep": "adding the steps so far",
    "add": "fitting with the effect added",
    "try": "fitting with the effect added, to try it",
    "against": "reading the logs as the other study does",
    "report": "writing the report",
    "fmu": "building the FMU",
    "leave_out": "fitting without the interval",
    "hold_out": "fitting without the held-out interval",
    "fit_on": "fitting the interval alone",
    "use_again": "fitting with the interval",
    "use_all": "fitting all data again",
    "undo": "undoing the last step",
    "redo": "adding again",
    "back": "going back",
    "set": "fitting with the changed parameter",
    "begin": "reading the logs",
    **dict.fromkeys(
        ("look", "job", "holdout_after", "model", "map", "air", "rate", "remedy", "guesses", "remove", "entry"),
        "reading",
    ),
}


_SHOWN = {name: {key: getattr(one, key) for key in ("title", "about", "solved")} for name, one in EXAMPLES.items()}
"""Of the examples, on the page that a workbench begins with."""


class BusyError(RuntimeError):
    """An order was given while another is being done."""


class WorkbenchSession:
    """A study that is shown in several tabs.

    Args:
        opening: model file, logs and options; `None` for the page that a workbench begins with.
        sessions: the folder of all sessions; by default in the user's state folder.
    """

    def __init__(self, opening: Opening | None, sessions: Path | None = None) -> None:
        self.opening: Opening | Path | str | None = opening
        """A study's files, a desk's folder, the name of an example; `None` where nothing is open."""
        self._begins = opening is None  # with a page on which to choose
        self._sessions = platformdirs.user_state_path("lptn") / "sessions" if sessions is None else sessions
        self.folder: Path | None = None
        """Where the session is kept; known once the logs are read."""
        self._written = Note()
        self._lock = threading.Condition()
        self._version = 0
        self._content: dict[str, Any] = {}
        self.model_file = ""
        """The text of the model file as it is now."""
        self._busy: dict[str, Any] | None = None
        self._failed = ""
        self._notes: list[str] = []
        self._lines: dict[str, RunLines] = {}
        self._networks: dict[str, NetworkCourse] = {}
        self._refused: InputError | None = None
        self._process: multiprocessing.process.BaseProcess | None = None
        self._pipe: Connection | None = None
        self._next: list[Order | Keep] = []  # to be done when what is being done is done
        self._held: int | None = None  # the lock on the folder
        self._worked = False  # whether the process did what it began with

    # --- the process that works -----------------------------------------------------------------

    def open(self) -> WorkbenchSession:
        """Start the process, and wait until it has read the logs.

        Raises:
            InputError: a file can't be used.
        """
        if self.opening is None:
            return self
        self._begin()
        with self._lock:
            while self.folder is None and self._refused is None:
                self._lock.wait(_HEARS_CTRL_C)
            if self._refused is not None:
                raise self._refused
        return self

    def _begin(self, after_a_stop: bool = False) -> None:
        # A forked process would inherit locks that the server's threads hold; a new one does not.
        context = multiprocessing.get_context("spawn")
        here, there = context.Pipe()
        assert self.opening is not None
        self._refused = None
        arguments = (there, self.opening, self._sessions, os.getpid(), after_a_stop)
        process = context.Process(target=work, args=arguments, daemon=True)
        self._busy = {"what": "open", "words": _BEGINNING, "said": [], "since": time.time()}
        self._process, self._pipe, self._worked = process, here, False
        process.start()
        there.close()
        threading.Thread(target=self._listen, args=(process, here), daemon=True).start()

    def _listen(self, process: multiprocessing.process.BaseProcess, pipe: Connection) -> None:
        """Receive the messages of a process until it ends."""
        with contextlib.suppress(EOFError, OSError):
            while True:
                kind, *rest = pipe.recv()
                with self._lock:
                    if self._process is not process:
                        return
                    getattr(self, f"_heard_{kind}")(*rest)
                    self._changed()
        process.join(_GRACE)
        with self._lock:
            if self._process is process and self._refused is None:
                self._ended(process.exitcode)
                self._changed()

    def _ended(self, status: int | None) -> None:
        """The process ended by itself, as where memory is short; what can't even begin is not begun again."""
        problem = f"the calculation ended by itself (status {status})"
        if not self._worked:
            self._heard_refused(InputError("workbench", "process", problem, "one that reads the logs"))
            return
        self._begin(after_a_stop=True)
        self._failed = f"{problem}; the study is as it was before"

    def _heard_opening(self, opening: Opening | Path) -> None:
        self.opening, self._begins = opening, True
        if isinstance(opening, Opening):
            self._next = []  # what waits for the desk is no order for a study

    def _heard_opened(self, folder: Path) -> None:
        if folder != self.folder:  # else it is held since before a stop
            self._let_go()
            self._held = held(folder / "lock")
        if self._held is None:
            problem = "open already in another `lptn open`, whose changes would be lost"
            expected = "its page in the browser, or that one ended with Ctrl-C"
            if self._process is not None:
                self._process.kill()
            self._heard_refused(InputError(folder, "session", problem, expected))
            return
        self.folder, self._written = folder, written(folder)
        if self._busy is not None and "tiles" not in self._content and not isinstance(self.opening, Path):
            self._busy["words"] = _WORDS["fit"]

    def _let_go(self) -> None:
        if self._held is not None:
            os.close(self._held)
            self._held = None

    def _heard_said(self, text: str) -> None:
        if self._busy is not None:
            self._busy["said"] = [*self._busy["said"][-_MOST_SAID:], for_people(text)]

    def _heard_found(self, rows: list[dict[str, Any]]) -> None:
        if self._busy is not None:
            self._busy["found"] = rows

    def _heard_warned(self, text: str) -> None:
        if text not in self._notes:
            self._notes.append(text)

    def _heard_failed(self, text: str) -> None:
        """Files that come together are looked at one after another: what was refused is said until a person orders."""
        if (said := for_people(text)) not in self._failed.split(" · "):
            self._failed = " · ".join(filter(None, (self._failed, said)))

    def _heard_refused(self, error: InputError) -> None:
        if self._begins:
            self._leave()
        self._refused, self._failed, self._busy = error, str(error), None

    def _heard_shown(self, content: dict[str, Any], news: News) -> None:
        self.model_file = str(content.pop("file"))
        self._content = finite(content)
        lines = news.runs or self._lines
        for (segment, model), readings in news.predicted.items():
            lines[segment] = lines[segment].with_line(model, readings)
        for segment in lines:
            lines[segment] = replace(lines[segment], heat=news.heat.get(segment), spread=news.spreads.get(segment))
        self._lines, self._networks = lines, news.networks

    def _heard_done(self) -> None:
        self._busy, self._worked = None, True
        if self._next:
            self._send(self._next.pop(0))

    def _changed(self) -> None:
        self._version += 1
        self._lock.notify_all()

    # --- what tabs ask for -----------------------------------------------------------------------

    def state(self, since: int = -1) -> dict[str, Any] | None:
        """All that a page shows but the lines; `None` where nothing has changed since a version.

        Args:
            since: the version that the page has.
        """
        with self._lock:
            if since == self._version:
                return None
            state = {
                "version": self._version,
                "busy": self._busy and {**self._busy, "said": list(self._busy["said"])},
                "failed": self._failed,
                "notes": list(self._notes),
                "folder": str(self.folder or ""),
                "written": self._written.model_dump(exclude={"what"}),
                "begins": self._begins,
                "recent": recent(self._sessions) if self._begins and self.opening is None else [],
                "others": self._others(),
                "largest": FILE.most,
                "examples": _SHOWN if self._begins and not isinstance(self.opening, Opening) else {},
                "example": self.opening if isinstance(self.opening, str) else "",
            }
            return {**self._content, **state}

    def _others(self) -> list[dict[str, Any]]:
        """The studies whose models can be set beside the one that is open."""
        if self.folder is None or "tiles" not in self._content:
            return []
        others = (one for one in recent(self._sessions) if one["study"] not in ("", self.folder.name))
        return [one for one in others if (self._sessions / str(one["study"]) / NOW).is_file()]

    def lines(self, asked: LinesAsked) -> dict[str, dict[str, FloatArray]]:
        """The lines that plots want, by node, those of signals under the empty name.

        Raises:
            InputError: no such run, node or signal.
        """
        lines, models = self._lines_of(asked.segment)
        if models["given"] == models["now"]:
            del models["given"]
        models |= {"attempt": asked.attempt}
        wanted: dict[str, str | list[str]] = {node: node for node in asked.node}
        wanted |= {"": asked.signal} if asked.signal else {}
        return {key: lines.window(what, models, asked.start, asked.stop, asked.points) for key, what in wanted.items()}

    def special(self, asked: SpecialAsked) -> Special:
        """What is special in a stretch, at a node, to the error of the model as it is now.

        Raises:
            InputError: no such run or node, or a stretch that can't be compared with the rest.
        """
        lines, models = self._lines_of(asked.segment)
        error, origin = lines.error(asked.node, models["now"]), self._segment(asked.segment)["origin"]
        return special(lines.time, error, lines.inputs, asked.start, asked.stop, origin)

    def residuals(self, asked: ResidualsAsked) -> Residuals:
        """What the errors of a node look like where they count.

        Raises:
            InputError: no such run or node, or too little was measured.
        """
        lines, models = self._lines_of(asked.segment)
        segment = self._segment(asked.segment)
        counts = (lines.time >= segment["from"]) & (lines.time < segment["to"])
        step = float(lines.time[1] - lines.time[0])
        return residuals(lines.error(asked.node, models["now"])[counts], step)

    def network(self, asked: NetworkAsked) -> dict[str, str | float]:
        """The network as the model as it is now has it at a moment of a run: a drawing as SVG, and its time [s].

        Raises:
            InputError: no such run.
        """
        with self._lock:
            course = self._networks.get(asked.segment)
        if course is None:
            raise InputError("network", "run", asked.segment, f"one of {', '.join(self._networks) or 'none yet'}")
        time = course.hottest[2] if asked.time is None else asked.time
        return {"drawing": course.drawing(time), "time": time}

    def _segment(self, key: str) -> dict[str, Any]:
        return next(entry for entry in self._content["segments"] if entry["key"] == key)

    def _lines_of(self, segment: str) -> tuple[RunLines, dict[str, str]]:
        with self._lock:
            lines = self._lines.get(segment)
            models = {name: self._content.get(name, "") for name in ("given", "now", "against")}
        if lines is None:
            raise InputError("plot", "run", segment, f"one of {', '.join(self._lines) or 'none yet'}")
        return lines, models

    def do(self, order: Order) -> int:
        """Have an order done.

        Returns:
            the version of the state in which it is being done.

        Raises:
            BusyError: another one is being done.
        """
        if isinstance(order, Open | Recent | Leave):
            self._go(order)
            return self._version
        if isinstance(order, Note):
            self._note(order)
            return self._version
        with self._lock:
            if self._busy is not None or self._pipe is None:
                raise BusyError(f"{(self._busy or {}).get('words', 'nothing is open')}: stop that first")
            if isinstance(order, AtDesk) != isinstance(self.opening, Path):
                raise BusyError("that is no longer open: another tab has gone on")
            self._failed = ""
            self._send(order)
            self._changed()
            return self._version

    def _send(self, order: Order | Keep) -> None:
        assert self._pipe is not None
        self._busy = {"what": order.what, "words": _WORDS[order.what], "said": [], "since": time.time()}
        self._pipe.send(order)

    def _note(self, order: Note) -> None:
        """Write a note, whatever is being done.

        Raises:
            BusyError: no study is open that it could be on.
        """
        with self._lock:
            if self.folder is None or isinstance(self.opening, Path):
                raise BusyError("nothing is open that a note could be on")
            self._written = Note.model_validate(self._written.model_dump() | order.model_dump(exclude_unset=True))
            write_whole(self.folder / WRITTEN, self._written.model_dump_json(indent=2) + "\n")
            self._changed()

    def _go(self, order: Open | Recent | Leave) -> None:
        """Begin with something else, in place of what is open: that stays in its folder.

        Raises:
            InputError: there is nothing of that name.
            BusyError: files were given: they are what this workbench is for.
        """
        opening: Opening | Path | str | None = order.name if isinstance(order, Open) else None
        if isinstance(order, Recent):
            opening = reopened(self._sessions, order.name)
        with self._lock:
            if not self._begins:
                raise BusyError("files are open: others come with `lptn open` alone")
            left, process = self.opening, self._leave()
            if opening is not None:
                self.opening = opening
                self._begin()
            self._failed = ""
            self._changed()
        _end(process, left)

    def _leave(self) -> multiprocessing.process.BaseProcess | None:
        """Nothing is open; the process that is to be ended."""
        process, self._process, self._pipe, self.opening, self.folder = self._process, None, None, None, None
        self._content, self._lines, self._networks, self._notes, self._next = {}, {}, {}, [], []
        self._busy, self._refused = None, None
        self._let_go()
        return process

    def place_for(self, name: str, based: str | None) -> Path:
        """Where a file goes that the page sends; it is then on the desk, which is made for the first one.

        Args:
            name: of the file.
            based: of a model that was edited, the fingerprint of the text that it was made of.

        Raises:
            BusyError: a study is open.
            InputError: it can't be taken under this name.
            OSError: there is no place for it.
        """
        checked_name(name)
        with self._lock:
            if not self._begins or isinstance(self.opening, Opening | str):
                raise BusyError("a study is open: files are for the page that a workbench begins with")
            if self.opening is None:
                self.opening, self._failed = new_desk(self._sessions), ""
                self._begin()
                self._changed()
            return place_for(self.opening, name, based)

    def arrived(self, path: Path) -> None:
        """A file has come whole: the desk looks at it, once it has done what it does."""
        with self._lock:
            if self.opening not in path.parents:
                return
            order = Model(what="model", source=path.name) if path.suffix == ".urdf" else Name(what="look")
            if self._busy is None:
                self._send(order)
            elif order not in self._next:
                self._next.append(order)
            self._changed()

    def stop(self) -> None:
        """End what is being done; the study stays as it was before, but for the steps that a search had found."""
        with self._lock:
            if self._busy is None or (self._busy["what"] == "open" and not self.folder):
                return
            process = self._process
            steps = tuple((row["effect"], row["at"]) for row in self._busy.get("found", ()))
            self._begin(after_a_stop=True)
            self._failed, self._next = "", [Keep(steps=steps)] if steps else []
            self._changed()
        _end(process)

    def close(self) -> None:
        """End the process; what was done stays in the folder."""
        with self._lock:
            process, self._process = self._process, None
            if self._pipe is not None:
                self._pipe.close()
        _end(process, self.opening)
        self._let_go()


def _end(process: multiprocessing.process.BaseProcess | None, left: object = None) -> None:
    """End a process; of a desk that is left, and on which there is nothing, nothing stays."""
    if process is not None:
        process.kill()
        process.join(_GRACE)
    if isinstance(left, Path):
        delete_if_empty(left)
