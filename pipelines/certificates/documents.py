"""The JSON documents of calibrations: certified, valid and revoked ones, written certificates, and checks of their files."""

from typing import Annotated, Any, Literal, NotRequired

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
        "coefficients": Annotated[str, "SHA-256 of the certified table: coefficients, without any procedure_results"],
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
        "covers": Annotated[str, "static (coefficients) and procedures such as sweep or shock, with blanks between"],
        "schema": int,
    },
)
LedgerEntryDocument.__doc__ = "An entry of a unit's ledger; its action stands in the documents of the commands."


class CertifiedDocument(LedgerEntryDocument):
    """A calibration that was entered into the ledger."""

    certificate: Annotated[str, "number: serial and sequence"]
    action: Annotated[Literal["certify", "supersede"], "`supersede`: it ended other calibrations"]
    was_there: Annotated[bool, "true if it was already in the ledger"]


class CertifyDocument(TypedDict):
    """``certificate issue --json``: the calibrations of a run that were entered into the ledger."""

    run: str
    certified: list[CertifiedDocument]
    left_out: Annotated[dict[str, str], "units without a certificate, with the reason"]


class CertifiedBy(TypedDict):
    """Who certified a calibration."""

    who: str
    where: str
    when: str
    reason: str


class EndedBy(TypedDict):
    """The ledger entry that ends a calibration."""

    action: str
    sequence: int
    who: str
    when: str
    reason: str


Validity = TypedDict(
    "Validity", {"from": Annotated[str, "first day"], "until": Annotated[str, "the day after the last"]}
)


class CertifiedCalibration(Validity):
    """A calibration in the ledger, whatever its coefficients."""

    certificate: str
    serial: str
    device: str
    state: Literal["valid", "superseded", "revoked"]
    run: str
    covers: Annotated[str, "static (coefficients) and procedures such as sweep or shock, with blanks between"]
    grade: str
    station: str
    recipe: str
    stated_until: NotRequired[Annotated[str, "`until` as it was certified"]]
    certified: NotRequired[CertifiedBy]
    ended: NotRequired[EndedBy | None]


class CalibrationDocument(CertifiedCalibration):
    """A calibration in the ledger."""

    coefficients: Annotated[str, "hash of the table"]


class ValidCalibration(CertifiedCalibration):
    """The calibration that is valid, with its coefficients."""

    coefficients: Annotated[list[dict[str, Any]] | None, "rows of the unit; null if the run is not in the archive"]
    made: NotRequired[Annotated[dict[str, Any] | None, "stage, code, libraries and inputs of the coefficients"]]


class ShowValidityDocument(TypedDict):
    """``show UNIT --at DATE --json``: the calibration of a unit that is valid on a date."""

    unit: str
    at: str
    valid: bool
    calibration: ValidCalibration | None
    history: Annotated[list[CalibrationDocument], "every calibration of the unit, oldest first"]


class CertificateListDocument(TypedDict):
    """``certificate list --json``: the certificates of an archive, by unit."""

    archive: str
    at: Annotated[str | None, "day on which the listed certificates are valid; null: all are listed"]
    certificates: Annotated[list[CalibrationDocument], "by serial, then oldest first"]


class CertificateFiles(TypedDict):
    """The files of one certificate."""

    certificate: str
    serial: str
    run: str
    pdf: str
    xml: str
    signature: Annotated[str | None, "detached signature of the XML; null: not signed"]


class CertificateDocument(TypedDict):
    """``certificate write --json``: the files of the certificates that were written."""

    certificates: list[CertificateFiles]
    left_out: Annotated[dict[str, str], "units of a run that have no certificate, with the reason"]


class RevokeDocument(LedgerEntryDocument):
    """``certificate revoke UNIT --json``: the entry of the ledger that ends calibrations."""

    action: Literal["certify", "supersede", "revoke"]
    unit: str
    revoked: Annotated[list[str], "certificates that it ends"]
    still_valid: Annotated[list[str], "certificates of the same measurements that hold today or later"]


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
    proven_by: Annotated[list[Literal["signature", "archive"]], "what proves its origin; empty: nothing"]
    accepted: Annotated[bool, "true if no check is bad and the origin is proven"]


class CertificateCheckDocument(TypedDict):
    """``verify FILE… --json``: files of certificates, checked alone or with an archive."""

    files: list[CheckedFileDocument]
    accepted: Annotated[bool, "true if every file is accepted"]
