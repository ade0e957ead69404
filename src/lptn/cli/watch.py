"""The command `lptn watch`: a running robot's temperatures, limits and sensors, in a table or passed on."""

from __future__ import annotations

import sys
import time
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter as Option
from cyclopts import validators

from lptn.cli import options
from lptn.cli.terminal import is_quiet, out, show_written, write_json

if TYPE_CHECKING:
    from rich.live import Live
    from rich.table import Table

    from lptn.live.status import NodeStatus, Status
    from lptn.live.watch import Sink


def watch(
    model: Path,
    source: Annotated[str, Option(allow_leading_hyphen=True)],
    /,
    *,
    to: Annotated[list[str] | None, Option(consume_multiple=True)] = None,
    limit: list[str] | None = None,
    replay: Annotated[float | None, Option(validator=validators.Number(gte=0))] = None,
    state: Path | None = None,
    learn: Path | None = None,
    every: Annotated[float, Option(validator=validators.Number(gt=0))] = 30.0,
    coverage: options.Coverage = 0.9,
    calibration: Path | None = None,
    json: options.Json = None,
    columns: options.Columns = options.COLUMNS,
) -> None:
    """Watch a running robot: temperatures, time to each limit, faults of sensors.

    The source is - (lines of JSON or CSV on standard input), a file of such lines or a ROS 2 bag that grows,
    udp://HOST:PORT (a datagram a message; without a host this machine alone), dds://ADDRESS:DOMAIN (topics of ROS 2
    and of Unitree's robots at this machine's interface), zenoh://ROUTER:DOMAIN (topics of ROS 2), or with --replay a
    log of any format. Ends with the source, or at Ctrl-C, and saves its state.

    Example: lptn watch fitted.toml udp://:9870 --limit 60 --to terminal prometheus

    Args:
        to: Where results go: terminal (default), page (in the browser of this machine), page://:PORT, json, json:FILE,
            mcap:FILE, rerun, rerun:FILE, prometheus, foxglove, the last two also with ://HOST:PORT, dds (ROS 2
            topics), dds://ADDRESS:DOMAIN; may be repeated.
        limit: Limit in degC for all joints, or NODE=degC, also for a pattern of nodes; may be repeated.
        replay: Replay the log at so many times its speed; 0: as fast as possible.
        state: File to save the state in each minute, and to go on from.
        learn: Model file to write at the end: parameters follow the last two hours, held by the fit's standard errors.
        every: Least time between forecasts [s]; live, they take 5 % of a core at most.
        calibration: Calibration file of lptn monitor, learnt from healthy logs.
    """
    files = [Path(text.partition(":")[2]) for text in to or () if text.startswith(("json:", "mcap:", "rerun:"))]
    options.check_outputs(json, state, learn, *files, inputs=(model, Path(source), *filter(None, [calibration])))
    limits = options.limits_of(limit, "")
    options.check_inputs(model)
    from lptn.identify.data import load_model
    from lptn.live.addresses import sink_of, source_of
    from lptn.live.watch import Watch
    from lptn.online.calibration import read_calibration

    loaded = load_model(model, columns.texts)
    known = None if calibration is None else read_calibration(calibration, loaded.model)
    said = source_of(source, loaded, replay)
    names = to or (["terminal"] if not is_quiet() else [])
    sinks = [sink_of(name, Terminal, _page, sys.stdout) for name in names]
    watching = Watch(loaded, said, sinks, limits=limits, coverage=coverage, calibration=known, every=every, state=state,
                     learn=learn)  # fmt: skip
    last = watching.run()
    show_written({"the model as the last hours have it": learn})
    write_json(json, last.as_json())


def _page(port: int) -> Sink:
    from lptn.cli.open import show_in_browser
    from lptn.workbench.live import LivePage

    def ready(address: str, page: Path) -> None:
        print(f"The robot's page: {address}", file=sys.stderr, flush=True)
        show_in_browser(page)

    return LivePage(port, ready)


# --- The table ------------------------------------------------------------------------------------------

_REDRAWN = 0.25  # s; faster than a person reads
_LINE = 10.0  # s between two lines where nobody watches
_EVENTS = 5  # that stand below the table


