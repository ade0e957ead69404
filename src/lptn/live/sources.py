"""Where messages come from: lines, a growing file, UDP, a log replayed, Python. Each fills an inbox from its thread."""

from __future__ import annotations

import os
import socket
import stat
import sys
import time
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from threading import Event
from typing import BinaryIO

import numpy as np

from lptn.basics.errors import InputError
from lptn.identify.data import LoadedModel
from lptn.live.messages import LONGEST, Numbers
from lptn.live.sampling import wanted_columns
from lptn.logs.columns import ColumnSource
from lptn.logs.guess import guess
from lptn.logs.reading import choose_columns, open_log

_MOST = 10_000  # messages that wait: ten seconds at 1 kHz
_FULL = 0.01  # s between two looks of a source that waits at a full inbox
LOOPBACK = "127.0.0.1"
FREE_PORT = "a free port of this machine"
_OVERFLOWS = 40  # SO_RXQ_OVFL of Linux, which Python's `socket` does not name
Message = tuple[float, bytes | Numbers]
"""When it was received [s since 1970, of a clock that does not jump], and what it says: bytes to decode, or numbers."""


@contextmanager
def one_line_if_refused(place: str, what: str, expected: str, extra: str = "") -> Iterator[None]:
    """Within it, what the system refuses, or a package of an `extra` that is not installed, is one line.

    Raises:
        InputError: the system refuses the `expected` file or address, or the package is absent.
        OSError, RuntimeError: as they come where nothing is `expected` of the system.
    """
    try:
        yield
    except ImportError as error:
        raise InputError(place, what, str(error), f"pip install 'lptn[{extra}]'") from error
    except (OSError, RuntimeError) as error:
        if not expected:
            raise
        raise InputError(place, what, getattr(error, "strerror", None) or str(error), expected) from error


class Inbox:
    """A bounded queue of messages: a source that can wait does; of others the newest win, and the rest is counted.

    Args:
        waits: whether the source can wait.
    """

    def __init__(self, *, waits: bool) -> None:
        self._waits = waits
        self._queue: deque[Message] = deque(maxlen=_MOST)
        self._come = Event()
        self._offset = time.time() - time.monotonic()
        self.dropped = 0
        self.closed = False
        self.error: Exception | None = None

    def put(self, payload: bytes | Numbers) -> None:
        """Add a message that came now."""
        while self._waits and len(self._queue) == _MOST and not self.closed:
            time.sleep(_FULL)
        self.dropped += len(self._queue) == _MOST
        self._queue.append((time.monotonic() + self._offset, payload))
        self._come.set()

    def take(self, timeout: float) -> list[Message]:
        """All that has come, after waiting for so many seconds at most."""
        self._come.wait(timeout)
        if not self.closed:
            self._come.clear()
        return [self._queue.popleft() for _ in range(len(self._queue))]

    def close(self, error: Exception | None = None) -> None:
        """Nothing more comes."""
        self.closed, self.error = True, error
        self._come.set()


class Source(ABC):
    """Something that says numbers.

    Args:
        name: for messages.
        live: messages come as things happen; else the source waits, and only its own time stamps say when it was.
    """

    def __init__(self, name: str, *, live: bool) -> None:
        self.name, self.live, self.inbox = name, live, Inbox(waits=not live)
        self.defaults: dict[str, ColumnSource] = {}
        """Where quantities stand in a format that says so itself."""

    def put_lines(self, text: bytes) -> bytes:
        """Put whole lines into the inbox; what is left of the text, unless it is too long to become a line."""
        *lines, rest = text.split(b"\n")
        for line in lines:
            self.inbox.put(line)
        return rest if len(rest) < LONGEST else b""

    @abstractmethod
    def run(self, stop: Event) -> None:
        """Fill the inbox until the source ends or `stop` is set; runs in a thread."""


class Lines(Source):
    """Lines of standard input, or of another stream with a file descriptor."""

    def __init__(self, descriptor: int | None = None, name: str = "standard input") -> None:
        self._descriptor = sys.stdin.fileno() if descriptor is None else descriptor
        # What writes into a pipe may be the robot's own program, which must never wait.
        super().__init__(name, live=not stat.S_ISREG(os.fstat(self._descriptor).st_mode))

    def run(self, stop: Event) -> None:
        rest = b""
        while not stop.is_set() and (chunk := os.read(self._descriptor, 1 << 16)):
            rest = self.put_lines(rest + chunk)
        if rest:
            self.inbox.put(rest)


