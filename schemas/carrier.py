"""Where a device answers, and what carries requests there."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from schemas.profile import Carrier, WordOrder
from schemas.strict import Strict

SERIAL = ("serial", "baud", "parity", "stop_bits")
SECURE = ("ca_file", "certificate_file", "key_file", "server_name")


class Carried(Strict):
    """A profile at an address; a simulated station leaves the address empty and gets its own.

    ``link`` is ``tcp``, ``tls``, ``ascii`` (lines over TCP), each to host and port, or ``rtu`` on the line ``serial``. With
    ``tls`` the device's certificate must be signed by the authority in ``ca_file`` and bear ``server_name``, or the host's name;
    ``certificate_file`` and ``key_file`` are shown to the device where it asks for them. ``word_order`` is that of a device
    which is set to another than its profile's.
    """

    profile: str
    word_order: WordOrder | None = None
    link: Carrier = "tcp"
    host: str = ""
    port: Annotated[int, Field(ge=0, le=65535)] = 502
    serial: str = ""
    baud: Annotated[int, Field(ge=300, le=1_000_000)] = 19200
    parity: Literal["none", "even", "odd"] = "even"
    stop_bits: Literal[1, 2] = 1
    ca_file: str = ""
    certificate_file: str = ""
    key_file: str = ""
    server_name: str = ""

    @model_validator(mode="after")
    def _of_one_kind(self) -> Carried:
        for kind, names in (("rtu", SERIAL), ("tls", SECURE)):
            given = {} if self.link == kind else self.model_dump(include=set(names), exclude_defaults=True)
            stray = [name for name in names if name in given]
            if stray:
                raise ValueError(
                    f"{', '.join(stray)}: for link {kind}, the link is {self.link}; leave it out, or set link"
                )
        if bool(self.key_file) != bool(self.certificate_file):
            raise ValueError("certificate_file, key_file: one without the other; name both, or none")
        return self

    def missing(self) -> str:
        """The key that a real device at this address still needs; empty when it has all."""
        if self.link == "rtu":
            return "" if self.serial else "serial"
        if not self.host:
            return "host"
        return "ca_file" if self.link == "tls" and not self.ca_file else ""
