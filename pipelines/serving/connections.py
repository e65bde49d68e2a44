"""The sockets of servers and their connections: at most so many, in all and of one address, and none that says nothing for long.

They are counted where they are accepted, so that those within the handshake of TLS and WebSockets count too. An idle connection
has no request in progress. Where there are too many, the oldest idle connection is closed, and none shuts others out; then the
oldest long answer (a browser connects to a stream of events again by itself); a new connection is refused where there is neither.
"""

from __future__ import annotations

import asyncio
import contextlib
import math
import os
import socket
import time
from collections.abc import Generator
from dataclasses import dataclass, field
from ipaddress import ip_address
from typing import TYPE_CHECKING, Any

from schemas import host as this_machine
from schemas.errors import WrongUse
from schemas.foreign import shown

if TYPE_CHECKING:
    from starlette.types import ASGIApp, Message, Receive, Scope, Send

MOST = 512
"""Connections of a server; in the limit of files, as many again remain for files, processes and databases."""
OF_ONE_ADDRESS = 64
"""Connections of another machine: ten browsers of six connections each."""
IDLE_S = 10.0
"""Time for the handshake of TLS and for the head of a request, since the connection or its last answer."""
BODY_S, ANSWER_S = 30.0, 60.0
"""Time without a byte of a body, and without a byte of the answer taken."""
LONG_S = 30.0
"""An answer that lasts longer is one that makes room: a stream of events or a slow download."""
LOOK_S = 1.0
CROWD = 1.25
"""Share of the limit that connections may reach while ended ones are freed: many are accepted in one turn of the loop."""
CONTENT = b"server: too many connections; close some pages, or try again in a few seconds\n"
REFUSAL = (
    b"HTTP/1.1 503 Service Unavailable\r\ncontent-type: text/plain; charset=utf-8\r\nretry-after: 5\r\n"
    b"connection: close\r\ncontent-length: %d\r\n\r\n%b" % (len(CONTENT), CONTENT)
)


