"""Whether an orchestrator answers, and takes the key of this process: asked before Prefect is, whose refusals are tracebacks."""

from __future__ import annotations

import base64
import os
import time
import urllib.error
import urllib.request
from http import HTTPStatus

from pipelines.flows.settings import CLIENT_KEY, KEY_FILE
from schemas.errors import LinkLost, WrongUse

POLL_S = 1.0
TIMEOUT_S = 5.0


def knock(patience_s: float = 0.0) -> None:
    """Wait until the orchestrator that PREFECT_API_URL names answers, and make sure that it takes PREFECT_API_AUTH_STRING.

    Raises
    ------
    WrongUse
        The address is none, or the key is missing or wrong.
    LinkLost
        It does not answer within the patience, s.
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
                return  # a server of another kind: Prefect says what it lacks
            found = "refuses the key of PREFECT_API_AUTH_STRING" if os.environ.get(CLIENT_KEY) else "wants a key"
            raise WrongUse(
                f"orchestrator: {address} {found}; give that of its server there, or its file in {KEY_FILE}"
            ) from None
        except (urllib.error.URLError, TimeoutError, ConnectionError) as problem:
            if time.monotonic() >= end:
                found = f"{address} does not answer ({problem}), a server that runs is needed"
                raise LinkLost(f"orchestrator: {found}; start it, or correct PREFECT_API_URL") from None
            time.sleep(POLL_S)
        else:
            return


def _ask(address: str) -> None:
    request = urllib.request.Request(address)  # noqa: S310 - looked at above
    key = os.environ.get(CLIENT_KEY)
    if key:
        request.add_header("Authorization", "Basic " + base64.b64encode(key.encode()).decode())
    with urllib.request.urlopen(request, timeout=TIMEOUT_S):  # noqa: S310
        return
