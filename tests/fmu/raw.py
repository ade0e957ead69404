"""FMI functions called as an importer in C calls them: status codes come back, nothing is raised."""

from __future__ import annotations

import ctypes
from pathlib import Path
from types import TracebackType
from typing import Any, Self
from xml.etree import ElementTree
from zipfile import ZipFile

from lptn.fmu import Exported

OK, WARNING, DISCARD, ERROR = range(4)
Doubles = ctypes.POINTER(ctypes.c_double)
_LOG2 = ctypes.CFUNCTYPE(
    None, ctypes.c_void_p, ctypes.c_char_p, ctypes.c_int, ctypes.c_char_p, ctypes.c_char_p
)  # what follows the text is never read
_LOG3 = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_int, ctypes.c_char_p, ctypes.c_char_p)
_UPDATE = ctypes.CFUNCTYPE(
    None,
    ctypes.c_void_p,
    ctypes.c_double,
    *[ctypes.c_bool] * 4,
    ctypes.POINTER(ctypes.c_bool),
    ctypes.POINTER(ctypes.c_double),
)


class _Callbacks2(ctypes.Structure):
    _fields_ = (("logger", _LOG2), *((name, ctypes.c_void_p) for name in ("calloc", "free", "finished", "environment")))


def doubles(*values: float) -> Any:
    """An array of C doubles."""
    return (ctypes.c_double * len(values))(*values)


class Raw:
    """An instance of an exported FMU.

    Args:
        exported: the FMU.
        folder: where to unpack it.
        exchange: `True` for Model Exchange, else Co-Simulation.
        logging: whether to switch logging on.
        events: whether Co-Simulation uses event mode (FMI 3); `event` then is whether the last step ended with one.
        update: FMI 3's intermediate update: gets (time, whether inputs are asked for), returns when to end, or `None`.
    """

    def __init__(
        self,
        exported: Exported,
        folder: Path,
        exchange: bool = False,
        logging: bool = True,
        update: Any = None,
        events: bool = False,
    ) -> None:
        with ZipFile(exported.path) as archive:
            archive.extractall(folder)
            root = ElementTree.fromstring(archive.read("modelDescription.xml"))
        self.said: list[tuple[str, str]] = []
        self.fmi, self.time, self._events = exported.fmi, 0.0, events
        self.names = exported.variables
        library = next(path for path in (folder / "binaries").rglob("*") if path.is_file())
        self._library = ctypes.CDLL(str(library))
        self._token = (root.get("guid") or root.get("instantiationToken") or "").encode()
        self._make(exchange, logging, update)

    def _make(self, exchange: bool, logging: bool, update: Any) -> None:
        if self.fmi == 2:
            hear = _LOG2(lambda *words: self.said.append((words[3].decode(), words[4].decode())))
            self._kept: Any = _Callbacks2(hear)
            make = self._library.fmi2Instantiate
            make.restype = ctypes.c_void_p
            self.instance = make(b"raw", int(not exchange), self._token, b"", ctypes.byref(self._kept), 0, int(logging))
        else:
            hear = _LOG3(lambda *words: self.said.append((words[2].decode(), words[3].decode())))
            called = _UPDATE(lambda *words: self._updated(update, words)) if update else _UPDATE()
            self._kept = (hear, called)
            name = "ModelExchange" if exchange else "CoSimulation"
            make = getattr(self._library, f"fmi3Instantiate{name}")
            make.restype = ctypes.c_void_p
            yes, no = ctypes.c_bool(logging), ctypes.c_bool(False)
            more = () if exchange else (ctypes.c_bool(self._events), ctypes.c_bool(True), None, ctypes.c_size_t(0))
            words = (b"raw", self._token, b"", no, yes, *more, None, hear)
            self.instance = make(*words) if exchange else make(*words, called)
        assert self.instance

    def _updated(self, update: Any, words: Any) -> None:
        at = update(words[1], bool(words[2]))
        if at is not None:
            words[6][0], words[7][0] = True, at

    def call(self, name: str, *arguments: Any) -> int:
        """A function's status, its name without `fmi2` or `fmi3`."""
        return int(getattr(self._library, f"fmi{self.fmi}{name}")(ctypes.c_void_p(self.instance), *arguments))

    def set_named(self, values: dict[str, float]) -> int:
        """The status of setting variables."""
        return self._values("Set", tuple(values), doubles(*values.values()))

    def get(self, *names: str) -> tuple[int, list[float]]:
        """The status, and the values of variables."""
        values = doubles(*[0.0] * len(names))
        status = self._values("Get", names, values)
        return status, list(values)

    def _values(self, verb: str, names: tuple[str, ...], values: Any) -> int:
        references = (ctypes.c_uint32 * len(names))(*(self.names[name] for name in names))
        size = ctypes.c_size_t(len(names))
        if self.fmi == 2:
            return self.call(f"{verb}Real", references, size, values)
        return self.call(f"{verb}Float64", references, size, values, size)

    def start(self, time: float = 0.0, stop: float | None = None) -> None:
        """Enter initialization mode and leave it."""
        has, end = stop is not None, ctypes.c_double(stop or 0.0)
        if self.fmi == 2:
            assert self.call("SetupExperiment", 0, ctypes.c_double(0), ctypes.c_double(time), int(has), end) == OK
            assert self.call("EnterInitializationMode") == OK
        else:
            words = (ctypes.c_bool(False), ctypes.c_double(0), ctypes.c_double(time), ctypes.c_bool(has), end)
            assert self.call("EnterInitializationMode", *words) == OK
        assert self.call("ExitInitializationMode") == OK
        self.time = time

    def go_continuous(self) -> None:
        """From event mode into continuous-time mode."""
        assert self.call("EnterContinuousTimeMode") == OK

    def step(self, start: float, size: float) -> int:
        """A communication step; `time` is where it ended, `early` whether it ended early."""
        if self.fmi == 2:
            status = self.call("DoStep", ctypes.c_double(start), ctypes.c_double(size), 1)
            self.time = start + size
            return status
        flags, reached = [ctypes.c_bool() for _ in range(3)], ctypes.c_double()
        words = (ctypes.c_double(start), ctypes.c_double(size), ctypes.c_bool(True))
        status = self.call("DoStep", *words, *map(ctypes.byref, flags), ctypes.byref(reached))
        self.event, self.early, self.time = bool(flags[0]), bool(flags[2]), reached.value
        return status

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        getattr(self._library, f"fmi{self.fmi}FreeInstance")(ctypes.c_void_p(self.instance))
