"""Settings of the orchestrator before its import: address of its history, its key, and no network access to third parties.

:func:`check_server` finds out before Prefect, whose errors are tracebacks, whether a server answers and accepts the key.
"""

import base64
import os
import secrets
import stat
import time
import urllib.error
import urllib.request
from collections.abc import Sequence
from http import HTTPStatus
from pathlib import Path

from schemas.errors import LinkLost, WrongUse

LOCAL = "local"  # instead of the address of a Dask scheduler: a cluster of processes on this computer
STARTUP_S = 120
SERVER_KEY, CLIENT_KEY = "PREFECT_SERVER_API_AUTH_STRING", "PREFECT_API_AUTH_STRING"
CREDENTIAL = "prefect-auth"  # name in the systemd units (LoadCredential)
KEY_FILE = "TUMBLELINE_ORCHESTRATOR_KEY"
DATABASE = "PREFECT_SERVER_DATABASE_CONNECTION_URL"
DATABASE_FILE, DATABASE_CREDENTIAL = "TUMBLELINE_ORCHESTRATOR_DATABASE", "prefect-database"
"""File with the address of the database and its password; as a credential of a unit it has the second name."""

SHORTEST_KEY = 20
JSON_FORMAT = "PREFECT_LOGGING_HANDLERS_CONSOLE_FORMATTER"
DAY_S = 86400
RETENTION_D = 90
"""Days that the server of a line keeps its flow runs; longer than any lot and than the interval of audits."""

EVENTS_D = 7
LOOPBACK = ("127.0.0.1", "localhost")
POLL_S, TIMEOUT_S = 1.0, 5.0  # time between two questions to a server that does not answer yet, and for its answer, s


def cache_folder() -> Path:
    """The user's folder of what can be made again."""
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "tumbleline"


def settings(home: Path, port: int, key: str) -> dict[str, str]:
    """Environment of a local orchestrator, server or client: persistent history, a key, no telemetry, no outgoing connections."""
    address = f"http://127.0.0.1:{port}/api"
    return {
        "PREFECT_HOME": str(home),
        "PREFECT_API_URL": address,
        CLIENT_KEY: key,
        "PREFECT_SERVER_ALLOW_EPHEMERAL_MODE": "false",  # Prefect's temporary server loses most of the history of a run
        "PREFECT_SERVER_EPHEMERAL_STARTUP_TIMEOUT_SECONDS": str(STARTUP_S),
        "PREFECT_LOGGING_LEVEL": os.environ.get("PREFECT_LOGGING_LEVEL", "CRITICAL"),
        **closed(key, origins(LOOPBACK, port)),
        "PREFECT_SERVER_UI_API_URL": address,
    }


def closed(key: str, allowed: Sequence[str]) -> dict[str, str]:
    """Environment of a server that answers only with the key, and only pages of its own origins."""
    return {
        SERVER_KEY: key,
        "PREFECT_SERVER_CORS_ALLOWED_ORIGINS": ",".join(allowed),
        "PREFECT_SERVER_CORS_ALLOWED_METHODS": "GET,POST,PUT,PATCH,DELETE",
        "PREFECT_SERVER_CORS_ALLOWED_HEADERS": (
            "Authorization,Content-Type,Prefect-Csrf-Token,Prefect-Csrf-Client,X-PREFECT-UI"
        ),
        "PREFECT_SERVER_ANALYTICS_ENABLED": "false",
        "DO_NOT_TRACK": "1",
    }


def kept() -> dict[str, str]:
    """Environment of the server of a line: retention of its history, and settings that must survive a restart.

    The history is not needed for traceability, which is in the archive. Events are by far the largest part of it.
    """
    return {
        "PREFECT_SERVER_SERVICES_DB_VACUUM_ENABLED": "events,flow_runs",
        "PREFECT_SERVER_SERVICES_DB_VACUUM_RETENTION_PERIOD": str(RETENTION_D * DAY_S),
        "PREFECT_SERVER_EVENTS_RETENTION_PERIOD": f"P{EVENTS_D}D",
        "PREFECT_SERVER_CONCURRENCY_LEASE_STORAGE": "prefect.server.concurrency.lease_storage.filesystem",
    }


def origins(names: Sequence[str], port: int, scheme: str = "http") -> list[str]:
    """Origins of the page of a server, for every name of its host."""
    return [f"{scheme}://{name}:{port}" for name in names]


def new_key() -> str:
    """A random key in Prefect's form ``user:password``."""
    return f"tumbleline:{secrets.token_urlsafe(32)}"


