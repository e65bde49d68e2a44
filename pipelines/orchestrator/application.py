"""Prefect's server application with additional checks: host name, origin of the page, sizes, and stored parameters.

Prefect checks the key. It has no setting for trusted host names (DNS rebinding passes), its CORS only hides answers from pages
of other origins, and its WebSockets check neither.
"""

import base64
import secrets
from collections.abc import Sequence

from prefect.server.api.server import create_app
from starlette.datastructures import Headers
from starlette.middleware.trustedhost import TrustedHostMiddleware
from starlette.responses import JSONResponse, PlainTextResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from pipelines.orchestrator.archive_address import REFUSED, credentials_in

STORED = ("/api/flow_runs/", "/api/deployments/")  # addresses that receive parameters of flows
LARGEST, LARGEST_LOGS = 1_000_000, 6_000_000
"""Bytes of a body; clients send their logs in batches of 4 MB at most and one message of 1 MB more."""
LOGS = "/api/logs/"


def application(names: Sequence[str], origins: Sequence[str], key: str) -> ASGIApp:
    """The application of the server for these host names and page origins, with its key ``user:password``."""
    inner = OwnOrigins(SmallBodies(create_app(), key), origins)
    return ClosedWebSockets(TrustedHostMiddleware(inner, allowed_hosts=[*names], www_redirect=False))


class ClosedWebSockets:
    """Refuses WebSockets by closing them (403) for every refusal, because uvicorn logs other answers as errors."""

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass the connection on."""

        async def closing(message: Message) -> None:
            if message["type"] == "websocket.http.response.start":
                await send({"type": "websocket.close", "code": 1008})
            elif message["type"] != "websocket.http.response.body":
                await send(message)

        await self.app(scope, receive, closing if scope["type"] == "websocket" else send)


class OwnOrigins:
    """Refuses requests and WebSockets of pages from other origins with 403; programs send no origin and pass."""

    def __init__(self, app: ASGIApp, origins: Sequence[str]) -> None:
        self.app, self.origins = app, frozenset(origins)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass the request on, or refuse it."""
        if scope["type"] in {"http", "websocket"}:
            origin = Headers(scope=scope).get("origin")
            if origin is not None and origin not in self.origins:
                await PlainTextResponse("Origin not allowed", 403)(scope, receive, send)
                return
        await self.app(scope, receive, send)


class SmallBodies:
    """Reads the body of a request that has the key, up to its limit (413), and passes it on whole.

    Without the key no body is read: Prefect refuses such a request itself, and gets an empty one. Parameters of flows with
    credentials are refused (422) before they are stored, because the database is not encrypted.
    """

    def __init__(self, app: ASGIApp, key: str) -> None:
        self.app, self.key = app, key

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass the request on, or refuse it."""
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        headers = Headers(scope=scope)
        body = b""
        if self._has_key(headers):
            largest = LARGEST_LOGS if scope["path"] == LOGS else LARGEST
            read = await _body(receive, headers, largest)
            if read is None:
                text = f"the body has more than {largest} bytes, at most so many are accepted; send less at once"
                await JSONResponse({"exception_message": text, "detail": text}, 413)(scope, receive, send)
                return
            body = read
            if scope["path"].startswith(STORED) and credentials_in(body.decode("utf-8", errors="replace")):
                answer = {"exception_message": REFUSED, "detail": REFUSED}
                await JSONResponse(answer, 422)(scope, receive, send)
                return
        given = False

        async def once() -> Message:
            nonlocal given
            if given:
                return await _end(receive)
            given = True
            return {"type": "http.request", "body": body, "more_body": False}

        await self.app(scope, once, send)

    def _has_key(self, headers: Headers) -> bool:
        kind, _, coded = headers.get("authorization", "").partition(" ")
        try:
            given = base64.b64decode(coded)
        except ValueError:
            return False
        return kind == "Basic" and secrets.compare_digest(given, self.key.encode())


async def _body(receive: Receive, headers: Headers, largest: int) -> bytes | None:
    """The body of a request; None if it is larger, or said to be."""
    said = headers.get("content-length", "0")
    if len(said) > len(str(largest)) or int(said) > largest:
        return None
    body = bytearray()
    while True:
        message = await receive()
        body += message.get("body", b"")
        if len(body) > largest:
            return None
        if message["type"] == "http.disconnect" or not message.get("more_body"):
            return bytes(body)


async def _end(receive: Receive) -> Message:
    """The end of the connection; parts of a body that was not asked for are left out."""
    while True:
        message = await receive()
        if message["type"] == "http.disconnect":
            return message
