"""Two heaters on the workbench, in this process; and the command itself, with a browser."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import Browser, expect, sync_playwright

from lptn.basics.arrays import FloatArray
from lptn.workbench.bench import Bench
from lptn.workbench.opening import Opening

EXAMPLE = Path(__file__).parents[2] / "examples" / "tclab"
OPENING = Opening(EXAMPLE / "two_heaters.toml", (EXAMPLE / "log.csv",), holdout_after=300.0)


def unpacked(answer: bytes) -> dict[str, dict[str, FloatArray]]:
    """Lines by node, as the page's script reads them."""
    head, _, _ = answer.partition(b"\n")
    assert (len(head) + 1) % 8 == 0
    values = iter(np.frombuffer(answer[len(head) + 1 :], dtype="<f8"))
    return {
        node: {name: np.array([next(values) for _ in range(size)]) for name in names}
        for node, (names, size) in json.loads(head).items()
    }


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Bench:
    """Fitted as given."""
    study = OPENING.study()
    study.fit()
    return Bench(study, OPENING, tmp_path_factory.mktemp("session"), OPENING.fingerprint(study))


# --- the command, as a person starts it, and a browser ---------------------------------------------------------------

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
PATIENCE = 60_000  # ms, for a fit on a busy machine
FILES = [str(EXAMPLE / "two_heaters.toml"), str(EXAMPLE / "log.csv"), "--holdout-after", "300"]


class Server:
    """`lptn open`, as a person starts it."""

    def __init__(self, state: Path, port: int = 0, files: Sequence[str] = FILES) -> None:
        surroundings = os.environ | {"XDG_STATE_HOME": str(state), "PYTHONUNBUFFERED": "1"}
        words = [sys.executable, "-m", "lptn", "open", *files, "--no-browser", "--port", str(port)]
        self.process = subprocess.Popen(words, env=surroundings, stdout=subprocess.PIPE, text=True)
        assert self.process.stdout is not None
        lines = [self.process.stdout.readline().strip() for _ in range(2)]
        match = re.fullmatch(r"(http://127\.0\.0\.1:(\d+))/\?token=\S+", lines[1])
        assert match, lines
        self.address, self.home, self.port = match[0], match[1], int(match[2])

    def kill(self) -> None:
        """As a crash does."""
        with self.process:
            self.process.kill()


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    """Debian's browser, without a screen."""
    expect.set_options(timeout=PATIENCE)
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        yield browser
        browser.close()
