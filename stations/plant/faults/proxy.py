"""A bad network: a TCP proxy between a client and a Modbus TCP server that spoils frames as it is told.

It works on real sockets and in wall time, frame by frame (MBAP header, Modbus Messaging on TCP/IP 1.0b, 3.1.3), so that the
client under test is the production one.
"""

from __future__ import annotations

import select
import socket
import struct
import threading
import time
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, Self

if TYPE_CHECKING:
    from types import TracebackType

    import numpy as np

Way = Literal["request", "reply"]
Trouble = Literal["drop", "delay", "duplicate", "truncate", "garble", "half_open", "late", "retag", "swap", "reset"]
TROUBLES: tuple[Trouble, ...] = (
    "drop", "delay", "duplicate", "truncate", "garble", "half_open", "late", "retag", "swap", "reset",
)  # fmt: skip

HEADER = 7  # MBAP: transaction, protocol, length, unit
WORDS_AT = HEADER + 2  # where the registers of a reply to function 3 or 4 begin
END_S = 5.0
LOOK_S = 0.1  # how soon a way notices that the other one has broken the connection off
CHUNK = 4096


@dataclass(frozen=True)
class Meddling:
    """What happens to one frame on its way.

    ``drop`` loses it. ``delay`` holds it, and what follows, for ``delay_s``. ``duplicate`` delivers it twice. ``truncate`` cuts
    its last ``size`` bytes off and closes. ``garble`` changes ``size`` bytes. ``half_open``: from here on this connection
    swallows everything and stays open. ``late`` holds it back and delivers it in front of the next frame of its way, on
    whatever connection that comes. ``retag`` adds ``size`` to its transaction id. ``swap`` exchanges every two registers of
    a reply. ``reset`` breaks the connection off in its stead.
    """

    trouble: Trouble
    way: Way = "reply"
    delay_s: float = 0.0
    size: int = 1


Script = Callable[[Way, bytes], Meddling | None]


def untouched(_way: Way, _frame: bytes) -> Meddling | None:
    """A script that lets everything pass."""
    return None


def at_random(rng: np.random.Generator, meddlings: list[Meddling], part: float) -> Script:
    """A script that spoils a part of the frames with one of ``meddlings`` each, by the generator."""

    def script(way: Way, _frame: bytes) -> Meddling | None:
        fitting = [meddling for meddling in meddlings if meddling.way == way]
        if not fitting or rng.random() >= part:
            return None
        return fitting[int(rng.integers(len(fitting)))]

    return script


