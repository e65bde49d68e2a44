"""Sockets that servers listen on, with limits of their connections."""

import contextlib
import os
import socket
from typing import Any

from pipelines.serving.connections import REFUSAL, ConnectionLimits, Connections
from schemas.errors import WrongUse
from schemas.foreign import shown


class LimitedSocket(socket.socket):
    """A socket whose connections are counted and limited as they are accepted, before any protocol."""

    connections: Connections

    def accept(self) -> tuple[socket.socket, Any]:
        """The next connection; the loop of events takes both errors as "none at present"."""
        if self.connections.crowded:
            raise BlockingIOError
        accepted, client = super().accept()
        if self.connections.admit(accepted, client):
            return accepted, client
        with contextlib.suppress(OSError), accepted:
            if self.connections.limits.plain:
                accepted.setblocking(False)
                accepted.send(REFUSAL)
                accepted.shutdown(socket.SHUT_WR)
        raise ConnectionAbortedError


def bound_socket(host: str, port: int, command: str, limits: ConnectionLimits) -> LimitedSocket:
    """A socket of a port, not listening yet; a port that another program has, or an address of no interface, is refused."""
    place = LimitedSocket(socket.AF_INET6 if ":" in host else socket.AF_INET)
    place.connections = Connections(limits)
    try:
        place.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        if ":" in host:
            place.setsockopt(socket.IPPROTO_IPV6, socket.IPV6_V6ONLY, 1)
        place.bind((host, port))
    except (OSError, UnicodeError) as problem:
        place.close()
        number = getattr(problem, "errno", None)
        why = os.strerror(number) if number and number > 0 else str(problem)
        raise WrongUse(
            f"{command}: port {port} of {shown(host)} cannot be used ({why}), a free port of this machine is needed; end the "
            "program that has it, or give another with --port and --host (--port 0: a free one)"
        ) from None
    return place


def listening_socket(host: str, port: int, command: str, limits: ConnectionLimits | None = None) -> LimitedSocket:
    """A socket that listens: clients that come before the server is ready wait."""
    place = bound_socket(host, port, command, limits or ConnectionLimits())
    place.listen()
    return place