@dataclass(frozen=True)
class ConnectionLimits:
    """Limits of a server.

    of_one_address : for addresses other than this machine's; the server behind a proxy has one address for all
    plain : whether a refusal can be read, as there is no TLS
    """

    most: int = MOST
    of_one_address: int = OF_ONE_ADDRESS
    idle_s: float = IDLE_S
    body_s: float = BODY_S
    answer_s: float = ANSWER_S
    long_s: float = LONG_S
    plain: bool = True

    @property
    def fitting(self) -> int:
        """The connections that the limit of files permits."""
        return int(min(self.most, max(this_machine.most_files() // 2, 1)))


@dataclass(eq=False)
class Connection:
    """A connection: its requests in progress, since when it has been idle or busy, and when it was ended (monotonic, s).

    unsent : bytes of answers that the client has not taken, at the last look · moved : when they changed last
    """

    socket: socket.socket
    address: str
    since: float
    requests: int = 0
    unsent: int = 0
    moved: float = 0.0
    shut_at: float = 0.0

    def begin(self, *, lasting: bool) -> None:
        """A request begins; a lasting one, of a WebSocket, never makes room for others."""
        self.requests += 1
        self.since = math.inf if lasting else time.monotonic()

    def end(self) -> None:
        """A request has its answer."""
        self.requests -= 1
        self.since = time.monotonic()

    def look(self, now: float, limits: ConnectionLimits) -> None:
        """End it if it has been idle for too long, or takes nothing of an answer that is left to the system to send."""
        unsent = this_machine.unsent_bytes(self.socket)
        if unsent != self.unsent:
            self.unsent, self.moved = unsent, now
        patience = limits.answer_s if unsent else limits.idle_s
        if not self.requests and max(self.since, self.moved) < now - patience:
            self.close()

    def close(self) -> None:
        """End it; the loop of events sees its end and frees it."""
        self.shut_at = time.monotonic()
        with contextlib.suppress(OSError):
            self.socket.shutdown(socket.SHUT_RDWR)


@dataclass
class Connections:
    """The connections of a server by the address and port of the client."""

    limits: ConnectionLimits = field(default_factory=ConnectionLimits)
    open: dict[tuple[str, int], Connection] = field(default_factory=dict[tuple[str, int], Connection])
    _looking: bool = False

    @property
    def crowded(self) -> bool:
        """Whether so many ended connections wait to be freed that no other may be accepted until they are."""
        if len(self.open) < self.limits.fitting * CROWD:
            return False
        self._forget_closed()
        recently = time.monotonic() - LOOK_S
        waiting = any(connection.shut_at > recently for connection in self.open.values())
        return waiting and len(self.open) >= self.limits.fitting * CROWD

    def admit(self, accepted: socket.socket, client: tuple[Any, ...]) -> bool:
        """Whether a connection is admitted; room is made by the end of an idle one."""
        self._forget_closed()
        address, port = str(client[0]), int(client[1])
        there = [connection for connection in self.open.values() if not connection.shut_at]
        of_client = [connection for connection in there if connection.address == address]
        most = self.limits.of_one_address
        if not ip_address(address.partition("%")[0]).is_loopback and len(of_client) >= most:
            there, most = of_client, most - 1
        else:
            most = self.limits.fitting - 1
        if len(there) > most and not self._end_one(there):
            return False
        if len(self.open) >= self.limits.fitting * CROWD:
            return False
        self.open[address, port] = Connection(accepted, address, time.monotonic())
        if not self._looking:
            self._look()
        return True

    def of(self, scope: Scope) -> Connection | None:
        """The connection of a request."""
        client = scope.get("client")
        return None if client is None else self.open.get((client[0], client[1]))

    def _end_one(self, there: list[Connection]) -> bool:
        """End the oldest idle connection, else that with the oldest long answer; return whether any was ended."""
        long_before = time.monotonic() - self.limits.long_s
        idle = [connection for connection in there if not connection.requests and not connection.unsent]
        long = [
            connection
            for connection in there
            if (connection.requests or connection.unsent) and connection.since < long_before
        ]
        chosen = min(idle or long, key=lambda connection: connection.since, default=None)
        if chosen is not None:
            chosen.close()
        return chosen is not None

    def _look(self) -> None:
        """End what has been idle for too long, again and again as long as there are connections."""
        self._forget_closed()
        for connection in self.open.values():
            connection.look(time.monotonic(), self.limits)
        self._looking = bool(self.open)
        if self._looking:
            asyncio.get_running_loop().call_later(min(LOOK_S, self.limits.idle_s / 2), self._look)

    def _forget_closed(self) -> None:
        self.open = {key: connection for key, connection in self.open.items() if connection.socket.fileno() >= 0}


class TimedRequests:
    """An application whose requests are counted by connection, and end where the client neither sends nor takes anything."""

    def __init__(self, app: ASGIApp, connections: Connections) -> None:
        self.app, self.connections = app, connections

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass the request on."""
        connection = self.connections.of(scope) if scope["type"] in {"http", "websocket"} else None
        if connection is None:
            await self.app(scope, receive, send)
            return
        limits, sent = self.connections.limits, scope["type"] == "websocket"

        async def receiving() -> Message:
            nonlocal sent
            if sent:  # waits for the end of the connection, or for a message of a WebSocket
                return await receive()
            with _within(limits.body_s, connection):
                message = await receive()
            sent = not message.get("more_body", False)
            return message

        async def sending(message: Message) -> None:
            with _within(limits.answer_s, connection):
                await send(message)

        connection.begin(lasting=scope["type"] == "websocket")
        try:
            await self.app(scope, receiving, sending)
        finally:
            connection.end()


@contextlib.contextmanager
def _within(seconds: float, connection: Connection) -> Generator[None]:
    """A context that the connection does not outlast by more than so many seconds."""
    alarm = asyncio.get_running_loop().call_later(seconds, connection.close)
    try:
        yield
    finally:
        alarm.cancel()


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
    bound = LimitedSocket(socket.AF_INET6 if ":" in host else socket.AF_INET)
    bound.connections = Connections(limits)
    try:
        bound.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        if ":" in host:
            bound.setsockopt(socket.IPPROTO_IPV6, socket.IPV6_V6ONLY, 1)
        bound.bind((host, port))
    except (OSError, UnicodeError) as problem:
        bound.close()
        number = getattr(problem, "errno", None)
        why = os.strerror(number) if number and number > 0 else str(problem)
        raise WrongUse(
            f"{command}: port {port} of {shown(host)} cannot be used ({why}), a free port of this machine is needed; end the "
            "program that has it, or give another with --port and --host (--port 0: a free one)"
        ) from None
    return bound


def listening_socket(host: str, port: int, command: str, limits: ConnectionLimits | None = None) -> LimitedSocket:
    """A socket that listens: clients that come before the server is ready wait."""
    bound = bound_socket(host, port, command, limits or ConnectionLimits())
    bound.listen()
    return bound
