"""The JSON document of the certification of a run: keys that other programs read."""

from __future__ import annotations

from typing import Annotated, Literal

from typing_extensions import TypedDict

LedgerEntryDocument = TypedDict(
    "LedgerEntryDocument",
    {
        "serial": str,
        "sequence": Annotated[int, "number of the entry in the unit's ledger"],
        "device": str,
        "run": str,
        "from": Annotated[str, "first day of validity, ISO date; of a revocation the day on which the validity ends"],
        "until": Annotated[str, "the day after the last"],
        "grade": str,
        "station": str,
        "recipe": str,
        "coefficients": Annotated[str, "SHA-256 of the table"],
        "ends": Annotated[list[int], "sequences of the calibrations that it ended"],
        "who": str,
        "where": str,
        "when": Annotated[str, "ISO date and time, UTC"],
        "reason": str,
        "previous": Annotated[str, "SHA-256 of the unit's previous entry; empty for the first"],
        "evidence": Annotated[
            dict[str, str], "SHA-256 of the manifests of the run that support the decision, by table"
        ],
        "adequacy": Annotated[str, "verdict on the model with its p; empty in entries of earlier versions"],
        "schema": int,
    },
)
LedgerEntryDocument.__doc__ = "An entry of a unit's ledger; its action stands in the documents of the commands."


class CertifiedDocument(LedgerEntryDocument):
    """A calibration that was entered into the ledger."""

    certificate: Annotated[str, "number: serial and sequence"]
    action: Annotated[Literal["certify", "supersede"], "`supersede`: it ended other calibrations"]
    was_there: Annotated[bool, "true if it was in the ledger before"]


class CertifyDocument(TypedDict):
    """``certify --json``: the calibrations of a run that were entered into the ledger."""

    run: str
    certified: list[CertifiedDocument]
    left_out: Annotated[dict[str, str], "units without a certificate, with the reason"]