class Terminal:
    """A table that is redrawn, or plain lines where there is no terminal."""

    def __init__(self) -> None:
        self._live: Live | None = None
        self._drawn = -_LINE
        self._events = list[str]()
        if out.is_terminal:
            from rich.live import Live

            self._live = Live(console=out, auto_refresh=False)
            self._live.start()

    def show(self, status: Status) -> None:
        """Draw it, unless that was done just now."""
        self._events = [*self._events, *status.events][-_EVENTS:]
        self._newest = status
        now = time.monotonic()
        if self._live is None:
            for event in status.events:
                print(f"{_clock(status.time)} {event}", flush=True)
            if now - self._drawn >= _LINE:
                self._drawn, self._printed = now, status
                print(_line(status), flush=True)
        elif now - self._drawn >= _REDRAWN or status.events:
            self._drawn = now
            self._live.update(_table(status, self._events), refresh=True)

    def close(self) -> None:
        """Leave the newest standing."""
        if self._live is not None:
            if self._drawn > 0:
                self._live.update(_table(self._newest, self._events), refresh=True)
            self._live.stop()
        elif self._drawn > 0 and self._newest is not self._printed:
            print(_line(self._newest), flush=True)


def _table(status: Status, events: list[str]) -> Table:
    from rich.table import Table

    counts = status.counts or {}
    told = ", ".join(f"{count:,} {word}" for word, count in counts.items() if count)
    table = Table(box=None, header_style="bold", pad_edge=False, title=f"{_clock(status.time)}  {told}",
                  title_justify="left", caption="\n".join(events), caption_justify="left")  # fmt: skip
    for head in ("node", "now [degC]", "limit", "limit in", "torque", "sensor"):
        table.add_column(head, justify="left" if head in ("node", "sensor") else "right")
    alarms = {alarm.channel or alarm.node: alarm for alarm in status.alarms}
    for one in status.nodes:
        scale = one.torque_scale
        style = "red" if scale is not None and scale < 0.5 else "yellow" if scale is not None and scale < 1 else ""
        sensor = alarms[one.node].words if one.node in alarms else one.trust
        table.add_row(
            one.node, _temperature(one), "–" if one.limit is None else f"{one.limit:g}", _left(one),
            "–" if scale is None else f"{scale:.0%}", sensor, style=style,
        )  # fmt: skip
    return table


def _line(status: Status) -> str:
    """One line of what matters most: the next limit, or the hottest node, and what is wrong."""
    limited = [node for node in status.nodes if node.limit is not None] or list(status.nodes)
    one = status.soonest or max(limited, key=lambda node: node.temperature if isfinite(node.temperature) else 0.0)
    limit = ""
    if one.limit is not None and one.time_to_limit is not None:
        limit = f", {one.limit:g} degC " + (f"in {_left(one)}" if isfinite(one.time_to_limit) else "never reached")
    wrong = "; ".join(f"{alarm.channel or alarm.node} {alarm.words}" for alarm in status.alarms)
    return f"{_clock(status.time)} {one.node} {_temperature(one)} degC{limit}{f'; {wrong}' if wrong else ''}"


def _temperature(one: NodeStatus) -> str:
    around = (one.high - one.low) / 2
    return f"{one.temperature:.1f} ± {around:.1f}" if isfinite(around) else f"{one.temperature:.1f}"


def _left(one: NodeStatus) -> str:
    """The time to a limit with its interval."""
    from lptn.report.text import time_span

    if one.time_to_limit is None or one.earliest is None or one.latest is None:
        return "–"
    ends = [time_span(x) if isfinite(x) else "never" for x in (one.time_to_limit, one.earliest, one.latest)]
    return ends[0] if ends[1] == ends[2] == ends[0] else f"{ends[0]} ({ends[1]} to {ends[2]})"


_SINCE_1970 = 3e8  # s; a clock that says more counts from there


def _clock(seconds: float) -> str:
    return time.strftime("%H:%M:%S", time.localtime(seconds)) if seconds > _SINCE_1970 else f"{seconds:.0f} s"
