"""A statement of the references of imported measurements: the file of ``import --references FILE``.

The tables ``[[reference]]`` and ``[uncertainty]`` are those of a station's file, ``[stability]`` and ``[certificate]`` those of a
recipe; the whole is kept with the import, and a run that is made from it states no more.
"""

from pathlib import Path
from typing import Annotated, Any

from pydantic import Field, model_validator

from schemas.bounds import Celsius, Text
from schemas.reference import Reference
from schemas.station import refuse_untraced
from schemas.strict import Strict
from schemas.toml_files import parse_as, read_text
from schemas.uncertainty import Uncertainty
from schemas.validity import CertificateTerms, Stability


class ImportReferences(Strict):
    """The references of an import.

    name : of the laboratory or station that measured, as certificates print it
    room_C : temperature there, where no column has one
    """

    name: Annotated[str, Field(min_length=1, max_length=64)]
    description: Text = ""
    room_C: Celsius = 23.0
    reference: list[Reference] = Field(default_factory=list)
    uncertainty: Uncertainty
    stability: Stability | None = None
    certificate: CertificateTerms | None = None

    @model_validator(mode="after")
    def _traced(self) -> "ImportReferences":
        refuse_untraced(self.uncertainty, self.reference, simulated=False)
        return self

    def station(self) -> dict[str, Any]:
        """As the station of a run that was captured."""
        return {
            "name": self.name,
            "kind": "imported",
            "description": self.description,
            "pace": {"room_C": self.room_C},
            "reference": [one.model_dump(mode="json") for one in self.reference],
            "uncertainty": self.uncertainty.model_dump(mode="json"),
        }

    def recipe(self) -> dict[str, Any]:
        """As the keys of the recipe of a run that was captured."""
        parts = {"stability": self.stability, "certificate": self.certificate}
        return {name: part.model_dump(mode="json") for name, part in parts.items() if part is not None}


def read_references(path: Path) -> ImportReferences:
    """The statement of a file.

    Raises
    ------
    RecipeInvalid
        Unreadable, or a key is wrong; the key is named.
    """
    return parse_as(ImportReferences, read_text(path, "references"), f"references {path.name}")
