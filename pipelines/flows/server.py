"""The local orchestrator's server process: lives as long as somebody uses it, and keeps its history on disk.

A client holds a locked file in ``clients/``; the system frees the lock when the client dies, however it dies. The
server looks every second and leaves when no lock is held.
"""

from __future__ import annotations

import fcntl
import sys
import threading
import time
from pathlib import Path

import uvicorn
from prefect.server.api.server import create_app

LOOK_S = 1.0
CLIENTS = "clients"
START_LOCK = "start.lock"
ADDRESS = "server.json"


def serve(home: Path, port: int) -> None:
    """Serve on loopback until no client is left."""
    config = uvicorn.Config(
        create_app(), host="127.0.0.1", port=port, log_level="critical", timeout_graceful_shutdown=5
    )
    server = uvicorn.Server(config)
    threading.Thread(target=_leave_when_alone, args=(home, server), daemon=True).start()
    server.run()


def _leave_when_alone(home: Path, server: uvicorn.Server) -> None:
    while True:
        time.sleep(LOOK_S)
        try:
            left = _left(home)
        except (
            FileNotFoundError
        ):  # its folder is gone, as that of a server for one command is: nobody finds it any more
            left = True
        if left:
            server.should_exit = True
            return


def _left(home: Path) -> bool:
    """Whether no client is left, and none can come any more."""
    if any_client(home):
        return False
    with (home / START_LOCK).open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if any_client(home):  # it came meanwhile
            return False
        (home / ADDRESS).unlink(missing_ok=True)
        return True


def any_client(home: Path) -> bool:
    """Whether a living process uses the server; files of dead ones are removed."""
    alive = False
    for path in (home / CLIENTS).glob("*"):
        with path.open("a") as file:
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                alive = True
                continue
            path.unlink(missing_ok=True)
    return alive


if __name__ == "__main__":
    serve(Path(sys.argv[1]), int(sys.argv[2]))
