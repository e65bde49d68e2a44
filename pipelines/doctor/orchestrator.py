"""The orchestrator: it answers, its database is ready, it takes the key, it has the version of the client, it is in time."""

import http.client
import json
import os
import time
import urllib.error
import urllib.request
from email.utils import parsedate_to_datetime
from http import HTTPStatus
from importlib import metadata
from typing import NamedTuple
from urllib.parse import urlsplit

from pipelines.doctor.check import clock_check, judged, of_error, offset
from pipelines.doctor.documents import Check
from pipelines.orchestrator.archive_address import without_credentials
from pipelines.orchestrator.settings import CLIENT_KEY, KEY_FILE, LOOPBACK, use_key, with_key
from schemas.errors import TumblelineError

PART = "orchestrator"
VARIABLE = "PREFECT_API_URL"
TIMEOUT_S = 5.0
LARGEST_BODY = 65536


class ServerAnswer(NamedTuple):
    """The answer of a server; ``ahead_s``: its clock less that of the host, None where it states no time."""

    status: int
    body: str
    ahead_s: float | None


def orchestrator_checks() -> list[Check]:
    """The checks of the orchestrator that PREFECT_API_URL names."""
    address = os.environ.get(VARIABLE, "").rstrip("/")
    if not address:
        found = f"{VARIABLE} is not set: each run starts an orchestrator of its own"
        remedy = f"for scheduled runs name the server in {VARIABLE}"
        return [Check(PART, "address", "not configured", found, "", remedy)]
    shown = without_credentials(address)
    if not address.startswith(("http://", "https://")):
        remedy = f"correct {VARIABLE}"
        return [Check(PART, "address", "fault", shown, "an address such as http://127.0.0.1:4200/api", remedy)]
    try:
        health, ready = ask(f"{address}/health"), ask(f"{address}/ready")
    except (OSError, http.client.HTTPException, ValueError) as problem:
        found = f"{shown} does not answer ({getattr(problem, 'reason', None) or problem})"
        return [Check(PART, "reachable", "fault", found, "a server that runs", f"start it, or correct {VARIABLE}")]
    reached, is_ready = health.status == HTTPStatus.OK, ready.status == HTTPStatus.OK
    found, remedy = shown if reached else f"{shown} answers {health.status}", f"correct {VARIABLE}: it ends in /api"
    state, log = "ready" if is_ready else f"not ready ({ready.status})", "look into the server's log"
    database = f"{log}: its database does not answer, or its disk is full"
    return [
        judged(PART, "reachable", found, "200 of a Prefect server", remedy, good=reached),
        judged(PART, "database", state, "200 at /ready", database, good=is_ready),
        *_authenticated(address),
        *([clock_check(PART, health.ahead_s, "its server")] if health.ahead_s is not None else []),
        *_in_clear(address),
    ]


def ask(address: str, *, keyed: bool = False) -> ServerAnswer:
    """The answer to a GET, with the key of this process where it is asked for, whatever its status.

    Raises OSError, http.client.HTTPException: there is no answer within 5 s.
    """
    request = urllib.request.Request(address)  # noqa: S310 - http or https, looked at above
    begun = time.time()
    try:
        with urllib.request.urlopen(with_key(request) if keyed else request, timeout=TIMEOUT_S) as reply:  # noqa: S310
            status, head, body = reply.status, reply.headers, reply.read(LARGEST_BODY)
    except urllib.error.HTTPError as problem:
        with problem:
            status, head, body = problem.code, problem.headers, b""
    return ServerAnswer(status, body.decode("utf-8", "replace"), _ahead(head.get("Date"), begun, time.time()))


def _ahead(stated: str | None, begun: float, ended: float) -> float | None:
    if not stated:
        return None
    try:
        return offset(parsedate_to_datetime(stated).timestamp(), begun, ended, 1.0)
    except ValueError:
        return None


def _authenticated(address: str) -> list[Check]:
    """Whether the server takes the key of this process, and has its version."""
    try:
        use_key(CLIENT_KEY)
        answer = ask(f"{address}/admin/version", keyed=True)
    except TumblelineError as problem:
        return [of_error(PART, "authenticated", problem)]
    except (OSError, http.client.HTTPException) as problem:
        return [Check(PART, "authenticated", "fault", f"no answer ({problem})", "a server that runs", "start it again")]
    if answer.status in (HTTPStatus.UNAUTHORIZED, HTTPStatus.FORBIDDEN):
        remedy = f"give the server's key in {CLIENT_KEY}, or its file in {KEY_FILE}"
        found = f"the key is refused ({answer.status})"
        return [Check(PART, "authenticated", "fault", found, "its server's key", remedy)]
    if answer.status != HTTPStatus.OK:
        remedy = "look into the server's log"
        return [Check(PART, "authenticated", "fault", f"answers {answer.status}", "200", remedy)]
    return [Check(PART, "authenticated", "good", "the key is accepted"), _version(answer.body)]


def _version(body: str) -> Check:
    installed = metadata.version("prefect")
    try:
        found = str(json.loads(body))
    except ValueError:
        found = "no version"
    if found == installed:
        return Check(PART, "version", "good", found)
    remedy = "install one version of Prefect on the server and here"
    return Check(PART, "version", "warning", f"the server has {found}", f"{installed}, as here", remedy)


def _in_clear(address: str) -> list[Check]:
    """A warning where the key crosses a network in clear."""
    parts = urlsplit(address)
    if parts.scheme == "https" or parts.hostname in (*LOOPBACK, "::1"):
        return []
    remedy = "put a proxy with TLS before the server, and name it with https://"
    return [Check(PART, "encryption", "warning", "the key crosses the network in clear", "https", remedy)]
