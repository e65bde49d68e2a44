"""Credentials in an address: found, taken out, refused."""

from __future__ import annotations

import re
from urllib.parse import parse_qsl, quote, urlencode

from schemas.errors import WrongUse

VARIABLE = "TUMBLELINE_ARCHIVE"
BLOCK = "block:"
REFUSED = (
    "archive: an address with credentials was given as a parameter of a flow, one without is needed, because parameters are "
    f"stored and shown; give the worker the whole address in {VARIABLE}, or save it in a Secret block and give '{BLOCK}NAME'"
)
HARMLESS = {"anonymous"}  # how Google's store is asked without credentials
SECRET = re.compile(
    r"secret|passw|token|credential|signature|account_key|access_key|shared_key|sas\b|^sig$", re.IGNORECASE
)
NO_SECRET = {"credentials_kind", "credential_kind"}  # which kind, not which one
ADDRESS = re.compile(r"[A-Za-z][A-Za-z0-9+.-]*://[^\s\"'<>\\]+")


def credentials_in(text: str) -> bool:
    """Whether any address within a text holds credentials."""
    return any(without_credentials(found) != found for found in ADDRESS.findall(text))


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
    """Refuse an address that holds credentials."""
    if address is not None and without_credentials(address) != address:
        raise WrongUse(REFUSED)
