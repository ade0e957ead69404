"""Where a status goes: lines of JSON, Prometheus' text at `/metrics`, Foxglove, MCAP, Rerun."""

from __future__ import annotations

import json
import math
import socket
from collections.abc import Callable
from dataclasses import asdict
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from threading import Thread
from typing import Any, TextIO

from lptn.live.sources import FREE_PORT, LOOPBACK, one_line_if_refused
from lptn.live.status import NodeStatus, Status

_WRITABLE = "a file that can be written"


class JsonLines:
    """A line of JSON for each status, to a stream or added to a file.

    Raises:
        InputError: the file can't be written.
    """

    def __init__(self, to: TextIO | Path) -> None:
        self._owned = isinstance(to, Path)
        with one_line_if_refused(str(to), "sink", _WRITABLE):
            self._stream = to.open("a", encoding="utf-8") if isinstance(to, Path) else to

    def show(self, status: Status) -> None:
        self._stream.write(json.dumps(status.as_json(), separators=(",", ":")) + "\n")
        self._stream.flush()

    def close(self) -> None:
        if self._owned:
            self._stream.close()


# --- Prometheus -------------------------------------------------------------------------------------

PORT_OF_METRICS = 9464
"""The port that OpenTelemetry's exporters of such text have by default."""
_TEXT = "text/plain; version=0.0.4; charset=utf-8"
_BY_NODE: dict[str, tuple[str, Callable[[NodeStatus], float | None]]] = {
    "lptn_temperature_celsius": ("estimated temperature", lambda one: one.temperature),
    "lptn_temperature_low_celsius": ("cold end of its interval", lambda one: one.low),
    "lptn_temperature_high_celsius": ("hot end of its interval", lambda one: one.high),
    "lptn_reading_celsius": ("newest reading of its sensor", lambda one: one.reading),
    "lptn_limit_celsius": ("limit", lambda one: one.limit),
    "lptn_limit_seconds": ("time to the limit, +Inf for never", lambda one: one.time_to_limit),
    "lptn_limit_earliest_seconds": ("early end of its interval", lambda one: one.earliest),
    "lptn_limit_latest_seconds": ("late end of its interval", lambda one: one.latest),
    "lptn_torque_scale_ratio": ("factor on the torque that is wanted", lambda one: one.torque_scale),
    "lptn_sensor_trusted": ("1 while its sensor is trusted, else 0", lambda one: float(one.trust == "trusted")),
}


def metrics(status: Status) -> str:
    """A status as Prometheus reads it: one gauge for each node and quantity that is known, counters of messages."""
    lines = list[str]()
    for name, (words, value) in _BY_NODE.items():
        lines += [f"# HELP {name} {words}", f"# TYPE {name} gauge"]
        for one in status.nodes:
            x = value(one)
            if x is not None and not math.isnan(x):
                lines.append(f'{name}{{node="{_escaped(one.node)}"}} {_number(x)}')
    lines += ["# HELP lptn_alarm a fault of a sensor or an input, found by lptn monitor", "# TYPE lptn_alarm gauge"]
    for alarm in status.alarms:
        channel = alarm.channel or f"temperature.{alarm.node}"
        lines.append(f'lptn_alarm{{channel="{_escaped(channel)}",kind="{alarm.kind}"}} 1')
    own = {"lptn_assessment_age_seconds": status.assessed, "lptn_missing_inputs": float(len(status.missing))}
    for name, x in own.items():
        lines += [f"# TYPE {name} gauge", f"{name} {_number(x)}"]
    for word, count in (status.counts or {}).items():
        lines += [f"# TYPE lptn_{word}_total counter", f"lptn_{word}_total {count}"]
    return "\n".join(lines) + "\n"


def _escaped(label: str) -> str:
    return label.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n")


def _number(x: float) -> str:
    return f"{x:.10g}" if math.isfinite(x) else "+Inf" if x > 0 else "-Inf"


