"""A TCP proxy between a client and a Modbus TCP server that loses, delays or changes frames as a script orders.

It works on real sockets and in wall time, frame by frame (MBAP header, Modbus Messaging on TCP/IP 1.0b, 3.1.3), so that the
client under test is the production one.
"""

import select
import socket
import struct
import threading
import time
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from typing import Literal, Self

Way = Literal["request", "reply"]
ActionKind = Literal["drop", "delay", "duplicate", "truncate", "garble", "half_open", "late", "retag", "swap", "reset"]

HEADER = 7  # MBAP: transaction, protocol, length, unit
WORDS_AT = HEADER + 2  # where the registers of a reply to function 3 or 4 begin
END_S = 5.0
LOOK_S = 0.1  # time in which one direction notices that the other has closed the connection
CHUNK = 4096


@dataclass(frozen=True)
class WireAction:
    """The treatment of a frame.

    ``drop`` loses it. ``delay`` delays it and all later frames by ``delay_s``. ``duplicate`` delivers it twice. ``truncate``
    removes its last ``size`` bytes and closes. ``garble`` changes ``size`` bytes. ``half_open``: from here on the connection
    stays open and passes nothing. ``late`` delivers it in front of the next frame of its direction, on any connection.
    ``retag`` adds ``size`` to its transaction id. ``swap`` exchanges each two registers of a reply. ``reset`` resets the
    connection in its place.
    """

    kind: ActionKind
    way: Way = "reply"
    delay_s: float = 0.0
    size: int = 1


Script = Callable[[Way, bytes], WireAction | None]


def untouched(_way: Way, _frame: bytes) -> WireAction | None:
    """A script that passes every frame."""
    return None


class ChaosProxy:
    """A proxy to a server while the context is open; clients connect to ``host`` and ``port``.

    ``once`` queues actions, each for the next frame of its direction; other frames go through ``script``.
    ``frames`` counts the frames by direction, ``applied`` lists the actions on them.
    """

    def __init__(self, host: str, port: int, script: Script = untouched) -> None:
        self._target = (host, port)
        self.script = script
        self.host, self.port = "127.0.0.1", 0
        self.frames: dict[Way, int] = {"request": 0, "reply": 0}
        self.applied: list[WireAction] = []
        self._once: deque[WireAction] = deque()
        self._late: dict[Way, deque[bytes]] = {"request": deque(), "reply": deque()}
        self._lock = threading.Lock()
        self._open: list[_Connection] = []
        self._listener = socket.create_server((self.host, 0))
        self.port = int(self._listener.getsockname()[1])
        self._thread = threading.Thread(target=self._accept, name="chaos-proxy", daemon=True)

    def once(self, *actions: WireAction) -> None:
        """Applies each of these to the next frame of its direction, in order."""
        with self._lock:
            self._once.extend(actions)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        with suppress(OSError):
            self._listener.shutdown(socket.SHUT_RDWR)
        self._listener.close()
        self._thread.join(END_S)
        for connection in self._open:
            connection.end()

    def _accept(self) -> None:
        while True:
            try:
                client, _ = self._listener.accept()
            except OSError:  # closed: the end
                return
            try:
                server = socket.create_connection(self._target, END_S)
            except OSError:
                client.close()
                continue
            self._open = [old for old in self._open if not old.over()]
            self._open.append(_Connection(self, client, server))

    def action_on(self, way: Way, frame: bytes) -> WireAction | None:
        """The action on a frame, which is recorded; None where the frame passes unchanged."""
        with self._lock:
            self.frames[way] += 1
            action = self.script(way, frame)
            for queued in self._once:
                if queued.way == way:
                    action = queued
                    self._once.remove(queued)
                    break
            if action is not None:
                self.applied.append(action)
            return action

    def held_back(self, way: Way) -> list[bytes]:
        """Late frames that are due now."""
        with self._lock:
            frames = list(self._late[way])
            self._late[way].clear()
            return frames

    def hold_back(self, way: Way, frame: bytes) -> None:
        """Keeps a frame until the next one of its direction."""
        with self._lock:
            self._late[way].append(frame)

    def garbled(self, frame: bytes, size: int) -> bytes:
        """A frame with ``size`` of its bytes changed; the frame count decides which."""
        out = bytearray(frame)
        for n in range(size):
            mix = (sum(self.frames.values()) * 40503 + n * 977) & 0xFFFFFFFF
            out[mix % len(out)] ^= 1 + (mix >> 8) % 255
        return bytes(out)


