"""The JSON document of the check of certificate files: keys that other programs read."""

from typing import Annotated, Literal

from typing_extensions import TypedDict


class FileCheckDocument(TypedDict):
    """One check of a file of a certificate."""

    check: Literal["file", "attachment", "schema", "signature", "signer", "archive", "laboratory", "state", "origin"]
    state: Literal["good", "bad", "not checked"]
    message: str


class CheckedFileDocument(TypedDict):
    """A file of a certificate with its checks."""

    file: str
    certificate: Annotated[str, "number; empty where it cannot be read"]
    serial: str
    run: str
    issued: Annotated[str, "ISO date; empty where it is not stated"]
    signers: Annotated[
        list[str], "subjects of the signers' certificates; empty: not signed, or the signature does not hold"
    ]
    checks: list[FileCheckDocument]
    proven_by: Annotated[list[Literal["signature", "archive"]], "what shows its origin; empty: nothing"]
    accepted: Annotated[bool, "true if no check is bad and the origin is proven"]


class CertificateCheckDocument(TypedDict):
    """``verify FILE… --json``: files of certificates, checked alone or with an archive."""

    files: list[CheckedFileDocument]
    accepted: Annotated[bool, "true if every file is accepted"]
