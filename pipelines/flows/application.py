"""Prefect's server application with additional checks: host name, origin of the page, and stored parameters.

Prefect checks the key. It has no setting for trusted host names (DNS rebinding passes), its CORS only hides answers from pages
of other origins, and its WebSockets check neither.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from prefect.server.api.server import create_app
from starlette.datastructures import Headers
from starlette.middleware.trustedhost import TrustedHostMiddleware
from starlette.responses import JSONResponse, PlainTextResponse

from pipelines.flows.credentials import REFUSED, credentials_in

if TYPE_CHECKING:
    from collections.abc import Sequence

    from starlette.types import ASGIApp, Message, Receive, Scope, Send

STORED = ("/api/flow_runs/", "/api/deployments/")
"""Addresses that receive parameters of flows."""


def application(names: Sequence[str], origins: Sequence[str]) -> ASGIApp:
    """The application of the server for these host names and page origins."""
    inner = NoCredentials(OwnOrigins(create_app(), origins))
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


class NoCredentials:
    """Refuses parameters of flows with credentials (422) before they are stored, because the database is not encrypted."""

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass the request on, or refuse it."""
        if scope["type"] != "http" or scope["method"] in {"GET", "DELETE"} or not scope["path"].startswith(STORED):
            await self.app(scope, receive, send)
            return
        messages: list[Message] = []
        body = bytearray()
        while True:
            message = await receive()
            messages.append(message)
            body += message.get("body", b"")
            if not message.get("more_body"):
                break
        if credentials_in(body.decode("utf-8", errors="replace")):
            answer = {"exception_message": REFUSED, "detail": REFUSED}
            await JSONResponse(answer, 422)(scope, receive, send)
            return

        async def again() -> Message:
            return messages.pop(0) if messages else await receive()

        await self.app(scope, again, send)