class _Connection:
    """The connection of a client: a thread for each direction."""

    def __init__(self, proxy: ChaosProxy, client: socket.socket, server: socket.socket) -> None:
        self._proxy = proxy
        self._sockets = (client, server)
        self._dead = threading.Event()  # half open: passes nothing
        self._broken = False
        self._ways: list[threading.Thread] = []
        ways: tuple[tuple[Way, socket.socket, socket.socket], ...] = (
            ("request", client, server),
            ("reply", server, client),
        )
        for way, source, sink in ways:
            thread = threading.Thread(target=self._pump, args=(way, source, sink), daemon=True)
            self._ways.append(thread)
            thread.start()

    def over(self) -> bool:
        """Whether both directions have ended; the sockets are closed then."""
        if any(thread.is_alive() for thread in self._ways):
            return False
        for connection in self._sockets:
            connection.close()
        return True

    def end(self) -> None:
        """Closes both ends and waits for the threads."""
        for connection in self._sockets:
            with suppress(OSError):
                connection.shutdown(socket.SHUT_RDWR)
        for thread in self._ways:
            thread.join(END_S)
        for connection in self._sockets:
            connection.close()

    def _pump(self, way: Way, source: socket.socket, sink: socket.socket) -> None:
        """Passes the frames of one direction until either end closes."""
        buffer = b""
        while True:
            try:
                ready, _, _ = select.select([source], [], [], LOOK_S)
                if not ready and not self._broken:
                    continue
                data = source.recv(CHUNK) if ready else b""
            except (OSError, ValueError):  # closed from the other side, or from here
                data = b""
            if not data:
                break
            buffer += data
            frames, buffer = split(buffer)
            for frame in frames:
                if not self._dead.is_set() and not self._deliver(way, frame, sink):
                    self._hang_up()
                    return
        self._hang_up()

    def _hang_up(self) -> None:
        if self._broken:
            return  # a reset is under way: an orderly end would arrive before it
        for connection in self._sockets:
            with suppress(OSError):
                connection.shutdown(socket.SHUT_RDWR)

    def _break_off(self) -> None:
        """Resets both connections; the reading side is woken first, and the peer receives nothing else."""
        self._broken = True
        self._dead.set()
        for connection in self._sockets:
            with suppress(OSError):
                connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
                connection.shutdown(socket.SHUT_RD)
            connection.close()

    def _deliver(self, way: Way, frame: bytes, sink: socket.socket) -> bool:
        """Delivers a frame, changed or not; false ends the connection."""
        action = self._proxy.action_on(way, frame)
        late = self._proxy.held_back(way)
        if action is None:
            return _send(sink, [*late, frame])
        if action.kind == "late":
            self._proxy.hold_back(way, frame)
            return _send(sink, late)
        if action.kind == "half_open":
            self._dead.set()
            return True
        if action.kind == "reset":
            self._break_off()
            return True
        if action.kind == "delay":
            time.sleep(action.delay_s)  # wall time, as on a real network
        passed = _send(sink, [*late, *replaced(frame, action, self._proxy)])
        return passed and action.kind != "truncate"


def replaced(frame: bytes, action: WireAction, proxy: ChaosProxy) -> list[bytes]:
    """The frames that are delivered instead of a frame."""
    number = (int.from_bytes(frame[:2], "big") + action.size) % 65536
    by_kind: dict[ActionKind, Callable[[], list[bytes]]] = {
        "drop": list,
        "duplicate": lambda: [frame, frame],
        "truncate": lambda: [frame[: -min(action.size, len(frame))]],
        "garble": lambda: [proxy.garbled(frame, action.size)],
        "retag": lambda: [number.to_bytes(2, "big") + frame[2:]],
        "swap": lambda: [_swapped(frame)],
    }
    return by_kind.get(action.kind, lambda: [frame])()


def _swapped(frame: bytes) -> bytes:
    """A reply to function 3 or 4 with every two registers exchanged; other frames as they are."""
    if len(frame) <= WORDS_AT or frame[HEADER] not in {3, 4}:
        return frame
    words = [frame[i : i + 2] for i in range(WORDS_AT, len(frame), 2)]
    for i in range(0, len(words) - 1, 2):
        words[i], words[i + 1] = words[i + 1], words[i]
    return frame[:WORDS_AT] + b"".join(words)


def split(buffer: bytes) -> tuple[list[bytes], bytes]:
    """Complete frames at the start of a stream, and the remaining bytes."""
    frames: list[bytes] = []
    while len(buffer) >= HEADER:
        end = 6 + int.from_bytes(buffer[4:6], "big")
        if len(buffer) < end:
            break
        frames.append(buffer[:end])
        buffer = buffer[end:]
    return frames, buffer


def _send(sink: socket.socket, frames: list[bytes]) -> bool:
    try:
        for frame in frames:
            sink.sendall(frame)
    except OSError:
        return False
    return True
