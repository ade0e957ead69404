"""A running robot as a page: a sink of `lptn watch` that serves its table and the last two hours' lines."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import uvicorn
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import FileResponse, JSONResponse, Response
from starlette.routing import Route

from lptn.basics.files import finite
from lptn.workbench.server import application_of, listening, serve_site

if TYPE_CHECKING:
    from lptn.live.status import Status

_KEPT = 7200  # s, two hours, as long as the watch itself remembers; and rows, of a step below 1 s
_LONGEST_NUMBER = 18  # digits of a row's number, which fewer than a million years of rows reach
_EVENTS = 20  # that the page shows
_AT_ONCE = 1000  # rows of an answer: thirty nodes' make 0.5 MB


class LivePage:
    """Serves each status to browsers of this machine that know the token.

    Args:
        port: of the server; 0 for any that is free.
        ready: called with the address and with a file that leads there, as `serve` does.

    Raises:
        InputError: the port is taken.
    """

    def __init__(self, port: int = 0, ready: Callable[[str, Path], None] = lambda *_: None) -> None:
        self._rows, self._count = deque[list[Any]](maxlen=_KEPT), 0
        self._events = deque[tuple[float, str]](maxlen=_EVENTS)
        self._newest: dict[str, object] = {}
        self._lock = threading.Lock()
        servers, begun = list[uvicorn.Server](), threading.Event()

        def begins(server: uvicorn.Server) -> None:
            servers.append(server)
            begun.set()

        listener = listening(port)  # here, where it can be refused
        self._thread = threading.Thread(
            target=serve_site, args=(self.application, listener, ready, begins), daemon=True
        )
        self._thread.start()
        begun.wait()
        (self._server,) = servers

    def application(self, port: int, *tokens: str) -> Starlette:
        """The server's application, as `application_of` takes it."""

        async def page(_: Request) -> Response:
            return FileResponse(Path(__file__).with_name("page") / "live.html")

        return application_of([Route("/", page), Route("/live", self._live)], port, *tokens)

    async def _live(self, request: Request) -> Response:
        """What is new since a row: `first`, the row's number, rows of time, temperatures, readings; and the newest."""
        since = request.query_params.get("since", "0")
        with self._lock:
            oldest = self._count - len(self._rows)
            first = max(int(since) if since.isdecimal() and len(since) <= _LONGEST_NUMBER else 0, oldest)
            rows = [self._rows[k - oldest] for k in range(first, min(self._count, first + _AT_ONCE))]
            answer = {"first": first, "rows": rows, "count": self._count, "said": list(self._events), **self._newest}
        return JSONResponse(answer)

    def show(self, status: Status) -> None:
        """Keep it for who asks."""
        lines = [[getattr(one, name) for one in status.nodes] for name in ("temperature", "reading")]
        row, newest = finite({"row": [status.time, *lines]})["row"], status.as_json()
        with self._lock:
            self._rows.append(row)
            while self._rows[0][0] < status.time - _KEPT:
                self._rows.popleft()
            self._count, self._newest = self._count + 1, newest
            self._events += [(status.time, event) for event in status.events]

    def close(self) -> None:
        """End the server."""
        self._server.should_exit = True
        self._thread.join()
