"""Processes that work for this one, and end with it."""

from __future__ import annotations

import os
import signal
import threading
import time
from concurrent.futures import ProcessPoolExecutor

_LOOKS = 1.0  # s between two looks at whether the parent is still there


def pool_of(jobs: int) -> ProcessPoolExecutor:
    """Processes that fall silent at Ctrl-C, and that don't outlive a parent that was killed.

    Args:
        jobs: how many.
    """
    return ProcessPoolExecutor(jobs, initializer=_begin, initargs=(os.getpid(),))


def _begin(parent: int) -> None:
    # The parent says what there is to say; a traceback from each worker is of no use to anybody.
    signal.signal(signal.SIGINT, lambda *_: os._exit(130))
    threading.Thread(target=_end_with, args=(parent,), daemon=True).start()


def _end_with(parent: int) -> None:
    while os.getppid() == parent:
        time.sleep(_LOOKS)
    os._exit(1)
