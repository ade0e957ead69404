"""Worker processes end with their parent, whatever ends it."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time

from lptn.basics.processes import pool_of

SCRIPT = """
import os, time
from lptn.basics.processes import pool_of

def work(_):
    os.write(1, f"{os.getpid()}\\n".encode())  # in one piece
    time.sleep(60)

if __name__ == "__main__":
    with pool_of(2) as pool:
        list(pool.map(work, range(2)))
"""


def _alive(pid: int) -> bool:
    """Running, and not only waiting for somebody to hear of its end."""
    on_outcome = subprocess.run(
        ["ps", "-o", "stat=", "-p", str(pid)], capture_output=True, text=True, check=False
    ).stdout
    return bool(on_outcome.strip()) and not on_outcome.strip().startswith("Z")


def test_workers_do_not_outlive_a_parent_that_was_killed() -> None:
    started = subprocess.Popen([sys.executable, "-c", SCRIPT], stdout=subprocess.PIPE, text=True)
    assert started.stdout is not None
    workers = [int(started.stdout.readline()) for _ in range(2)]
    assert all(map(_alive, workers))
    os.kill(started.pid, signal.SIGKILL)
    started.communicate(timeout=30)
    stop = time.monotonic() + 20
    while any(map(_alive, workers)) and time.monotonic() < stop:
        time.sleep(0.05)
    assert not any(map(_alive, workers))


def test_ctrl_c_leaves_no_traceback_of_a_worker() -> None:
    started = subprocess.Popen(
        [sys.executable, "-c", SCRIPT],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    assert started.stdout is not None
    workers = [int(started.stdout.readline()) for _ in range(2)]
    os.killpg(started.pid, signal.SIGINT)
    _, complained = started.communicate(timeout=30)
    assert complained.count("Process ") == 0
    assert complained.rstrip().splitlines()[-1].startswith(("KeyboardInterrupt", "concurrent.futures.process.Broken"))
    assert not any(map(_alive, workers))


def test_no_more_workers_than_the_machine_can_bear() -> None:
    for jobs in (1, 2, 1_000, 10**18):
        with pool_of(jobs) as pool:
            assert pool._max_workers == min(jobs, 2 * (os.cpu_count() or 1))  # type: ignore[attr-defined]
