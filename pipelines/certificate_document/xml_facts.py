"""What the XML of a certificate states: its number, unit, run, dates and results."""

from __future__ import annotations

import re
from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from pipelines.certificate_document.dcc import DCC, SI
from pipelines.certificate_document.signature_check import SignatureBroken

if TYPE_CHECKING:
    from collections.abc import Mapping

SPACES = {"dcc": DCC, "si": SI}
ISSUED = re.compile(r"^Date of issue: (\d{4}-\d\d-\d\d)$")
COEFFICIENTS = re.compile(r"^SHA-256 of the table of coefficients: ([0-9a-f]{64})$")


@dataclass(frozen=True)
class CertificateFacts:
    """Statements of a certificate's XML; empty where it does not make them.

    measured : first and last day; coefficients : SHA-256 of the certified table
    numbers : by name of the result, quantity and label: value, unit, expanded uncertainty and k as text
    conformity : by declaration: the decision
    """

    version: str
    number: str
    serial: str
    run: str
    issued: str
    measured: tuple[str, str]
    coefficients: str
    simulated: bool
    numbers: Mapping[str, tuple[str, ...]]
    conformity: Mapping[str, str]


def facts_of(root: Any) -> CertificateFacts:
    """The statements of the root element of a certificate.

    Raises
    ------
    SignatureBroken
        It is not a Digital Calibration Certificate.
    """
    if root.tag != f"{{{DCC}}}digitalCalibrationCertificate":
        raise SignatureBroken(f"it is not a Digital Calibration Certificate: its root element is {root.tag}")
    said = [text.strip() for text in _all(root, "//dcc:statement/dcc:declaration/dcc:content/text()")]
    core = "/*/dcc:administrativeData/dcc:coreData"
    run = f"{core}/dcc:identifications/dcc:identification[dcc:name/dcc:content='run']/dcc:value/text()"
    serial = (
        "/*/dcc:administrativeData/dcc:items/dcc:item/dcc:identifications/dcc:identification"
        "[dcc:name/dcc:content='serial number']/dcc:value/text()"
    )
    return CertificateFacts(
        version=root.get("schemaVersion", ""),
        number=_first(root, f"{core}/dcc:uniqueIdentifier/text()"),
        serial=_first(root, serial),
        run=_first(root, run),
        issued=_matched(ISSUED, said),
        measured=(
            _first(root, f"{core}/dcc:beginPerformanceDate/text()"),
            _first(root, f"{core}/dcc:endPerformanceDate/text()"),
        ),
        coefficients=_matched(COEFFICIENTS, said),
        simulated=any(text.startswith("SIMULATED") for text in said),
        numbers=_numbers(root),
        conformity={
            _first(one, "dcc:declaration/dcc:content/text()"): _first(one, "dcc:conformity/text()")
            for one in _all(root, "//dcc:metaData[dcc:conformity]")
        },
    )


def _all(root: Any, path: str) -> list[Any]:
    return list(root.xpath(path, namespaces=SPACES))


def _first(root: Any, path: str) -> str:
    return next((str(text) for text in _all(root, path)), "")


def _matched(pattern: re.Pattern[str], lines: list[str]) -> str:
    return next((match[1] for line in lines if (match := pattern.match(line))), "")


def _numbers(root: Any) -> dict[str, tuple[str, ...]]:
    """Numbers of the results; in a time that grows as the file does, whatever it repeats or nests."""
    numbers: dict[str, tuple[str, ...]] = {}
    heads: dict[Any, str] = {}
    quantities: dict[Any, str] = {}
    counts: Counter[str] = Counter()
    for real in root.iter(f"{{{SI}}}real"):
        result = next(real.iterancestors(f"{{{DCC}}}result"), None)
        if result is None:
            continue
        around = real.getparent()
        if result not in heads:
            heads[result] = _first(result, "dcc:name/dcc:content/text()")
        if around not in quantities:
            quantities[around] = _first(around, "dcc:name/dcc:content/text()")
        own = "; ".join(part for part in (heads[result], quantities[around], _first(real, "si:label/text()")) if part)
        key = own
        while key in numbers:  # a second number of the same name does not hide the first
            counts[own] += 1
            key = f"{own} ({counts[own] + 1})"
        numbers[key] = tuple(
            _first(real, f"{path}/text()")
            for path in ("si:value", "si:unit", "si:expandedUnc/si:uncertainty", "si:expandedUnc/si:coverageFactor")
        )
    return numbers
