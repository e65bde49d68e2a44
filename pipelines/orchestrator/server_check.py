"""Check that an orchestrator answers and accepts the key of this process, before Prefect, whose errors are tracebacks."""

from __future__ import annotations

import base64
import os
import time
import urllib.error
import urllib.request
from http import HTTPStatus

from pipelines.orchestrator.settings import CLIENT_KEY, KEY_FILE
from schemas.errors import LinkLost, WrongUse

POLL_S = 1.0
TIMEOUT_S = 5.0


def check_server(patience_s: float = 0.0) -> None:
    """Wait until the orchestrator of PREFECT_API_URL answers, and check that it accepts PREFECT_API_AUTH_STRING.

    Raises
    ------
    WrongUse
        The address is invalid, or the key is missing or wrong.
    LinkLost
        It does not answer in time.
    """
    address = os.environ.get("PREFECT_API_URL", "")
    if not address.startswith(("http://", "https://")):
        raise WrongUse(
            f"orchestrator: PREFECT_API_URL is '{address}', an address is needed, such as http://127.0.0.1:4200/api"
        )
    end = time.monotonic() + patience_s
    while True:
        try:
            _ask(f"{address.rstrip('/')}/admin/version")
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


def _ask(address: str) -> None:
    request = urllib.request.Request(address)  # noqa: S310 - checked above
    key = os.environ.get(CLIENT_KEY)
    if key:
        request.add_header("Authorization", "Basic " + base64.b64encode(key.encode()).decode())
    with urllib.request.urlopen(request, timeout=TIMEOUT_S):  # noqa: S310
        return
