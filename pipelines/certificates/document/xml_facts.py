"""What the XML of a certificate states: its number, unit, run and dates."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Any

from pipelines.certificates.document.dcc import DCC, SI
from pipelines.certificates.document.signature_check import SignatureBroken

SPACES = {"dcc": DCC, "si": SI}
ISSUED = re.compile(r"^Date of issue: (\d{4}-\d\d-\d\d)$")
COEFFICIENTS = re.compile(r"^SHA-256 of the table of coefficients: ([0-9a-f]{64})$")


@dataclass(frozen=True)
class CertificateFacts:
    """Statements of a certificate's XML; empty where it does not make them.

    coefficients : SHA-256 of the certified table
    """

    version: str
    number: str
    serial: str
    run: str
    issued: str
    coefficients: str
    simulated: bool


def facts_of(root: Any) -> CertificateFacts:
    """The statements of the root element of a certificate.

    Raises
    ------
    SignatureBroken
        It is not a Digital Calibration Certificate.
    """
    if root.tag != f"{{{DCC}}}digitalCalibrationCertificate":
        raise SignatureBroken(f"it is not a Digital Calibration Certificate: its root element is {root.tag}")
    said = [text.strip() for text in statements(root)]
    core = "/*/dcc:administrativeData/dcc:coreData"
    run = f"{core}/dcc:identifications/dcc:identification[dcc:name/dcc:content='run']/dcc:value/text()"
    serial = (
        "/*/dcc:administrativeData/dcc:items/dcc:item/dcc:identifications/dcc:identification"
        "[dcc:name/dcc:content='serial number']/dcc:value/text()"
    )
    return CertificateFacts(
        version=root.get("schemaVersion", ""),
        number=first(root, f"{core}/dcc:uniqueIdentifier/text()"),
        serial=first(root, serial),
        run=first(root, run),
        issued=_matched(ISSUED, said),
        coefficients=_matched(COEFFICIENTS, said),
        simulated=any(text.startswith("SIMULATED") for text in said),
    )


def statements(root: Any) -> list[str]:
    """What a document declares beside its results."""
    return _all(root, "//dcc:statement/dcc:declaration/dcc:content/text()")


def _all(root: Any, path: str) -> list[str]:
    return [str(text) for text in root.xpath(path, namespaces=SPACES)]


def first(root: Any, path: str) -> str:
    """The first text at a path; empty where there is none."""
    return next(iter(_all(root, path)), "")


def _matched(pattern: re.Pattern[str], lines: list[str]) -> str:
    return next((match[1] for line in lines if (match := pattern.match(line))), "")
