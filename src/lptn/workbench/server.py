"""The page's server, on this machine alone: files of the page, the study's state, lines of plots, orders.

Tabs ask for the state by its version, twice a second while something is being done: a stream for each tab would use up
the six connections that a browser grants a host, and the seventh tab would hang.
"""

from __future__ import annotations

import asyncio
import json
import mimetypes
import secrets
import socket
import tempfile
import threading
from collections.abc import Awaitable, Callable, Mapping, Sequence
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any, TypeVar, get_origin

import uvicorn
from pydantic import BaseModel, ValidationError
from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.middleware import Middleware
from starlette.requests import ClientDisconnect, Request
from starlette.responses import FileResponse, JSONResponse, PlainTextResponse, Response
from starlette.routing import BaseRoute, Mount, Route
from starlette.staticfiles import StaticFiles
from uvicorn.protocols.http.h11_impl import H11Protocol

from lptn.basics.bounds import Bound
from lptn.basics.errors import InputError
from lptn.basics.files import fingerprint, finite, whole_file, write_whole
from lptn.workbench.desk import bound_of, delete_unfinished, place_for
from lptn.workbench.gate import MOVES_ON, Gate
from lptn.workbench.lines import packed
from lptn.workbench.orders import LinesAsked, NetworkAsked, ResidualsAsked, SpecialAsked, StateAsked, order
from lptn.workbench.residuals import Residuals
from lptn.workbench.session import BusyError, WorkbenchSession
from lptn.workbench.special import Special

_LARGEST_ORDER = Bound(10_000, "bytes")  # an order is a sentence
_PATIENCE = 20.0  # s in which a request has come whole; on one machine that takes milliseconds
_PAGE: list[str | tuple[str, str]] = [
    ("lptn.workbench", "page"),
    ("lptn.report", "page"),
]  # what reports are drawn with, too, is theirs
mimetypes.add_type("text/javascript", ".js")  # whatever the machine says, a browser runs nothing else as a module
_BYTES = "application/octet-stream"
_RESULTS = {"story.html": "text/html", "model.fmu": _BYTES}


def application(session: WorkbenchSession, port: int, *tokens: str) -> Starlette:
    """The server's application.

    Args:
        session: what tabs look at.
        port: of the server.
        tokens: secrets in addresses, each of which lets in once.
    """
    site = _Site(session)
    routes: list[BaseRoute] = [
        Route("/state", site.state),
        Route(
            "/lines", _answering(LinesAsked, session.lines, lambda lines: Response(packed(lines), media_type=_BYTES))
        ),
        Route("/special", _answering(SpecialAsked, session.special, _as_json)),
        Route("/residuals", _answering(ResidualsAsked, session.residuals, _as_json)),
        Route("/network", _answering(NetworkAsked, session.network, JSONResponse)),
        Route("/order", site.order, methods=["POST"]),
        Route("/file", site.file, methods=["POST"]),
        Route("/stop", site.stop, methods=["POST"]),
        Route("/result/{name}", site.result),
        Route("/model", site.model),
    ]
    return application_of(routes, port, *tokens)


def application_of(routes: Sequence[BaseRoute], port: int, *tokens: str) -> Starlette:
    """An application of some routes and the page's files, behind the gate; arguments as of `application`."""
    icon = Route("/favicon.ico", lambda _: Response(status_code=204))  # browsers ask for it unasked
    site = Mount("/", StaticFiles(packages=_PAGE, html=True))
    gate = Middleware(Gate, port=port, tokens=tokens)
    return Starlette(routes=[icon, *routes, site], middleware=[gate], exception_handlers=_REFUSALS)


Asked = TypeVar("Asked", bound=BaseModel)
Found = TypeVar("Found")