class ChaosProxy:
    """A proxy to a server while the context is open; ``host`` and ``port`` are where clients connect.

    ``once`` queues meddlings, each spends itself on the next frame of its way; frames beyond them go through ``script``.
    ``frames`` counts what arrived by way, ``spoilt`` what was done to it.
    """

    def __init__(self, host: str, port: int, script: Script = untouched, seed: int = 0) -> None:
        self._target = (host, port)
        self.script = script
        self.host, self.port = "127.0.0.1", 0
        self.frames: dict[Way, int] = {"request": 0, "reply": 0}
        self.spoilt: list[Meddling] = []
        self._seed = seed
        self._once: deque[Meddling] = deque()
        self._late: dict[Way, deque[bytes]] = {"request": deque(), "reply": deque()}
        self._lock = threading.Lock()
        self._open: list[_Connection] = []
        self._listener = socket.create_server((self.host, 0))
        self.port = int(self._listener.getsockname()[1])
        self._thread = threading.Thread(target=self._accept, name="chaos-proxy", daemon=True)

    def once(self, *meddlings: Meddling) -> None:
        """Spoils the next frame of its way with each of these, in order."""
        with self._lock:
            self._once.extend(meddlings)

    def __enter__(self) -> Self:
        """Starts listening."""
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Closes every connection."""
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

    def spoil(self, way: Way, frame: bytes) -> Meddling | None:
        """What is to happen to a frame; noted."""
        with self._lock:
            self.frames[way] += 1
            meddling = self.script(way, frame)
            for queued in self._once:
                if queued.way == way:
                    meddling = queued
                    self._once.remove(queued)
                    break
            if meddling is not None:
                self.spoilt.append(meddling)
            return meddling

    def held_back(self, way: Way) -> list[bytes]:
        """Late frames that are due now."""
        with self._lock:
            frames = list(self._late[way])
            self._late[way].clear()
            return frames

    def hold_back(self, way: Way, frame: bytes) -> None:
        """Keeps a frame for the next one of its way."""
        with self._lock:
            self._late[way].append(frame)

    def garbled(self, frame: bytes, size: int) -> bytes:
        """A frame with ``size`` of its bytes changed; which ones follows from the seed and the count of frames."""
        out = bytearray(frame)
        for n in range(size):
            mix = (self._seed * 2654435761 + sum(self.frames.values()) * 40503 + n * 977) & 0xFFFFFFFF
            out[mix % len(out)] ^= 1 + (mix >> 8) % 255
        return bytes(out)


class _Connection:
    """One client's connection: a thread each way, and one at the end of a slow way."""

    def __init__(self, proxy: ChaosProxy, client: socket.socket, server: socket.socket) -> None:
        self._proxy = proxy
        self._sockets = (client, server)
        self._dead = threading.Event()  # half open: swallows everything
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
        """Whether both ways have ended; the sockets are closed then."""
        if any(thread.is_alive() for thread in self._ways):
            return False
        for one in self._sockets:
            one.close()
        return True

    def end(self) -> None:
        """Closes both ends and waits for the threads."""
        for one in self._sockets:
            with suppress(OSError):
                one.shutdown(socket.SHUT_RDWR)
        for thread in self._ways:
            thread.join(END_S)
        for one in self._sockets:
            one.close()

    def _pump(self, way: Way, source: socket.socket, sink: socket.socket) -> None:
        """Frames of one way until either end closes."""
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
            return  # with a reset: a polite end would come before it
        for one in self._sockets:
            with suppress(OSError):
                one.shutdown(socket.SHUT_RDWR)

    def _break_off(self) -> None:
        """Ends both connections with a reset; the reading side is woken first, without a word to the peer."""
        self._broken = True
        self._dead.set()
        for one in self._sockets:
            with suppress(OSError):
                one.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
                one.shutdown(socket.SHUT_RD)
            one.close()

    def _deliver(self, way: Way, frame: bytes, sink: socket.socket) -> bool:
        """Passes a frame on, spoilt or not; false ends the connection."""
        meddling = self._proxy.spoil(way, frame)
        late = self._proxy.held_back(way)
        if meddling is None:
            return _send(sink, [*late, frame])
        if meddling.trouble == "late":
            self._proxy.hold_back(way, frame)
            return _send(sink, late)
        if meddling.trouble == "half_open":
            self._dead.set()
            return True
        if meddling.trouble == "reset":
            self._break_off()
            return True
        if meddling.trouble == "delay":
            time.sleep(meddling.delay_s)  # in wall time: networks know no other
        passed = _send(sink, [*late, *spoilt(frame, meddling, self._proxy)])
        return passed and meddling.trouble != "truncate"


def spoilt(frame: bytes, meddling: Meddling, proxy: ChaosProxy) -> list[bytes]:
    """What is delivered in a frame's stead."""
    number = (int.from_bytes(frame[:2], "big") + meddling.size) % 65536
    instead: dict[Trouble, Callable[[], list[bytes]]] = {
        "drop": list,
        "duplicate": lambda: [frame, frame],
        "truncate": lambda: [frame[: -min(meddling.size, len(frame))]],
        "garble": lambda: [proxy.garbled(frame, meddling.size)],
        "retag": lambda: [number.to_bytes(2, "big") + frame[2:]],
        "swap": lambda: [_swapped(frame)],
    }
    return instead.get(meddling.trouble, lambda: [frame])()


def _swapped(frame: bytes) -> bytes:
    """A reply to function 3 or 4 with every two registers exchanged; other frames as they are."""
    if len(frame) <= WORDS_AT or frame[HEADER] not in {3, 4}:
        return frame
    words = [frame[i : i + 2] for i in range(WORDS_AT, len(frame), 2)]
    for i in range(0, len(words) - 1, 2):
        words[i], words[i + 1] = words[i + 1], words[i]
    return frame[:WORDS_AT] + b"".join(words)


def split(buffer: bytes) -> tuple[list[bytes], bytes]:
    """Whole frames at the head of a stream, and what is left."""
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