class Prometheus:
    """Serves the newest status at `http://HOST:PORT/metrics`, on this machine alone unless a host is given.

    Raises:
        InputError: the address can't be had.
    """

    def __init__(self, host: str = LOOPBACK, port: int = PORT_OF_METRICS) -> None:
        newest = [b"# nothing is known yet\n"]

        class Handler(BaseHTTPRequestHandler):
            timeout = 10.0  # s for a request to come whole

            def do_GET(self) -> None:
                known = self.path.partition("?")[0] == "/metrics"
                body = newest[0] if known else b"see /metrics\n"
                self.send_response(200 if known else 404)
                self.send_header("Content-Type", _TEXT)
                self.send_header("Content-Length", str(len(body)))
                self.end_headers()
                self.wfile.write(body)

            def log_message(self, *_: object) -> None:
                pass

        self._newest = newest
        with one_line_if_refused(f"prometheus://{host}:{port}", "sink", FREE_PORT):
            self._server = ThreadingHTTPServer((host, port), Handler)
        self.port = self._server.server_port
        Thread(target=self._server.serve_forever, daemon=True).start()

    def show(self, status: Status) -> None:
        self._newest[0] = metrics(status).encode()

    def close(self) -> None:
        self._server.shutdown()
        self._server.server_close()


# --- Foxglove ---------------------------------------------------------------------------------------

PORT_OF_FOXGLOVE = 8765
"""The port at which Foxglove looks."""


class _Channels:
    """A topic `/lptn/NODE` with the numbers of each node, to plot; `/lptn/status` with the rest.

    Raises:
        InputError: the package is not installed.
    """

    def __init__(self, place: str) -> None:
        with one_line_if_refused(place, "sink", "", "foxglove"):
            import foxglove
        self._package, self._context, self._channels = foxglove, foxglove.Context(), dict[str, Any]()

    def show(self, status: Status) -> None:
        content = status.as_json()
        nodes = content.pop("nodes")
        assert isinstance(nodes, dict)
        for topic, said in {**nodes, "status": content}.items():
            if topic not in self._channels:
                self._channels[topic] = self._package.Channel(
                    f"/lptn/{topic}", schema={"type": "object"}, message_encoding="json", context=self._context
                )
            self._channels[topic].log(said, log_time=round(max(status.time, 0.0) * 1e9))


class Foxglove(_Channels):
    """Serves each status to Foxglove, on this machine alone unless a host is given.

    Raises:
        InputError: the package is not installed, or the address can't be had.
    """

    def __init__(self, host: str = LOOPBACK, port: int = PORT_OF_FOXGLOVE) -> None:
        place = f"foxglove://{host}:{port}"
        super().__init__(place)
        with one_line_if_refused(place, "sink", FREE_PORT):
            self._server = self._package.start_server(name="lptn watch", host=host, port=port, context=self._context)
        self.port = self._server.port

    def close(self) -> None:
        self._server.stop()


class Mcap(_Channels):
    """Records each status in an MCAP file, by its own time.

    Raises:
        InputError: the package is not installed, or the file is there already or can't be written.
    """

    def __init__(self, path: Path) -> None:
        super().__init__(f"mcap:{path}")
        with one_line_if_refused(str(path), "sink", "a file that is not there yet, and can be written"):
            self._writer = self._package.open_mcap(path, context=self._context)

    def close(self) -> None:
        self._writer.close()


# --- Rerun ------------------------------------------------------------------------------------------


PORT_OF_RERUN = 9876
"""The port at which a Rerun viewer listens."""
_PATIENCE = 5.0  # s; on one machine it answers in milliseconds


class Rerun:
    """Shows each status in a Rerun viewer on this machine, or keeps it in a file: a line for each number of a node.

    Raises:
        InputError: the package is not installed, or the file can't be written.
    """

    def __init__(self, path: Path | None = None) -> None:
        expected = _WRITABLE if path else "a Rerun viewer on this machine: start rerun"
        with one_line_if_refused(str(path or "rerun"), "sink", expected, "rerun"):
            import rerun

            self._package, self._stream = rerun, rerun.RecordingStream("lptn watch")
            if path:
                self._stream.save(path)
            else:  # a viewer that is not there is waited for without end
                socket.create_connection((LOOPBACK, PORT_OF_RERUN), timeout=_PATIENCE).close()
                self._stream.connect_grpc()

    def show(self, status: Status) -> None:
        self._stream.set_time("time", timestamp=status.time)
        for one in status.nodes:
            numbers = {**asdict(one), "torque_scale": one.torque_scale}
            for name, value in numbers.items():
                if isinstance(value, float) and math.isfinite(value):
                    self._stream.log(f"{one.node}/{name}", self._package.Scalars(value))
        for event in status.events:
            self._stream.log("events", self._package.TextLog(event))

    def close(self) -> None:
        self._stream.flush(timeout_sec=_PATIENCE)
        self._stream.disconnect()
