"""The archive of a flow: its address is a parameter, which is stored and shown; its credentials are never stored.

A flow takes the credentials from its environment (``TUMBLELINE_ARCHIVE``, or the variables of the object store), or
from a Secret block of the orchestrator, which is encrypted. Credentials in an address are detected, removed, or refused.
"""

import os
import re
from collections.abc import Generator
from contextlib import contextmanager
from typing import Any
from urllib.parse import parse_qsl, quote, urlencode

from pipelines.archive import Archive
from pipelines.parallel import with_environment
from schemas.errors import WrongUse

VARIABLE = "TUMBLELINE_ARCHIVE"
BLOCK = "block:"
REFUSED = (
    "archive: a parameter of a flow is an address with credentials, one without is needed, because parameters are "
    f"stored and shown; give the worker the whole address in {VARIABLE}, or save it in a Secret block and give '{BLOCK}NAME'"
)
HARMLESS = {"anonymous"}  # option of Google's store for access without credentials
SECRET = re.compile(
    r"secret|passw|token|credential|signature|account_key|access_key|shared_key|sas\b|^sig$", re.IGNORECASE
)
NO_SECRET = {"credentials_kind", "credential_kind"}  # the kind of the credentials, not the credentials
ADDRESS = re.compile(r"[A-Za-z][A-Za-z0-9+.-]*://[^\s\"'<>\\]+")


def archive_of(parameter: str | None) -> Archive:
    """The archive of a flow's parameter, with the credentials of this process.

    parameter : an address without credentials; ``block:NAME`` for the address in a Secret block; None: TUMBLELINE_ARCHIVE of
        the environment. The address of the environment is used where it differs only by its credentials.

    Raises WrongUse: the parameter has credentials, or the block does not exist.
    """
    refuse_credentials(parameter)
    if parameter is None:
        return Archive()
    if parameter.startswith(BLOCK):
        return Archive(_of_block(parameter.removeprefix(BLOCK)))
    address = os.environ.get(VARIABLE, "")
    return Archive(address if address and without_credentials(address) == parameter else parameter)


@contextmanager
def named(archive: Archive) -> Generator[str]:
    """A context in which flows of this process find an archive by its address without credentials; it gives this address."""
    shown = without_credentials(archive.address)
    with with_environment({} if shown == archive.address else {VARIABLE: archive.address}):
        yield shown


def _of_block(name: str) -> str:
    from prefect.blocks.system import Secret

    try:
        block: Any = Secret  # load can be synchronous or not; its types name only the other kind
        secret = block.load(name, _sync=True)
    except ValueError:
        raise WrongUse(
            f"archive: the orchestrator has no Secret block '{name}', one with the archive's address is needed; save it on the "
            "server's page under Blocks"
        ) from None
    return str(secret.get())


def credentials_in(text: str) -> bool:
    """Whether an address in a text has credentials."""
    return any(without_credentials(candidate) != candidate for candidate in ADDRESS.findall(text))


def without_credentials(address: str) -> str:
    """The address without user and password before its host, and without keys in its query."""
    scheme, mark, rest = address.partition("://")
    if not mark:
        return address
    before, question, query = rest.partition("?")
    authority, slash, path = before.partition("/")
    user, at, host = authority.rpartition("@")
    if at and user not in HARMLESS:
        authority = host
    pairs = parse_qsl(query, keep_blank_values=True)
    harmless = [(name, value) for name, value in pairs if name in NO_SECRET or not SECRET.search(name)]
    if len(harmless) != len(pairs):
        query = urlencode(harmless, quote_via=quote, safe="/:,")
        question = "?" if query else ""
    return f"{scheme}://{authority}{slash}{path}{question}{query}"


def refuse_credentials(address: str | None) -> None:
    """Refuse an address with credentials."""
    if address is not None and without_credentials(address) != address:
        raise WrongUse(REFUSED)
