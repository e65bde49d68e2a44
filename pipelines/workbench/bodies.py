"""Bodies of requests: what a page sends is small, and is refused before it is held in memory where it is not."""

from __future__ import annotations

from starlette.responses import JSONResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send

LARGEST = 1_000_000
STREAMED = "/upload/file"
"""Goes to the disk as it arrives, with a limit of its own."""
CHANGING = frozenset({"POST", "PUT", "PATCH", "DELETE"})


class SmallBodies:
    """Passes on requests whose body is of at most :data:`LARGEST` bytes."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass the request on with its whole body, or answer 413."""
        if scope["type"] != "http" or scope["method"] not in CHANGING or scope["path"] == STREAMED:
            await self._app(scope, receive, send)
            return
        body, more = bytearray(), True
        while more:
            message = await receive()
            if message["type"] != "http.request":  # the client has gone
                return
            body += message.get("body", b"")
            more = message.get("more_body", False)
            if len(body) > LARGEST:
                text = f"{scope['path'][:80]}: more than {LARGEST} bytes, at most these are taken; send less"
                await JSONResponse({"problem": text}, 413, {"connection": "close"})(scope, receive, send)
                return
        sent = False

        async def given() -> Message:
            nonlocal sent
            if sent:
                return await receive()
            sent = True
            return {"type": "http.request", "body": bytes(body), "more_body": False}

        await self._app(scope, given, send)
