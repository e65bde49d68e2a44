"""Server for the devices of the plant with a text protocol, over TCP on loopback."""

import socketserver
import threading
from contextlib import suppress
from types import TracebackType
from typing import Self

from schemas.errors import StationRefused
from stations.plant.plant import Plant

LOOPBACK = "127.0.0.1"
END = b"\r\n"
LONGEST = 256
END_S = 5.0
POLL_S = 0.02


class LineServer:
    """Serves one device with a text protocol while the context is open; ``port`` is its port."""

    def __init__(self, plant: Plant, device_id: int, host: str = LOOPBACK, port: int = 0) -> None:
        self._thread = threading.Thread(
            target=self._serve, name="line-server", daemon=True, kwargs={"poll_interval": POLL_S}
        )

        class Handler(socketserver.StreamRequestHandler):
            """Answers lines until the client closes the connection."""

            def handle(self) -> None:
                """Sends one answer for each line; none while the device does not respond."""
                with suppress(OSError):
                    while line := self.rfile.readline(LONGEST):
                        answer = plant.send_line(device_id, line.rstrip(END).decode("ascii", errors="replace"))
                        if answer is not None:
                            self.wfile.write(answer.encode("ascii", errors="replace") + END)

        try:
            self._server = _Server((host, port), Handler)
        except OSError as problem:
            raise StationRefused(
                f"simulated station: {host}:{port} cannot listen ({problem.strerror}), a free port is needed; give one"
            ) from None
        self.host, self.port = host, int(self._server.server_address[1])

    def __enter__(self) -> Self:
        """Starts."""
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Stops and closes open connections."""
        self._server.shutdown()
        self._server.server_close()
        self._thread.join(END_S)

    def _serve(self, poll_interval: float) -> None:
        self._server.serve_forever(poll_interval)


class _Server(socketserver.ThreadingTCPServer):
    """A server that ends its connections with itself."""

    allow_reuse_address = True
    daemon_threads = True
    block_on_close = False
