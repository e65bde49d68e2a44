"""What the orchestrator must be told before it is imported: where its history lives, its key, and to keep to itself."""

from __future__ import annotations

import os
import secrets
import stat
from pathlib import Path
from typing import TYPE_CHECKING

from schemas.errors import WrongUse

if TYPE_CHECKING:
    from collections.abc import Sequence

LOCAL = "local"
"""Instead of a Dask scheduler's address: a cluster of processes on this machine."""

STARTUP_S = 120
SERVER_KEY, CLIENT_KEY = "PREFECT_SERVER_API_AUTH_STRING", "PREFECT_API_AUTH_STRING"
CREDENTIAL = "prefect-auth"  # as the systemd units call it (LoadCredential)
KEY_FILE = "TUMBLELINE_ORCHESTRATOR_KEY"
SHORTEST_KEY = 20
LOOPBACK = ("127.0.0.1", "localhost")


def settings(home: Path, port: int, key: str) -> dict[str, str]:
    """Environment of a local orchestrator, server or client: persistent history, a key, no telemetry, no way out."""
    address = f"http://127.0.0.1:{port}/api"
    return {
        "PREFECT_HOME": str(home),
        "PREFECT_API_URL": address,
        CLIENT_KEY: key,
        "PREFECT_SERVER_ALLOW_EPHEMERAL_MODE": "false",  # the temporary server loses most of a run's history
        "PREFECT_SERVER_EPHEMERAL_STARTUP_TIMEOUT_SECONDS": str(STARTUP_S),
        "PREFECT_LOGGING_LEVEL": os.environ.get("PREFECT_LOGGING_LEVEL", "CRITICAL"),
        **closed(key, origins(LOOPBACK, port)),
        "PREFECT_SERVER_UI_API_URL": address,
    }


def closed(key: str, allowed: Sequence[str]) -> dict[str, str]:
    """Environment of a server that answers nobody without the key, and pages of its own origins only."""
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


def origins(names: Sequence[str], port: int) -> list[str]:
    """Origins of a server's own page, by every name of its host."""
    return [f"http://{name}:{port}" for name in names]


def new_key() -> str:
    """A key that nobody guesses, in the form ``user:password`` that Prefect asks for."""
    return f"tumbleline:{secrets.token_urlsafe(32)}"


def use_key(variable: str) -> str:
    """The orchestrator's key, put into ``variable`` of this process' environment if it is not there.

    Looked for in the environment, in the file that TUMBLELINE_ORCHESTRATOR_KEY names (a container's secret), and in the
    credential ``prefect-auth`` of a systemd unit, in this order.

    Raises
    ------
    WrongUse
        There is none, it is too short, or other users may read its file.
    """
    key = os.environ.get(variable) or os.environ.get(SERVER_KEY) or os.environ.get(CLIENT_KEY) or _key_of_file()
    if len(key) < SHORTEST_KEY or ":" not in key:
        found = "no key" if not key else f"a key of {len(key)} characters"
        raise WrongUse(
            f"orchestrator: {found} was found, one of the form user:password with at least {SHORTEST_KEY} characters is needed; "
            f"give it in {variable}, or name a file of mode 0600 that holds it in {KEY_FILE}"
        )
    os.environ[variable] = key
    return key


def _key_of_file() -> str:
    named, credentials = os.environ.get(KEY_FILE), os.environ.get("CREDENTIALS_DIRECTORY")
    path = Path(named) if named else Path(credentials or "") / CREDENTIAL
    if not named and not (credentials and path.is_file()):
        return ""
    try:
        mode = stat.S_IMODE(path.stat().st_mode)
        text = path.read_text(encoding="utf-8").strip()
    except (OSError, UnicodeDecodeError) as problem:
        found = type(problem).__name__
        raise WrongUse(
            f"orchestrator: key file {path} cannot be read ({found}), a text file is needed; correct {KEY_FILE}"
        ) from None
    if mode & 0o077:
        raise WrongUse(
            f"orchestrator: key file {path} has mode {mode:04o}, 0600 or less is needed; run 'chmod 600 {path}'"
        )
    return text