class _Site:
    """What is answered from a session."""

    def __init__(self, session: WorkbenchSession) -> None:
        self._session = session

    async def state(self, request: Request) -> Response:
        content = self._session.state(StateAsked.model_validate(dict(request.query_params)).since)
        return Response(status_code=204) if content is None else JSONResponse(content)

    async def order(self, request: Request) -> Response:
        try:
            async with asyncio.timeout(_PATIENCE):
                text = await _short_text(request)
        except TimeoutError:
            return _wrong("an order that does not end", 408)
        return JSONResponse({"version": self._session.do(order.validate_json(text))}, 202)

    async def file(self, request: Request) -> Response:
        name, based = request.query_params.get("name", ""), request.query_params.get("based")
        try:
            path = await run_in_threadpool(self._session.place_for, name, based)
            folder = path.parents[name.count("/")]
            try:
                await _received(request, path, lambda: place_for(folder, name, based))
            except BaseException:  # it was cancelled as well: nothing is left of it
                delete_unfinished(folder, path)
                raise
            await run_in_threadpool(self._session.arrived, path)
        except BusyError as error:
            return _wrong(str(error), 409)
        except OSError as error:
            return _wrong(f"{name}: {error.strerror or error}", 507)
        return JSONResponse({"based": fingerprint(path)} if path.suffix == ".toml" else {}, 202)

    async def stop(self, _: Request) -> Response:
        await run_in_threadpool(self._session.stop)
        return JSONResponse({}, 202)

    async def result(self, request: Request) -> Response:
        name = request.path_params["name"]
        path = (self._session.folder or Path()) / name
        if name not in _RESULTS or not path.is_file():
            return PlainTextResponse("not made yet", 404)
        return FileResponse(path, media_type=_RESULTS[name], filename=name)

    async def model(self, _: Request) -> Response:
        headers = {"content-disposition": 'attachment; filename="better.toml"'}
        return PlainTextResponse(self._session.model_file, headers=headers)


def _as_json(result: Special | Residuals) -> Response:
    return JSONResponse(finite(asdict(result)))


def _answering(
    kind: type[Asked], answer: Callable[[Asked], Found], respond: Callable[[Found], Response]
) -> Callable[[Request], Awaitable[Response]]:
    """Answers a question whose parts stand in the address."""
    lists = {name for name, field in kind.model_fields.items() if get_origin(field.annotation) is list}

    async def answered(request: Request) -> Response:
        words = request.query_params
        asked = kind.model_validate({name: words.getlist(name) if name in lists else words[name] for name in words})
        return await run_in_threadpool(lambda: respond(answer(asked)))

    return answered


async def _short_text(request: Request) -> str:
    """What an order says, refused before more of it is held than an order may have.

    Raises:
        InputError: it is too long.
        UnicodeDecodeError: it is no text.
    """
    stated, body = request.headers.get("content-length", "0"), b""
    _LARGEST_ORDER.check(int(stated) if stated.isdecimal() else 0, "order", "content-length")
    async for chunk in request.stream():
        body += chunk
        _LARGEST_ORDER.check(len(body), "order", "body")
    return body.decode()


async def _received(request: Request, path: Path, check: Callable[[], object]) -> None:
    """Write the body of a request to a file piece by piece, whole or not at all.

    Args:
        request: of the page.
        path: the file.
        check: raises where it can't have its place any more.

    Raises:
        InputError: it is too large, does not come, or has lost its place meanwhile.
        OSError: it can't be written.
    """
    stated, size, bound = request.headers.get("content-length", "0"), 0, bound_of(path)
    bound.check(int(stated) if stated.isdecimal() else 0, path.name, "file")
    body = aiter(request.stream())
    with whole_file(path) as stream:
        while True:
            try:
                async with asyncio.timeout(_PATIENCE):
                    chunk = await anext(body, b"")
            except TimeoutError:
                raise InputError(path.name, "file", "nothing more of it", f"a piece in {_PATIENCE:g} s") from None
            if not chunk:
                break
            size += len(chunk)
            bound.check(size, path.name, "file")
            await run_in_threadpool(stream.write, chunk)
        await run_in_threadpool(stream.flush)
        check()  # nothing is awaited from here until the file has its name: no other comes between


def _wrong(what: str, status: int = 422) -> Response:
    unread = {"connection": "close"} if status in (408, 409, 413, 507) else None  # of the body, which is not waited for
    return JSONResponse({"error": what}, status, unread)


