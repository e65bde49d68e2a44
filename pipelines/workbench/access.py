"""The token of a workbench and what is derived from it: the session of a browser, and the proof that a change needs.

Browsers send a cookie to every port of a host, so the server of another port gets it. It is therefore not the token: it is a
session that only one origin accepts, and only for reading. The proof for changes is kept in the storage of the page, which
belongs to one origin with its port, and is never sent to another.
"""

from __future__ import annotations

import hashlib
import hmac
import math
import re
import secrets
import time

from schemas.errors import WrongUse

BITS = 128
FEWEST_DIFFERENT = 6  # a random token of 128 bits has fewer different characters once in 10 000 in digits, never else
SESSION_S = 7 * 86400
ALPHABETS = ((re.compile(r"[0-9]+"), 10), (re.compile(r"[0-9a-f]+|[0-9A-F]+"), 16), (re.compile(r"[0-9a-z]+"), 36),
             (re.compile(r"[A-Za-z0-9._~-]+"), 66))  # fmt: skip
"""Characters that an address can have without quoting, the smallest alphabet first."""


def refuse_weak(token: str) -> None:
    """Refuse a token that can be guessed.

    Raises
    ------
    WrongUse
        It has fewer than 128 bits, repeats few characters, or has characters that an address cannot have.
    """
    size = next((size for pattern, size in ALPHABETS if pattern.fullmatch(token)), 0)
    bits = len(token) * math.log2(size) if size else 0.0
    if bits >= BITS and len(set(token)) >= FEWEST_DIFFERENT:
        return
    found = (
        "characters other than letters, digits and . _ ~ -" if token and not size
        else f"a token of {len(token)} characters, {bits:.0f} bits at most" if bits < BITS
        else f"a token of {len(set(token))} different characters"
    )  # fmt: skip
    raise WrongUse(
        f"workbench: {found} was found, a random token of at least {BITS} bits is needed (32 hexadecimal digits, or 22 letters "
        "and digits); make one with 'openssl rand -hex 16' and put it into TUMBLELINE_WORKBENCH_TOKEN, or leave it out"
    )


def session(token: str, origin: str) -> str:
    """A new session of a browser for one origin: time of its end, a random number, and their code."""
    content = f"{int(time.time()) + SESSION_S}.{secrets.token_hex(16)}"
    return f"{content}.{_code(token, 'session', origin, content)}"


def session_holds(token: str, origin: str, value: str) -> bool:
    """Whether this service gave the session, for this origin, and it has not ended."""
    content, _, code = value.rpartition(".")
    end = content.partition(".")[0]
    return (
        hmac.compare_digest(code.encode(), _code(token, "session", origin, content).encode())
        and end.isdecimal()
        and time.time() < int(end)
    )


def change_proof(token: str, origin: str, value: str) -> str:
    """What the page of a session sends with its changes."""
    return _code(token, "change", origin, value)


def _code(token: str, *parts: str) -> str:
    return hmac.new(token.encode(), "\0".join(parts).encode(), hashlib.sha256).hexdigest()