def use_key(variable: str) -> str:
    """Put the key of the orchestrator into ``variable`` of the environment of this process unless it is set.

    Sources in this order: the environment, the file of TUMBLELINE_ORCHESTRATOR_KEY (secret of a container), and the
    credential ``prefect-auth`` of a systemd unit.

    Raises WrongUse: the key is missing or too short, or other users may read its file.
    """
    given = os.environ.get(variable) or os.environ.get(SERVER_KEY) or os.environ.get(CLIENT_KEY)
    key = given or _secret(KEY_FILE, CREDENTIAL, "key file")
    if len(key) < SHORTEST_KEY or ":" not in key:
        fault = "no key" if not key else f"a key of {len(key)} characters"
        raise WrongUse(
            f"orchestrator: {fault} was found, one of the form user:password with at least {SHORTEST_KEY} characters is needed; "
            f"give it in {variable}, or name a file of mode 0600 with the key in {KEY_FILE}"
        )
    os.environ[variable] = key
    return key


def use_database() -> None:
    """Put the address of the orchestrator's database into the environment of this process, where a private file states it.

    Sources in this order: the environment, the file of TUMBLELINE_ORCHESTRATOR_DATABASE, and the credential
    ``prefect-database`` of a systemd unit. Without one the database is SQLite in PREFECT_HOME.

    Raises WrongUse: the file cannot be read, or other users may read it.
    """
    address = os.environ.get(DATABASE) or _secret(DATABASE_FILE, DATABASE_CREDENTIAL, "database file")
    if address:
        os.environ[DATABASE] = address


def _secret(variable: str, credential: str, what: str) -> str:
    """Content of the file that a variable names, or of a credential of a unit; empty where there is neither."""
    named, credentials = os.environ.get(variable), os.environ.get("CREDENTIALS_DIRECTORY")
    path = Path(named) if named else Path(credentials or "") / credential
    if not named and not (credentials and path.is_file()):
        return ""
    try:
        mode = stat.S_IMODE(path.stat().st_mode)
        text = path.read_text(encoding="utf-8").strip()
    except (OSError, UnicodeDecodeError) as problem:
        fault = type(problem).__name__
        raise WrongUse(
            f"orchestrator: {what} {path} cannot be read ({fault}), a text file is needed; correct {variable}"
        ) from None
    if mode & 0o077:
        raise WrongUse(
            f"orchestrator: {what} {path} has mode {mode:04o}, 0600 or less is needed; run 'chmod 600 {path}'"
        )
    return text


def check_server(patience_s: float = 0.0) -> None:
    """Wait until the orchestrator of PREFECT_API_URL answers, and check that it accepts PREFECT_API_AUTH_STRING.

    Raises WrongUse: the address is invalid, or the key is missing or wrong.
    Raises LinkLost: it does not answer in time.
    """
    address = os.environ.get("PREFECT_API_URL", "")
    if not address.startswith(("http://", "https://")):
        raise WrongUse(
            f"orchestrator: PREFECT_API_URL is '{address}', an address is needed, such as http://127.0.0.1:4200/api"
        )
    end = time.monotonic() + patience_s
    while True:
        try:
            request = with_key(urllib.request.Request(f"{address.rstrip('/')}/admin/version"))  # noqa: S310 - checked above
            urllib.request.urlopen(request, timeout=TIMEOUT_S).close()  # noqa: S310
        except urllib.error.HTTPError as problem:
            problem.close()
            if problem.code != HTTPStatus.UNAUTHORIZED:
                return  # another kind of server: Prefect reports the error
            fault = "refuses the key of PREFECT_API_AUTH_STRING" if os.environ.get(CLIENT_KEY) else "requires a key"
            raise WrongUse(
                f"orchestrator: {address} {fault}; give the key of its server in {CLIENT_KEY}, or the key file in {KEY_FILE}"
            ) from None
        except (urllib.error.URLError, TimeoutError, ConnectionError) as problem:
            if time.monotonic() >= end:
                fault = f"{address} does not answer ({problem}), a running server is needed"
                raise LinkLost(f"orchestrator: {fault}; start it, or correct PREFECT_API_URL") from None
            time.sleep(POLL_S)
        else:
            return


def with_key(request: urllib.request.Request) -> urllib.request.Request:
    """The request, with the key of this process if there is a key."""
    key = os.environ.get(CLIENT_KEY)
    if key:
        request.add_header("Authorization", "Basic " + base64.b64encode(key.encode()).decode())
    return request
