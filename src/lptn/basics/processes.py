"""Threads, worker processes and Ctrl-C."""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache, wraps
from types import FrameType
from typing import TYPE_CHECKING, ParamSpec, TypeVar

if TYPE_CHECKING:  # every command imports this file, few need threads or processes
    from concurrent.futures import ProcessPoolExecutor

    from threadpoolctl import ThreadpoolController

# --- Small matrix products on one thread: several threads wait for each other longer than they work ---


Arguments = ParamSpec("Arguments")
Result = TypeVar("Result")


@cache
def _libraries(_scipy: bool) -> ThreadpoolController:
    """Those that are loaded; SciPy brings a BLAS of its own, later than NumPy."""
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController()


def one_blas_thread(function: Callable[Arguments, Result]) -> Callable[Arguments, Result]:
    """The same function, its matrix products on one thread.

    The products of a fit are many and narrow. With a busy machine, or with fits side by side in processes, a
    threaded BLAS was measured to take ten times as long.
    """

    @wraps(function)
    def alone(*arguments: Arguments.args, **named: Arguments.kwargs) -> Result:
        with _libraries("scipy.linalg" in sys.modules).limit(limits=1, user_api="blas"):
            return function(*arguments, **named)

    return alone


# --- Processes that work for this one, and end with it --------------------------------------------


def pool_of(jobs: int) -> ProcessPoolExecutor:
    """Processes that fall silent at Ctrl-C, and that don't outlive a parent that was killed.

    Args:
        jobs: how many at most; two for each processor, since each takes 150 MB.
    """
    from concurrent.futures import ProcessPoolExecutor

    return ProcessPoolExecutor(
        min(jobs, 2 * (os.cpu_count() or 1)), initializer=begin_as_worker, initargs=(os.getpid(),)
    )


def begin_as_worker(parent: int) -> None:
    """Make this process fall silent at Ctrl-C, and end with its parent.

    The parent says what there is to say; a traceback from each worker is of no use to anybody.

    Args:
        parent: its number.
    """

    def end_with_it() -> None:
        while os.getppid() == parent:
            time.sleep(1.0)  # s
        os._exit(1)

    signal.signal(signal.SIGINT, lambda *_: os._exit(130))
    threading.Thread(target=end_with_it, daemon=True).start()


# --- Ctrl-C, but never inside CasADi ---------------------------------------------------------------
# CasADi's Python layer takes any exception that rises while it converts its arguments for a mismatch of types: it
# drops a `KeyboardInterrupt` and returns nonsense. So an interrupt that arrives inside CasADi is held back until
# control is with this package again.


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

        def press_again() -> None:
            _held_back.clear()
            signal.raise_signal(number)

        again = threading.Timer(0.005, press_again)  # s; CasADi's conversion takes less, and a person notices nothing
        again.daemon = True
        again.start()


def _inside_casadi(frame: FrameType | None) -> bool:
    """Whether CasADi was called more recently than this package, as it is while it converts what it was given."""
    while frame is not None:
        package = str(frame.f_globals.get("__name__", "")).partition(".")[0]
        # An interrupt may come while this file holds another one back, which is inside CasADi still.
        if package in ("casadi", "lptn") and frame.f_globals is not globals():
            return package == "casadi"
        frame = frame.f_back
    return False
