"""The server process of the orchestrator: Prefect's server with a key, only for its own host names and pages of its own origin.

    python -m pipelines.orchestrator.server --host 127.0.0.1 --port 4200

With ``--until-unused FOLDER`` it is the server of a command and runs as long as a client uses it. A client holds a locked file
in ``clients/``; the system releases the lock when the client ends, also when it is killed. The server checks every second and
ends when no lock is held.
"""

import argparse
import gc
import os
import sys
import threading
import time
from collections.abc import Generator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from pipelines.orchestrator import settings
from pipelines.orchestrator.new_database import make_database
from pipelines.serving.connections import MOST, ConnectionLimits, TimedRequests, bound_socket
from schemas import host
from schemas.errors import TumblelineError, WrongUse
from schemas.log_lines import JSON, tell, wants_json
from stations.safety.folder import state_folder

if TYPE_CHECKING:
    import uvicorn

LOOK_S = 1.0
CLIENTS = "clients"
START_LOCK = "start.lock"
ADDRESS = "server.json"
# by default Prefect copies its pages into its own package, which may be read-only
PAGES = "PREFECT_UI_STATIC_DIRECTORY"
PRIVATE = 0o077  # removed from the modes of all files of the server: its database has unencrypted parameters and logs


def serve(
    host: str, port: int, names: Sequence[str], home: Path | None = None, tls: tuple[Path, Path] | None = None
) -> None:
    """Serve until the process is stopped, or, with a ``home``, until no client is left there.

    names : further names of this host; requests with other names are refused
    home : folder of the locks of the clients
    tls : files of the certificate and of its key, for https; clients name the authority in PREFECT_API_SSL_CERT_FILE
    """
    known, scheme = [*settings.LOOPBACK, *names], "http" if tls is None else "https"
    origins = settings.origins(known, port, scheme)
    os.umask(PRIVATE)
    key = settings.use_key(settings.SERVER_KEY)
    os.environ.update(settings.closed(key, origins))
    settings.use_database()
    os.environ.setdefault("PREFECT_SERVER_UI_API_URL", f"{scheme}://{known[-1]}:{port}/api")
    if wants_json():
        os.environ.setdefault(settings.JSON_FORMAT, JSON)
    if home is None:
        for name, value in settings.kept().items():
            os.environ.setdefault(name, value)
    if PAGES not in os.environ:
        pages = (
            state_folder() / "orchestrator-pages"
        )  # once for a user and a version of Prefect, outside the installed packages
        pages.mkdir(exist_ok=True)  # Prefect locks a file in it before it makes it
        os.environ[PAGES] = str(pages)
    folder = os.environ.get("PREFECT_HOME")
    if folder:
        private_folder(Path(folder))
        make_database(Path(folder))
    with quick_imports():
        import uvicorn

        from pipelines.orchestrator.application import application  # Prefect reads its settings when it is imported

        app = application(known, origins, key)
    # another machine is a worker's: each process of its flows has connections
    limits = ConnectionLimits(of_one_address=MOST // 2, plain=tls is None)
    bound = bound_socket(host, port, "orchestrator", limits)
    config = uvicorn.Config(
        TimedRequests(app, bound.connections),
        host=host,
        port=port,
        log_config=None,  # in the format of Prefect's logging
        log_level="warning",
        timeout_graceful_shutdown=5,
        proxy_headers=False,
        ssl_certfile=tls[0] if tls else None,
        ssl_keyfile=tls[1] if tls else None,
    )
    server = uvicorn.Server(config)
    if home is not None:
        threading.Thread(target=_leave_when_alone, args=(home, server), daemon=True).start()
    with bound:
        server.run(sockets=[bound])


def private_folder(path: Path) -> None:
    """Make a folder that only this user can read."""
    path.mkdir(mode=0o700, parents=True, exist_ok=True)
    path.chmod(0o700)


def _leave_when_alone(home: Path, server: "uvicorn.Server") -> None:
    while not server.should_exit:
        time.sleep(LOOK_S)
        try:
            left = _left(home)
        except FileNotFoundError:  # the folder was removed with the command of this server: no client can find it
            left = True
        if left:  # never set back: a signal sets it, too
            server.should_exit = True


def _left(home: Path) -> bool:
    """Whether no client is left; no new client can register then."""
    if any_client(home):
        return False
    with (home / START_LOCK).open("w") as lock:
        host.lock(lock, host.EXCLUSIVE)
        if any_client(home):  # registered in the meantime
            return False
        (home / ADDRESS).unlink(missing_ok=True)
        return True


def any_client(home: Path) -> bool:
    """Whether a living process uses the server; files of dead processes are removed."""
    alive = False
    for path in (home / CLIENTS).glob("*"):
        with path.open("a") as file:
            try:
                host.lock(file, host.EXCLUSIVE | host.AT_ONCE)
            except BlockingIOError:
                alive = True
                continue
            path.unlink(missing_ok=True)
    return alive


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m pipelines.orchestrator.server", description="The orchestrator's server."
    )
    parser.add_argument("--host", default=settings.LOOPBACK[0], help="Address to listen on.")
    parser.add_argument("--port", type=int, default=4200, help="Port to listen on.")
    parser.add_argument(
        "--name", action="append", default=[], help="A further host name that clients use; may be repeated."
    )
    parser.add_argument("--certificate", type=Path, metavar="FILE.pem", help="Certificate for https.")
    parser.add_argument("--certificate-key", type=Path, metavar="FILE.pem", help="Private key of the certificate.")
    parser.add_argument(
        "--until-unused", type=Path, metavar="FOLDER", help="End when no client holds a lock in this folder."
    )
    return parser


def main(arguments: Sequence[str] | None = None) -> None:
    """Serve with the options of the command line."""
    given = _parser().parse_args(arguments)
    try:
        if (given.certificate is None) != (given.certificate_key is None):
            raise WrongUse("server: a certificate and its key are needed together; give both or neither")
        tls = None if given.certificate is None else (given.certificate, given.certificate_key)
        serve(given.host, given.port, given.name, given.until_unused, tls)
    except TumblelineError as problem:
        tell(str(problem), level="error")
        sys.exit(problem.exit_status)


@contextmanager
def quick_imports() -> Generator[None]:
    """A block that imports much. What it makes stays, so it is not searched for garbage, neither in the block nor later.

    Prefect's server makes some hundred thousand objects while it is imported; searching them takes an eighth of that time.
    """
    enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        gc.freeze()
        if enabled:
            gc.enable()


if __name__ == "__main__":
    main()
