"""Settings of a workbench."""

import math
import re
import secrets
from dataclasses import dataclass, field
from pathlib import Path

from schemas.errors import WrongUse

LOOPBACK = ("127.0.0.1", "localhost", "::1")
LOOPBACK_HOSTS = frozenset({*LOOPBACK, "[::1]"})
"""Names of this machine in the header Host."""
PORT = 8321
BITS = 128
FEWEST_DIFFERENT = 6  # a random token of 128 bits has fewer different characters once in 10 000 in digits, never else
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


@dataclass(frozen=True)
class WorkbenchSettings:
    """A workbench of an archive.

    archive : its address · folder : of files of dwells, models, uploads and the state of jobs and lots
    pause_lots : whether lots are paused when the server ends
    host, port : interface to listen on · names : further host names
    stations : files of the stations that lots are measured on; empty for the simulated one
    token : allows a browser to change data, 128 bits at least · tls : whether it uses HTTPS · proxied : whether a proxy encrypts
    """

    archive: str
    folder: Path
    host: str = "127.0.0.1"
    port: int = PORT
    names: tuple[str, ...] = ()
    token: str = field(default_factory=lambda: secrets.token_urlsafe(24))
    tls: bool = False
    proxied: bool = False
    stations: tuple[Path, ...] = ()
    workers: int = 2
    pause_lots: bool = False

    @property
    def station(self) -> Path | None:
        """The first station; None for the built-in simulated one."""
        return self.stations[0] if self.stations else None

    @property
    def local(self) -> bool:
        """Whether it listens for this machine only; a proxy on it may still pass on requests of others."""
        return self.host in LOOPBACK

    @property
    def hosts(self) -> frozenset[str]:
        """Permitted host names, without a port."""
        return frozenset({*LOOPBACK_HOSTS, *self.names, *([] if self.host in {"0.0.0.0", "::"} else [self.host])})  # noqa: S104

    @property
    def cookie(self) -> str:
        """Name of the cookie; cookies know no ports, and several workbenches can run on one host."""
        return f"{'__Host-' if self.secure else ''}tumbleline-workbench-{self.port}"

    @property
    def secure(self) -> bool:
        """Whether browsers reach it by https."""
        return self.tls or self.proxied

    @property
    def address(self) -> str:
        """The start address without the token."""
        scheme = "https" if self.tls else "http"
        host = "127.0.0.1" if self.host in {"0.0.0.0", "::"} else self.host  # noqa: S104
        return f"{scheme}://{f'[{host}]' if ':' in host else host}:{self.port}"

    def refuse_unsafe(self) -> None:
        """Refuse a token that can be guessed, and access from other machines without encryption."""
        refuse_weak(self.token)
        if not self.local and not self.tls and not self.proxied:
            raise WrongUse(
                f"workbench: host {self.host} is reachable from other machines, encryption is needed; give --tls with a "
                "certificate and its key, or --behind-proxy if a proxy encrypts, or leave --host out"
            )
