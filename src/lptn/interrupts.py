"""Ctrl-C where it can be heard.

CasADi's Python layer takes any exception that rises while it converts its arguments for a mismatch of types: it
drops a `KeyboardInterrupt` and returns nonsense. So an interrupt that arrives inside CasADi is held back until
control is with this package again.
"""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

_AGAIN = 0.005  # s
_DEAF = "casadi"
_OURS = "lptn"
_held_back = threading.Event()


@contextmanager
def heard_interrupts() -> Iterator[None]:
    """Within it, Ctrl-C raises `KeyboardInterrupt`, but never inside CasADi.

    Does nothing outside the main thread, and where Ctrl-C is not handled in Python's own way.
    """
    usual = threading.current_thread() is threading.main_thread()
    if not usual or signal.getsignal(signal.SIGINT) is not signal.default_int_handler:
        yield
        return
    signal.signal(signal.SIGINT, _interrupt)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, signal.default_int_handler)


def _interrupt(number: int, frame: FrameType | None) -> None:
    if not _inside_casadi(frame):
        raise KeyboardInterrupt
    if not _held_back.is_set():  # one is enough, however often it was pressed
        _held_back.set()
        again = threading.Timer(_AGAIN, _press_again, [number])
        again.daemon = True
        again.start()


def _press_again(number: int) -> None:
    _held_back.clear()
    signal.raise_signal(number)


def _inside_casadi(frame: FrameType | None) -> bool:
    """Whether CasADi was called more recently than this package, as it is while it converts what it was given."""
    while frame is not None:
        room = str(frame.f_globals.get("__name__", "")).partition(".")[0]
        if room in (_DEAF, _OURS):
            return room == _DEAF
        frame = frame.f_back
    return False
