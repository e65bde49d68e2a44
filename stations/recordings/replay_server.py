"""Serves a recording as devices: Modbus over TCP for any client, and lines of text on a port of its own for each text device."""

import socket
import socketserver
import struct
import threading
import time
from collections.abc import Callable
from contextlib import ExitStack, suppress
from dataclasses import dataclass, field
from types import TracebackType
from typing import Self

from schemas.errors import StationRefused
from stations.links.frames import EXCEPTION
from stations.links.lines import END, LONGEST
from stations.links.wires import HEADER
from stations.recordings.frame_file import BROKEN, SILENCE, Exchange, FrameFile
from stations.recordings.replay import Replay, Who

NO_SUCH_REGISTER, NO_SUCH_DEVICE = 2, 11
END_S = 5.0
POLL_S = 0.05


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
        self.replay = Replay.of(self.recording)
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

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Ends the servers and their connections."""
        self._stack.close()

    def _listen(self, handler: type[socketserver.BaseRequestHandler], port: int) -> int:
        try:
            server = _Server((self.host, port), handler)
        except OSError as problem:
            raise StationRefused(
                f"replay: {self.host}:{port} cannot listen ({problem.strerror}), a free port is needed; give one with --port"
            ) from None
        thread = threading.Thread(target=server.serve_forever, args=(POLL_S,), name="replay", daemon=True)
        thread.start()

        def end() -> None:
            server.shutdown()
            server.server_close()
            thread.join(END_S)

        self._stack.callback(end)
        return int(server.server_address[1])

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


class _Server(socketserver.ThreadingTCPServer):
    """A server that ends its connections with itself."""

    allow_reuse_address = True
    daemon_threads = True
    block_on_close = False
