"""The plant's devices with a text protocol, over TCP on loopback."""

from __future__ import annotations

import socketserver
import threading
from contextlib import suppress
from typing import TYPE_CHECKING, Self

from schemas.errors import StationRefused

if TYPE_CHECKING:
    from types import TracebackType

    from stations.plant.plant import Plant

LOOPBACK = "127.0.0.1"
END = b"\r\n"
LONGEST = 256
END_S = 5.0
POLL_S = 0.02


class LineServer:
    """Serves one speaking device of a plant while the context is open; ``port`` is the one it got."""

    def __init__(self, plant: Plant, device_id: int, host: str = LOOPBACK, port: int = 0) -> None:
        self._thread = threading.Thread(
            target=self._serve, name="line-server", daemon=True, kwargs={"poll_interval": POLL_S}
        )

        class Conversation(socketserver.StreamRequestHandler):
            """Lines until the client hangs up."""

            def handle(self) -> None:
                """One answer for each line; none where the device is mute."""
                with suppress(OSError):
                    while line := self.rfile.readline(LONGEST):
                        answer = plant.send_line(device_id, line.rstrip(END).decode("ascii", errors="replace"))
                        if answer is not None:
                            self.wfile.write(answer.encode("ascii", errors="replace") + END)

        try:
            self._server = _Server((host, port), Conversation)
        except OSError as problem:
            raise StationRefused(
                f"simulated station: {host}:{port} does not listen ({problem.strerror}); give a free port"
            ) from None
        self.host, self.port = host, int(self._server.server_address[1])

    def __enter__(self) -> Self:
        """Starts."""
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Stops, and closes open connections."""
        self._server.shutdown()
        self._server.server_close()
        self._thread.join(END_S)

    def _serve(self, poll_interval: float) -> None:
        self._server.serve_forever(poll_interval)


class _Server(socketserver.ThreadingTCPServer):
    """A server whose conversations end with it."""

    allow_reuse_address = True
    daemon_threads = True
    block_on_close = False
