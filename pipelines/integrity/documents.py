"""The JSON document of verify: keys that other programs read."""

from typing import Annotated, Literal

from typing_extensions import TypedDict


class IntegrityFindingDocument(TypedDict):
    """A file of the archive that is not as it was written."""

    kind: Literal["changed", "missing", "edited", "foreign", "newer", "unreadable", "signature", "unchained"]
    path: Annotated[str, "below the archive's root"]
    message: str
    consequences: Annotated[list[str], "sentences about further findings with this cause"]


class SignaturesDocument(TypedDict):
    """Signatures of the manifests."""

    trust: str
    keys: Annotated[list[str], "names of the public keys that were given"]
    manifests: Annotated[dict[str, int], "number of manifests by state of the signature"]


class VerifyDocument(TypedDict):
    """``verify --json``: whether the archive is as it was written."""

    archive: str
    whole: Annotated[bool, "true if there is no finding"]
    findings: list[IntegrityFindingDocument]
    remarks: list[str]
    signatures: SignaturesDocument
    chain_head: Annotated[str, "hash of the last entry of the chain; empty without one"]
    runs: int
    captures: int
    tables: int
    manifests: int
    rows: int
    bytes: int
    seconds: float
    rows_per_s: float
    bytes_per_s: float