_SENT_TO = "/order", "/file"  # with a body, which may be too large or lose its place
_REFUSALS: Mapping[Any, Callable[[Request, Any], Response]] = {
    InputError: lambda request, error: _wrong(str(error), 413 if request.url.path in _SENT_TO else 422),
    ValidationError: lambda _, error: _wrong(_in_words(error)),
    BusyError: lambda _, error: JSONResponse({"error": str(error)}, 409),
    UnicodeDecodeError: lambda *_: _wrong("bytes that are not UTF-8 text", 400),
    ClientDisconnect: lambda *_: _wrong("what was sent broke off", 400),  # and nobody hears it
}
"""What is answered where an order, a file or a question can't be taken."""


def _in_words(error: ValidationError) -> str:
    """What was wrong, in one line."""
    problems: list[dict[str, Any]] = json.loads(error.json(include_url=False, include_context=False))
    return "; ".join(f"{'.'.join(map(str, problem['loc'])) or 'order'}: {problem['msg']}" for problem in problems)


# --- a server from its start to its end ------------------------------------------------------------------------


def listening(port: int) -> socket.socket:
    """A socket of loopback.

    Args:
        port: its number; 0 for any that is free.

    Raises:
        InputError: the port is taken.
    """
    listener = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    try:
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listener.bind(("127.0.0.1", port))
    except OSError as error:
        listener.close()
        raise InputError("command line", "--port", f"{port}: {error.strerror}", "a port that is free") from error
    return listener


class _Server(uvicorn.Server):
    """Says that it answers once it does, and once a signal ends it in peace: before, one may interrupt an import, whose
    lock is then held for ever."""

    def __init__(self, config: uvicorn.Config, ready: Callable[[], None]) -> None:
        super().__init__(config)
        self._ready = ready

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        await super().startup(sockets)
        threading.Thread(target=self._ready).start()  # a browser may take its time


class _Patient(H11Protocol):
    """Closes a connection on which no request has come whole in time; uvicorn waits for a header for ever."""

    _late: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        super().connection_made(transport)
        self._watch()

    def data_received(self, data: bytes) -> None:
        super().data_received(data)
        self._watch()

    def _watch(self) -> None:
        waits = self.cycle is None or self.cycle.response_complete
        if waits and self._late is None:
            self._late = self.loop.call_later(_PATIENCE, self.transport.close)
        elif not waits and self._late is not None:
            self._late.cancel()
            self._late = None


def serve(session: WorkbenchSession, port: int = 0, ready: Callable[[str, Path], None] = lambda *_: None) -> None:
    """Serve a session's page until Ctrl-C.

    Args:
        session: an open session.
        port: of the server; by default any that is free.
        ready: as of `serve_site`.

    Raises:
        InputError: the port is taken.
    """
    listener = listening(port)
    try:
        serve_site(partial(application, session), listener, ready)
    finally:
        session.close()


def serve_site(
    application: Callable[..., Starlette],
    listener: socket.socket,
    ready: Callable[[str, Path], None],
    begins: Callable[[uvicorn.Server], None] = lambda _: None,
) -> None:
    """Serve an application until its server ends, or Ctrl-C.

    Args:
        application: makes it of its port and tokens.
        listener: a socket of loopback, which is closed at the end.
        ready: called once it answers with the address, whose token lets in once, and with a file that leads there by
            a token of its own: a browser's command line, which everybody can read, has the file's name alone.
        begins: called with the server before it runs.
    """
    shown, in_file = secrets.token_urlsafe(32), secrets.token_urlsafe(32)
    with listener, tempfile.TemporaryDirectory(prefix="lptn-open-") as private:
        number = listener.getsockname()[1]
        config = uvicorn.Config(
            application(number, shown, in_file),
            http=_Patient,
            log_level="error",
            lifespan="off",
            server_header=False,
            date_header=False,
            timeout_graceful_shutdown=1,
        )
        address, page = f"http://127.0.0.1:{number}/?token=", Path(private) / "workbench.html"
        page.touch(mode=0o600)  # in a folder that is this user's alone
        write_whole(page, MOVES_ON.format(address + in_file))
        server = _Server(config, partial(ready, address + shown, page))
        begins(server)
        server.run(sockets=[listener])
