"""Commands that serve pages: the port is taken before an address is printed, and Ctrl-C ends without a traceback."""

from __future__ import annotations

import asyncio
import logging
import os
import socket
from typing import TYPE_CHECKING

from pipelines.cli.options import error_console
from schemas.errors import WrongUse
from schemas.foreign import shown

if TYPE_CHECKING:
    import uvicorn


def listening_socket(host: str, port: int, command: str) -> socket.socket:
    """A socket that listens; a port that another program has, or an address of no interface, is refused."""
    try:
        return socket.create_server((host, port), family=socket.AF_INET6 if ":" in host else socket.AF_INET)
    except (OSError, UnicodeError) as problem:
        number = getattr(problem, "errno", None)
        why = os.strerror(number) if number and number > 0 else str(problem)
        raise WrongUse(
            f"{command}: port {port} of {shown(host)} cannot be used ({why}), a free port of this machine is needed; end the "
            "program that has it, or give another with --port and --host (--port 0: a free one)"
        ) from None


def run_until_stopped(server: uvicorn.Server, place: socket.socket, command: str) -> None:
    """Serve until Ctrl-C, which is how these commands end, then say so in one line."""
    logging.getLogger("uvicorn.error").addFilter(_not_cancelled)
    try:
        server.run(sockets=[place])
    except KeyboardInterrupt:  # the server has ended by it, and raises it again
        error_console().print(f"{command}: ended", markup=False)
    finally:
        logging.getLogger("uvicorn.error").removeFilter(_not_cancelled)


def _not_cancelled(record: logging.LogRecord) -> bool:
    """Whether a message is not about an answer that the end of the server cut off."""
    kind = record.exc_info[0] if record.exc_info else None
    return kind is None or not issubclass(kind, asyncio.CancelledError)