class GrowingFile(Source):
    """Lines of a file from its beginning, and what is added to it; begun anew where it is replaced or cut."""

    _PAUSE = 0.1  # s between two looks at a file that has not grown

    def __init__(self, path: Path) -> None:
        if not path.is_file():
            raise InputError(path, "source", "no such file", "a file of JSON or CSV lines, -, or udp://HOST:PORT")
        with path.open("rb") as stream:
            if b"\0" in stream.read(4096):
                expected = "lines of JSON or CSV; a log of another format is replayed: --replay 1"
                raise InputError(path, "source", "a binary file", expected)
        super().__init__(str(path), live=False)
        self._path = path

    def run(self, stop: Event) -> None:
        while not stop.is_set():
            with suppress(FileNotFoundError), self._path.open("rb") as stream:  # which may be rotated just now
                self._follow(stream, stop)
            stop.wait(self._PAUSE)

    def _follow(self, stream: BinaryIO, stop: Event) -> None:
        rest, own = b"", os.fstat(stream.fileno())
        while not stop.is_set():
            while chunk := stream.read(1 << 16):
                rest = self.put_lines(rest + chunk)
            now = self._path.stat()
            if now.st_ino != own.st_ino or now.st_size < stream.tell():
                return
            stop.wait(self._PAUSE)


class Udp(Source):
    """Datagrams of JSON or CSV lines."""

    _WAIT, _GATHERED = 0.2, 0.01  # s until the thread looks whether it should end; between two looks at a busy socket

    def __init__(self, host: str, port: int) -> None:
        super().__init__(f"udp://{host}:{port}", live=True)
        self._socket = socket.socket(socket.AF_INET6 if ":" in host else socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 22)
        with suppress(OSError):  # another system than Linux does not say what it drops
            self._socket.setsockopt(socket.SOL_SOCKET, _OVERFLOWS, 1)
        with ExitStack() as refused:
            refused.callback(self._socket.close)
            with one_line_if_refused(self.name, "source", FREE_PORT):
                self._socket.bind((host, port))
            refused.pop_all()
        self.port = int(self._socket.getsockname()[1])

    def run(self, stop: Event) -> None:
        lost = 0
        with self._socket as receiver:
            while not stop.is_set():
                receiver.settimeout(self._WAIT)
                with suppress(TimeoutError, BlockingIOError):
                    payload, beside, *_ = receiver.recvmsg(1 << 16, socket.CMSG_SPACE(4))
                    self.inbox.put(payload)
                    for _, kind, count in beside:
                        if kind == _OVERFLOWS:  # of all that the system dropped since the socket is there
                            total = int.from_bytes(count[:4], sys.byteorder)
                            self.inbox.dropped, lost = self.inbox.dropped + total - lost, total
                    receiver.setblocking(False)
                    while True:
                        self.inbox.put(receiver.recv(1 << 16))
                time.sleep(self._GATHERED)  # a thread that wakes for each message costs more than the messages


class Push(Source):
    """Messages that a Python program gives, from any thread.

    Example:
        >>> from lptn.live import Push
        >>> source = Push()
        >>> source.push({"time": 0.0, "torque.knee": 3.0, "temperature.knee": 21.5})
        >>> source.end()
    """

    def __init__(self, name: str = "callback", *, live: bool = True) -> None:
        super().__init__(name, live=live)
        self._ended = Event()

    def push(self, numbers: Numbers) -> None:
        """Give a message: numbers by column name, nested or not."""
        self.inbox.put(numbers)

    def end(self) -> None:
        """Nothing more comes."""
        self._ended.set()

    def run(self, stop: Event) -> None:
        while not (stop.is_set() or self._ended.wait(0.1)):
            pass


class Replay(Source):
    """A log of any format that `lptn.logs` reads, as if it came now, so many times as fast; 0: as fast as it can."""

    def __init__(self, path: Path, speed: float, loaded: LoadedModel) -> None:
        super().__init__(str(path), live=False)
        table, columns = open_log(path, loaded.sources_of(path)[0])
        inputs, outputs, speeds = wanted_columns(loaded.model)
        guesses = guess(table, columns, inputs, outputs) if loaded.guessing else []
        choice = choose_columns(table, columns | {one.key: one.source for one in guesses}, inputs, outputs, speeds)
        sensors = {name for column in choice.outputs for name in choice.sources[column].columns}
        self._numbers = table.numbers((n for source in choice.sources.values() for n in source.columns), sensors)
        self._time = choice.sources["time"].values("time", self._numbers)
        self._speed = speed
        self.defaults = dict(table.defaults)

    def run(self, stop: Event) -> None:
        began = time.monotonic()
        for stamp, row in zip(self._time.tolist(), self._rows(), strict=True):
            ahead = (stamp - self._time[0]) / self._speed - (time.monotonic() - began) if self._speed else 0.0
            if (ahead > 0 and stop.wait(ahead)) or stop.is_set():
                return
            self.inbox.put(row)

    def _rows(self) -> Iterator[dict[str, float]]:
        names, at_once = list(self._numbers), 1000  # rows
        for first in range(0, self._time.size, at_once):
            block = np.column_stack([self._numbers[name][first : first + at_once] for name in names])
            for row in block.tolist():
                yield dict(zip(names, row, strict=True))
