"""The laboratory's file: laboratory, customer, signatory and other statements of a certificate that the archive lacks."""

import re
from datetime import date as Day  # noqa: N812 - a field has its name
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import Field, ValidationError, model_validator

from schemas.bounds import Text
from schemas.errors import WrongUse
from schemas.strict import Strict
from schemas.toml_files import explain, parse_toml, read_text

Line = Annotated[str, Field(min_length=1, max_length=200)]
EMail = Annotated[str, Field(pattern=r"^[^@\s]+@[^@\s]+$", max_length=200)]
Country = Annotated[str, Field(pattern=r"^[A-Z]{2}$")]
ACCREDITED = re.compile(r"accredit|akkredit|accrédit", re.IGNORECASE)


class Accreditation(Strict):
    """Accreditation of the laboratory: the body that gave it, and its number."""

    body: Line
    number: Line


class Laboratory(Strict):
    """Who calibrates (7.8.2.1 b, c).

    country : ISO 3166-1, two letters; place : where the work was done; accreditation : only where there is one
    """

    name: Line
    address: Line
    country: Country
    email: EMail
    place: Literal["laboratory", "customer", "laboratoryBranch", "customerBranch", "other"] = "laboratory"
    accreditation: Accreditation | None = None


class Customer(Strict):
    """For whom (7.8.2.1 e); order : the customer's own number of it."""

    name: Line
    address: Line
    email: EMail
    order: Annotated[str, Field(max_length=200)] = ""


class Signatory(Strict):
    """Who authorises the certificate (7.8.2.1 o)."""

    name: Line
    role: Line


class Item(Strict):
    """Statements on the calibrated units that the archive lacks (7.8.2.1 g, h)."""

    manufacturer: Line
    description: Line = "Accelerometer"
    model: Annotated[str, Field(max_length=200)] = ""
    received: Day | None = None
    condition: Text = ""


class Method(Strict):
    """The laboratory's procedure, and deviations from it (7.8.2.1 f, n)."""

    procedure: Annotated[str, Field(max_length=400)] = ""
    deviations: Text = ""
    remarks: Text = ""


class LaboratoryFile(Strict):
    """The file: tables ``[laboratory]``, ``[customer]``, ``[signatory]``, ``[item]``, ``[method]``."""

    laboratory: Laboratory
    customer: Customer
    signatory: Signatory
    item: Item
    method: Method = Method()

    @model_validator(mode="after")
    def _no_claim(self) -> Self:
        if self.laboratory.accreditation is None:
            claims = [name for name, text in _texts(self.model_dump(mode="json")) if ACCREDITED.search(text)]
            if claims:
                raise ValueError(
                    f"{claims[0]}: speaks of accreditation, [laboratory.accreditation] with body and number is needed for that; "
                    "add it, or remove the words"
                )
        return self


def _texts(content: dict[str, Any], before: str = "") -> list[tuple[str, str]]:
    texts: list[tuple[str, str]] = []
    for name, value in content.items():
        if isinstance(value, dict):
            texts += _texts(value, f"{before}{name}.")
        elif isinstance(value, str):
            texts.append((before + name, value))
    return texts


def read_laboratory(path: Path) -> LaboratoryFile:
    """The laboratory's file.

    Raises
    ------
    RecipeInvalid, WrongUse
        It cannot be read, or a key is missing, unknown or wrong.
    """
    if not path.is_file():
        raise WrongUse(
            f"certificate: laboratory file {path} is not there, one with [laboratory], [customer], [signatory] and [item] is "
            "needed; see docs/how-to/issue-a-certificate.md"
        )
    try:
        return LaboratoryFile.model_validate(parse_toml(read_text(path, "laboratory"), f"laboratory {path}"))
    except ValidationError as problem:
        raise explain(problem, f"laboratory {path}", LaboratoryFile) from None
