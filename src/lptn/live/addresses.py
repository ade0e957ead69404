"""Sources and sinks by the words of a command line."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TextIO
from urllib.parse import urlsplit

from lptn.basics.errors import InputError
from lptn.identify.data import LoadedModel
from lptn.live.dds import Dds, DdsSink
from lptn.live.recordings import ENDINGS, GrowingBag
from lptn.live.sinks import PORT_OF_FOXGLOVE, PORT_OF_METRICS, Foxglove, JsonLines, Mcap, Prometheus, Rerun
from lptn.live.sources import LOOPBACK, GrowingFile, Lines, Replay, Source, Udp
from lptn.live.watch import Sink
from lptn.live.zenoh import Zenoh
from lptn.logs.reading import ENDINGS as LOGS

_WHOLE = tuple({*LOGS} - {*ENDINGS, ".csv", ".tsv", ".txt"})  # endings of logs that no lines are added to


def source_of(text: str, loaded: LoadedModel, replay: float | None = None) -> Source:
    """The source that a text names: `-`, `udp://…`, `dds://…`, `zenoh://…`, a file or bag that grows, a log to replay.

    Raises:
        InputError: there is no such source.
    """
    if replay is not None:
        return Replay(Path(text), replay, loaded)
    if text == "-":
        return Lines()
    if text.endswith(ENDINGS) or Path(text).is_dir():
        return GrowingBag(Path(text))
    if text.endswith(_WHOLE):
        raise InputError(
            text, "source", "a log that is read when it is whole", "--replay SPEED behind it, 1 as it went"
        )
    scheme, host, port = address_of(text, "source")
    if scheme == "udp":
        return Udp(host, port)
    if scheme in ("dds", "zenoh"):
        return (Dds if scheme == "dds" else Zenoh)(urlsplit(text).hostname or "", port)
    if scheme:
        expected = "-, a file, a ROS 2 bag, udp://HOST:PORT, dds://:DOMAIN or zenoh://:DOMAIN"
        raise InputError(text, "source", f"the scheme {scheme}", expected)
    return GrowingFile(Path(text))


def address_of(text: str, place: str, port: int | None = None) -> tuple[str, str, int]:
    """Scheme, host and port of `udp://127.0.0.1:9870`; the host is loopback unless it is given. No scheme: ''.

    Raises:
        InputError: the port is missing or none.
    """
    if "://" not in text:
        return "", "", 0
    scheme = text.partition("://")[0]
    try:
        parts = urlsplit(text)
        found = parts.port if parts.port is not None else port
    except ValueError:  # of a bracket that does not close, too
        found = None
    if found is None:
        raise InputError(text, place, "no port", f"{scheme}://HOST:PORT, such as {scheme}://{LOOPBACK}:9870")
    return parts.scheme, parts.hostname or LOOPBACK, found


def sink_of(text: str, terminal: Callable[[], Sink], page: Callable[[int], Sink], stream: TextIO) -> Sink:
    """The sink that a text names: `terminal`, `page`, `page://:PORT`, `json`, `json:FILE`, `mcap:FILE`, `rerun`,
    `rerun:FILE`, `prometheus://HOST:PORT`, `foxglove://HOST:PORT`, `dds://ADDRESS:DOMAIN`.

    Args:
        text: what was given.
        terminal: makes the table.
        page: serves the page at a port of loopback, 0 for any.
        stream: where lines of JSON without a file go.

    Raises:
        InputError: there is no such sink, or it can't be opened.
    """
    kind, _, rest = text.partition(":")
    if text == "terminal":
        return terminal()
    if kind == "page":
        _, host, port = address_of(text if rest else f"page://{LOOPBACK}", "sink", 0)
        if host != LOOPBACK:
            raise InputError(text, "sink", f"the host {host}", f"page://:PORT, for it is served on {LOOPBACK} alone")
        return page(port)
    if kind == "json":
        return JsonLines(Path(rest) if rest else stream)
    if kind == "mcap" and rest:
        return Mcap(Path(rest))
    if kind == "rerun":
        return Rerun(Path(rest) if rest else None)
    if kind == "dds":
        domain = address_of(text if rest else "dds://:0", "sink", 0)[2]
        return DdsSink(urlsplit(text).hostname or "", domain)
    for name, port, served in (("prometheus", PORT_OF_METRICS, Prometheus), ("foxglove", PORT_OF_FOXGLOVE, Foxglove)):
        if kind == name:
            return served(*address_of(text if rest else f"{kind}://{LOOPBACK}", "sink", port)[1:])
    expected = (
        "terminal, page, json, json:FILE, mcap:FILE, rerun, rerun:FILE, prometheus, foxglove, dds, these two also with "
        "://HOST:PORT, page with ://:PORT, dds with ://ADDRESS:DOMAIN"
    )
    raise InputError(text, "sink", "no such sink", expected)
