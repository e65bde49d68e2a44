"""A TCP server in a separate thread, for devices that are simulated or replayed."""

import socketserver
import threading
from collections.abc import Generator
from contextlib import contextmanager

from schemas.errors import StationRefused

END_S = 5.0
POLL_S = 0.02


class _Server(socketserver.ThreadingTCPServer):
    """A server that ends its connections with itself."""

    allow_reuse_address = True
    daemon_threads = True
    block_on_close = False


@contextmanager
def listening(
    handler: type[socketserver.BaseRequestHandler], host: str, port: int, who: str, remedy: str = "give one"
) -> Generator[int]:
    """The port of a server with this handler of connections, while the context is open.

    Raises StationRefused: the port is in use; ``who`` begins the message, ``remedy`` ends it.
    """
    try:
        server = _Server((host, port), handler)
    except OSError as problem:
        raise StationRefused(
            f"{who}: {host}:{port} cannot listen ({problem.strerror}), a free port is needed; {remedy}"
        ) from None
    thread = threading.Thread(target=server.serve_forever, args=(POLL_S,), name=who, daemon=True)
    thread.start()
    try:
        yield int(server.server_address[1])
    finally:
        server.shutdown()
        server.server_close()
        thread.join(END_S)
