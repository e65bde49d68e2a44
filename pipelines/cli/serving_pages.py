"""Commands that serve pages: Ctrl-C ends without a traceback."""

from __future__ import annotations

import asyncio
import logging
import socket
from contextlib import suppress
from typing import TYPE_CHECKING

from pipelines.cli.printing import remark

if TYPE_CHECKING:
    import uvicorn


def run_until_stopped(server: uvicorn.Server, place: socket.socket, command: str) -> None:
    """Serve until Ctrl-C, which is how these commands end, then say so in one line."""
    logging.getLogger("uvicorn.error").addFilter(_not_cancelled)
    try:
        with suppress(KeyboardInterrupt):  # the server has ended by it, and mostly raises it again
            server.run(sockets=[place])
        remark(f"{command}: ended")
    finally:
        logging.getLogger("uvicorn.error").removeFilter(_not_cancelled)


def _not_cancelled(record: logging.LogRecord) -> bool:
    """Whether a message is not about an answer that the end of the server cut off."""
    kind = record.exc_info[0] if record.exc_info else None
    return kind is None or not issubclass(kind, asyncio.CancelledError)
