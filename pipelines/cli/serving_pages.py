"""Commands that serve pages: Ctrl-C ends without a traceback."""

import asyncio
import logging
from contextlib import suppress
from pathlib import Path

import uvicorn
from starlette.types import ASGIApp

from pipelines.cli.printing import remark
from pipelines.serving.connections import LimitedSocket, TimedRequests

PATIENCE_S = 2  # open streams would hold up the end of a server


def page_server(
    app: ASGIApp, listener: LimitedSocket, certificate: Path | None = None, key: Path | None = None
) -> uvicorn.Server:
    """The server of an application on a socket that is open already; with HTTPS where a certificate and its key are given."""
    config = uvicorn.Config(
        TimedRequests(app, listener.connections), log_level="warning", access_log=False, server_header=False, ws="none",
        timeout_graceful_shutdown=PATIENCE_S, ssl_certfile=certificate, ssl_keyfile=key, proxy_headers=False,
    )  # fmt: skip
    return uvicorn.Server(config)


def run_until_stopped(server: uvicorn.Server, listener: LimitedSocket, command: str) -> None:
    """Serve until Ctrl-C, which is how these commands end, then say so in one line."""
    logging.getLogger("uvicorn.error").addFilter(_not_cancelled)
    try:
        with suppress(KeyboardInterrupt):  # the server has ended by it, and mostly raises it again
            server.run(sockets=[listener])
        remark(f"{command}: ended")
    finally:
        logging.getLogger("uvicorn.error").removeFilter(_not_cancelled)


def _not_cancelled(record: logging.LogRecord) -> bool:
    """Whether a message is not about an answer that the end of the server cut off."""
    kind = record.exc_info[0] if record.exc_info else None
    return kind is None or not issubclass(kind, asyncio.CancelledError)
