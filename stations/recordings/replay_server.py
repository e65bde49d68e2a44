"""What a recorded device answers, and a server for it: equal requests get equal answers, in their order.

A device is followed through its recording by the orders that it gets. Between two orders a client may read more or less often
than the recorded one did: a read gets the next recorded answer before the next order, and after the last again that.
What was never asked while it was recorded has no answer, and is listed.
"""

import socket
import socketserver
import struct
import threading
import time
from bisect import bisect_left
from collections import defaultdict
from collections.abc import Callable
from contextlib import ExitStack, suppress
from dataclasses import dataclass, field
from typing import Self

from stations.links.frames import EXCEPTION
from stations.links.lines import END, LONGEST
from stations.links.wires import HEADER
from stations.listening import listening
from stations.recordings.frame_file import BROKEN, SILENCE, Exchange, FrameFile

Who = tuple[str, int]


@dataclass
class _Followed:
    """The position of a device in its recording."""

    orders: list[int] = field(default_factory=list[int])
    by_request: dict[bytes, list[int]] = field(default_factory=lambda: defaultdict(list))
    next: int = 0


@dataclass
class Replay:
    """The devices of a recording; ``asked_anew`` is what was asked and is not in it."""

    exchanges: list[Exchange]
    asked_anew: list[str] = field(default_factory=list[str])
    answered: int = 0
    _devices: dict[Who, _Followed] = field(default_factory=lambda: defaultdict(_Followed))

    def __post_init__(self) -> None:
        """Sorts the exchanges by device and request."""
        for number, exchange in enumerate(self.exchanges):
            device = self._devices[exchange.link, exchange.device_id]
            device.by_request[exchange.request].append(number)
            if exchange.writes:
                device.orders.append(number)

    @property
    def who(self) -> list[Who]:
        """Link and device id of every device, in order of their first exchange."""
        return list(self._devices)

    def answer(self, who: Who, request: bytes) -> Exchange | None:
        """The recorded exchange that this request continues with; None where it was never recorded."""
        device = self._devices.get(who)
        numbers = device.by_request.get(request, []) if device is not None else []
        if device is None or not numbers:
            self.asked_anew.append(f"{who[0]} device {who[1]}: {request.hex(' ')}")
            return None
        k = bisect_left(numbers, device.next)
        order = bisect_left(device.orders, device.next)
        until = device.orders[order] if order < len(device.orders) else len(self.exchanges)
        self.answered += 1
        if k < len(numbers) and (self.exchanges[numbers[k]].writes or numbers[k] < until):
            device.next = numbers[k] + 1
            return self.exchanges[numbers[k]]
        return self.exchanges[numbers[max(k - 1, 0)]]


NO_SUCH_REGISTER, NO_SUCH_DEVICE = 2, 11


@dataclass
class ReplayServer:
    """The devices of a recording while the context is open.

    Registers of all links answer at one port, by device id; where two links have the same id the first one answers. Answers come
    as late as they did, divided by ``speed``; silences stay silences and lost connections are closed. ``new`` is called with each
    request that is not in the recording, which is refused: exception 2, or 11 for an unknown device.
    """

    recording: FrameFile
    host: str = "127.0.0.1"
    port: int = 0
    speed: float = 1.0
    new: Callable[[str], None] = lambda _: None
    lines_at: dict[str, int] = field(default_factory=dict[str, int])
    replay: Replay = field(init=False)
    _by_id: dict[int, Who] = field(default_factory=dict[int, Who])
    _alone: threading.Lock = field(default_factory=threading.Lock)
    _stack: ExitStack = field(default_factory=ExitStack)

    def __post_init__(self) -> None:
        """Sorts the devices by id and by link."""
        self.replay = Replay(self.recording.exchanges)
        self._texts = {e.link for e in self.recording.exchanges if e.text}
        for who in self.replay.who:
            if who[0] not in self._texts:
                self._by_id.setdefault(who[1], who)

    def __enter__(self) -> Self:
        """Listens: registers first, then one port for each device with lines."""
        server = self
        port = self.port

        class Registers(socketserver.BaseRequestHandler):
            def handle(self) -> None:
                with suppress(OSError):
                    server.converse(self.request)

        if self._by_id:
            self.port = port = self._listen(Registers, port)
        for link in sorted(self._texts):
            self.lines_at[link] = self._listen(self._line_handler(link), port + 1 if port else 0)
            port = self.lines_at[link]
        if not self._by_id and self.lines_at:
            self.port = min(self.lines_at.values())
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    def _listen(self, handler: type[socketserver.BaseRequestHandler], port: int) -> int:
        return self._stack.enter_context(listening(handler, self.host, port, "replay", "give one with --port"))

    def _line_handler(self, link: str) -> type[socketserver.BaseRequestHandler]:
        server = self

        class Lines(socketserver.StreamRequestHandler):
            def handle(self) -> None:
                with suppress(OSError):
                    while line := self.rfile.readline(LONGEST):
                        answer = server.answer_to((link, 0), line.rstrip(END))
                        if answer is None:
                            self.wfile.write(b"NA:NOT RECORDED" + END)
                        elif answer.failed.startswith(BROKEN):
                            return
                        elif answer.reply is not None:
                            self.wfile.write(answer.reply + END)

        return Lines

    def converse(self, connection: socket.socket) -> None:
        """Answers the frames of one connection until it ends, or until the recorded one was lost."""
        buffer = b""
        while data := connection.recv(4096):
            buffer += data
            while len(buffer) >= HEADER and len(buffer) >= (end := 6 + int.from_bytes(buffer[4:6], "big")):
                frame, buffer = buffer[:end], buffer[end:]
                number, device_id, request = frame[:2], frame[6], frame[HEADER:]
                answer = self.answer_to(self._by_id.get(device_id, ("", device_id)), request)
                if answer is not None and (answer.failed == SILENCE or answer.failed.startswith("malformed")):
                    continue
                if answer is not None and answer.reply is None:
                    return
                reply = self._refusal(device_id, request) if answer is None else answer.reply or b""
                connection.sendall(number + struct.pack(">HHB", 0, len(reply) + 1, device_id) + reply)

    def answer_to(self, who: Who, request: bytes) -> Exchange | None:
        """The recorded exchange, as late as it was; None, and :attr:`new` is told, where there is none."""
        with self._alone:
            exchange = self.replay.answer(who, request)
        if exchange is None:
            self.new(self.replay.asked_anew[-1])
        elif exchange.reply is not None:
            time.sleep(exchange.seconds / self.speed)
        return exchange

    def _refusal(self, device_id: int, request: bytes) -> bytes:
        code = NO_SUCH_REGISTER if device_id in self._by_id else NO_SUCH_DEVICE
        return bytes([request[0] | EXCEPTION, code]) if request else bytes([EXCEPTION, code])
