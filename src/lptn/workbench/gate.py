"""Access to the workbench: for this machine's browser with the token, and for no other page.

A server on loopback is open to every program and every web page on the machine. So each request needs the cookie that
the address with its token was answered with. A token works once, so that one read later from a list of processes or a
history is useless. A request's `Host` must be this server's own, against names that are bound to
127.0.0.1 by others (DNS rebinding); an `Origin` must be ours, against other pages' requests; and what a page of ours
loads comes from here alone.
"""

from __future__ import annotations

import secrets
from collections.abc import Iterable

from starlette.middleware.base import BaseHTTPMiddleware, RequestResponseEndpoint
from starlette.requests import Request
from starlette.responses import HTMLResponse, PlainTextResponse, Response
from starlette.types import ASGIApp

_POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self'; connect-src 'self'; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
MOVES_ON = '<!doctype html><meta http-equiv="refresh" content="0; url={}"><title>lptn</title>'
"""A page that leads to an address. A redirection would not do: after one that began in a file, or on another's page, a
browser does not send the cookie."""

HEADERS = {
    "content-security-policy": _POLICY,
    "x-content-type-options": "nosniff",
    "referrer-policy": "no-referrer",
    "cross-origin-opener-policy": "same-origin",
    "cross-origin-resource-policy": "same-origin",
    "cache-control": "no-store",
}
"""Of every answer."""


class Gate(BaseHTTPMiddleware):
    """Lets through what carries the token, for this server's own names.

    Args:
        app: what stands behind the gate.
        port: of the server.
        tokens: secrets in addresses, each of which lets in once.
    """

    def __init__(self, app: ASGIApp, port: int, tokens: Iterable[str]) -> None:
        super().__init__(app)
        self._tokens, self._secret = set(tokens), secrets.token_urlsafe(32)
        self._hosts = (f"127.0.0.1:{port}", f"localhost:{port}")
        self._cookie = f"lptn-{port}"  # cookies of a host are those of all its ports

    async def dispatch(self, request: Request, call_next: RequestResponseEndpoint) -> Response:
        """Answer a request here, or pass it on."""
        answer = self._answer(request) or await call_next(request)
        answer.headers.update(HEADERS)
        return answer

    def _answer(self, request: Request) -> Response | None:
        """What is answered at the gate, `None` for what may pass."""
        host, origin = request.headers.get("host", ""), request.headers.get("origin")
        if host not in self._hosts:
            return PlainTextResponse("This is not the address that was printed.", 421)
        if origin is not None and origin != f"http://{host}":
            return PlainTextResponse("Other pages may not use the workbench.", 403)
        if request.method == "POST" and origin is None:
            return PlainTextResponse("Orders come from the workbench's own page.", 403)
        known = _same(request.cookies.get(self._cookie, ""), self._secret)
        given = request.query_params.get("token")
        if given is None:
            return None if known else _refused()
        token = next((token for token in self._tokens if _same(given, token)), None)
        if token is None and not known:
            return _refused()
        self._tokens.discard(token or "")
        answer = HTMLResponse(MOVES_ON.format("/"))
        answer.set_cookie(self._cookie, self._secret, httponly=True, samesite="strict")
        return answer


def _same(given: str, secret: str) -> bool:
    return secrets.compare_digest(given.encode(), secret.encode())


def _refused() -> Response:
    said = "Open the address that was printed last. It lets in once; the same command begins anew with another."
    return PlainTextResponse(said, 401)
