"""The command `lptn open`: the workbench, a study as a page in this machine's browser."""

from __future__ import annotations

import signal
import sys
from contextlib import suppress
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter as Option
from cyclopts import validators

from lptn.basics.errors import InputError
from lptn.cli import options
from lptn.cli.terminal import progress


def open(  # noqa: A001 - the command's name
    model: Path | None = None,
    /,
    *logs: Path,
    data: options.Data = options.DATA,
    test: options.Test = None,
    browser: Annotated[bool, Option(negative="--no-browser")] = True,
    port: Annotated[int, Option(validator=validators.Number(gte=0, lte=65535))] = 0,
) -> None:
    """Open the workbench in the browser.

    It shows where the model fails and what is missing, and adds it. The page is served on this machine only. Your work
    is saved: the same command continues it. Ctrl-C ends it.

    It begins with files: without any, drop them on the page, or take a tour of two examples, five minutes each. Where
    there is no model, or columns have other names, the page asks what they mean.

    Example: lptn open leg.toml monday.parquet --holdout friday.parquet

    Example: lptn open monday.csv tuesday.csv

    Args:
        browser: Open the browser; otherwise only print the address.
        port: Port of the server; by default a free one.
    """
    held_out = [*(data.holdout or ()), *(test or ())]
    if model is not None and _is_log(model):
        logs, model = (model, *logs), None
    if model is not None:
        options.needs_logs(logs)
        options.check_inputs(model, *logs, *held_out)
    elif not logs and (given := [word for word, value in (("--holdout", data.holdout), ("--test", test)) if value]):
        raise InputError("command line", "MODEL", f"{given[0]} without a model", "a model file with its logs")
    options.check_logs(*logs, *held_out)
    from lptn.workbench.server import serve
    from lptn.workbench.session import WorkbenchSession

    session = WorkbenchSession(data.opening(model, logs, test) if logs else None)
    with progress("reading"):
        session.open()

    def ready(address: str, page: Path) -> None:
        where = f"; kept in {session.folder}" if session.folder else ""
        if isinstance(session.opening, Path):
            where += "; the page asks what is missing for a study"
        print(f"The workbench, until Ctrl-C{where}", flush=True)
        print(address, flush=True)
        if browser:
            show_in_browser(page)

    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))  # and take away what lies about for the browser
    with suppress(KeyboardInterrupt):
        serve(session, port, ready)
    print("Ended; the same command continues from here.")


def _is_log(path: Path) -> bool:
    from lptn.logs.reading import ENDINGS, pair_of

    return path.is_dir() or path.name.endswith(ENDINGS) or pair_of(path) is not None


def show_in_browser(page: Path) -> None:
    """Show a file in the browser, where there is a screen: a browser in the terminal would take its place."""
    import os
    import webbrowser

    if sys.platform in ("win32", "darwin") or os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"):
        webbrowser.open(page.as_uri())
