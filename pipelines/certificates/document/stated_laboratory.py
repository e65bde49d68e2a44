"""What a certificate's XML says that only the laboratory's file knows: names, addresses, order, remarks."""

from __future__ import annotations

from typing import Any

from pipelines.certificates.document.content import CertificateContent
from pipelines.certificates.document.dcc import statements_of
from pipelines.certificates.document.laboratory import LaboratoryFile
from pipelines.certificates.document.xml_facts import first, statements

CORE = "/*/dcc:administrativeData/dcc:coreData"
ITEM = "/*/dcc:administrativeData/dcc:items/dcc:item"
METHOD = "/*/dcc:measurementResults/dcc:measurementResult/dcc:usedMethods/dcc:usedMethod"
PERSON = "/*/dcc:administrativeData/dcc:respPersons/dcc:respPerson"
NAME = "dcc:name/dcc:content/text()"
ACCREDITED, DEVIATIONS = "Accreditation: ", "Deviations from the method: "

NOBODY = LaboratoryFile.model_validate(
    {
        "laboratory": {"name": "-", "address": "-", "country": "DE", "email": "-@-"},
        "customer": {"name": "-", "address": "-", "email": "-@-"},
        "signatory": {"name": "-", "role": "-"},
        "item": {"manufacturer": "-"},
    }
)
"""Stands in place of the laboratory's file for what the archive alone says."""


def laboratory_in(root: Any, archived: CertificateContent) -> LaboratoryFile:
    """The laboratory's file as a document states it; whatever the archive says itself is taken from the archive.

    A document that is made with it from the archive is the same as this one if nothing but these texts can have been changed.

    Parameters
    ----------
    archived : what the archive says, of :data:`NOBODY`

    Raises
    ------
    pydantic.ValidationError
        A text is not allowed in a laboratory's file, such as a claim of accreditation without its body and number.
    """
    known = set(statements_of(archived))
    other = [text for text in statements(root) if text not in known]
    claim = next((text for text in other if text.startswith(ACCREDITED)), "").removeprefix(ACCREDITED)
    deviations = next((text for text in other if text.startswith(DEVIATIONS)), "").removeprefix(DEVIATIONS)
    remarks = [text for text in other if not text.startswith((ACCREDITED, DEVIATIONS))]
    method = first(root, f"{METHOD}/dcc:description/dcc:content/text()")
    laboratory, customer = (_contact(root, place) for place in ("calibrationLaboratory/dcc:contact", "customer"))
    number = first(root, "/*/dcc:administrativeData/dcc:calibrationLaboratory/dcc:calibrationLaboratoryCode/text()")
    if claim or number:
        laboratory["accreditation"] = {"body": claim.removesuffix(f", {number}"), "number": number}
    order = f"{CORE}/dcc:identifications/dcc:identification[dcc:name/dcc:content='order']/dcc:value/text()"
    return LaboratoryFile.model_validate(
        {
            "laboratory": {
                **laboratory,
                "country": first(root, f"{CORE}/dcc:countryCodeISO3166_1/text()"),
                "place": first(root, f"{CORE}/dcc:performanceLocation/text()"),
            },
            "customer": {**customer, "order": first(root, order)},
            "signatory": {
                "name": first(root, f"{PERSON}/dcc:person/{NAME}"),
                "role": first(root, f"{PERSON}/dcc:role/text()"),
            },
            "item": {
                "manufacturer": first(root, f"{ITEM}/dcc:manufacturer/{NAME}"),
                "description": first(root, f"{ITEM}/{NAME}"),
                "model": first(root, f"{ITEM}/dcc:model/text()"),
                "received": first(root, f"{CORE}/dcc:receiptDate/text()") or None,
                "condition": first(root, f"{ITEM}/dcc:description/dcc:content/text()"),
            },
            "method": {
                "procedure": method.removesuffix(archived.method).removesuffix(". "),
                "deviations": deviations,
                "remarks": remarks[0] if remarks else "",
            },
        }
    )


def _contact(root: Any, place: str) -> dict[str, Any]:
    head = f"/*/dcc:administrativeData/dcc:{place}"
    return {
        "name": first(root, f"{head}/{NAME}"),
        "email": first(root, f"{head}/dcc:eMail/text()"),
        "address": first(root, f"{head}/dcc:location/dcc:further/dcc:content/text()"),
    }


def said_by(who: LaboratoryFile) -> str:
    """All that a laboratory's file says, table by table, in one line."""
    tables = who.model_dump(mode="json", exclude_none=True)
    return "; ".join(f"{name}: {', '.join(_values(table))}" for name, table in tables.items() if _values(table))


def _values(table: dict[str, Any]) -> list[str]:
    values = [_values(value) if isinstance(value, dict) else [str(value)] for value in table.values() if value]
    return [text for own in values for text in own]
