"""Credentials in an address: detect, remove, refuse."""

from __future__ import annotations

import re
from urllib.parse import parse_qsl, quote, urlencode

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
    kept = [(name, value) for name, value in pairs if name in NO_SECRET or not SECRET.search(name)]
    if len(kept) != len(pairs):
        query = urlencode(kept, quote_via=quote, safe="/:,")
        question = "?" if query else ""
    return f"{scheme}://{authority}{slash}{path}{question}{query}"


def refuse_credentials(address: str | None) -> None:
    """Refuse an address with credentials."""
    if address is not None and without_credentials(address) != address:
        raise WrongUse(REFUSED)
