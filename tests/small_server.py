"""A server for tests of links: it hears, answers as it is told, and hangs up."""

import socket
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress


@contextmanager
def answering(answer: Callable[[bytes], bytes | None]) -> Iterator[tuple[tuple[str, int], list[bytes]]]:
    """Address of a server that gives ``answer`` to what it hears, None hangs up; and the list of what it has heard."""
    listener, heard = socket.create_server(("127.0.0.1", 0)), list[bytes]()

    def serve(connection: socket.socket) -> None:
        with connection, suppress(OSError):
            while data := connection.recv(4096):
                heard.append(data)
                reply = answer(data)
                if reply is None:
                    return
                connection.sendall(reply)

    def accept() -> None:
        with suppress(OSError):
            while True:
                threading.Thread(target=serve, args=(listener.accept()[0],), daemon=True).start()

    thread = threading.Thread(target=accept, daemon=True)
    thread.start()
    try:
        yield listener.getsockname(), heard
    finally:
        listener.shutdown(socket.SHUT_RDWR)
        listener.close()
        thread.join(5.0)
