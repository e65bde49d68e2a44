"""A reference standard of a station: what its calibrations are traced to, by which certificate, until when."""

from datetime import date as Day  # noqa: N812 - a field has its name
from typing import Annotated, ClassVar, Literal

from pydantic import BeforeValidator, Field, model_validator

from schemas.bounds import Number, Positive, Text
from schemas.stated import SYMBOLS
from schemas.strict import Grown
from schemas.uncertainty import TO_SI

_OF_SYMBOL = {symbol.replace("µ", micro): unit for unit, symbol in SYMBOLS.items() for micro in "µμ"}

Unit = Annotated[
    Literal["urad", "arcsec", "deg", "ppm", "percent", "ug", "K", "s", "g", "m_s2"],
    BeforeValidator(lambda unit: _OF_SYMBOL.get(unit, unit) if isinstance(unit, str) else unit),
]
"""Also by its symbol, as a certificate has it: µrad, ″, °, %, µg, m/s²."""


class Reference(Grown):
    """A standard with a certificate of its own.

    Parameters
    ----------
    id : the standard's own number.
    what : what it stands for: local gravity, angle, temperature, frequency, …
    certificate : number of its certificate.
    laboratory, accreditation : who gave it, and the number of their accreditation.
    date, due : day of the certificate, and the first day on which it has to be calibrated again.
    U, k, unit : its expanded uncertainty; drift_per_year : in the same unit.
    sha256 : of the certificate's file.
    """

    later: ClassVar[frozenset[str]] = frozenset({"accreditation", "date", "U", "k", "unit", "drift_per_year", "sha256"})

    id: Annotated[str, Field(min_length=1)]
    what: str = ""
    certificate: Annotated[str, Field(min_length=1)]
    laboratory: str = ""
    accreditation: Text = ""
    date: Day | None = None
    due: Day
    U: Positive | None = None
    k: Annotated[Number, Field(ge=1.0, le=4.0)] | None = None
    unit: Unit | None = None
    drift_per_year: Number | None = None
    sha256: Annotated[str, Field(pattern=r"^([0-9a-f]{64})?$")] = ""

    @model_validator(mode="after")
    def _complete(self) -> "Reference":
        if self.U is not None and (self.k is None or self.unit is None):
            raise ValueError("k, unit: needed beside U; add the coverage factor and the unit of the certificate")
        return self

    def standard(self, unit: str) -> float | None:
        """Standard uncertainty in rad, K, … where the certificate's unit can be converted to it; else None."""
        if self.U is None or self.k is None or self.unit is None or not unit:
            return None
        kinds = ({"urad", "arcsec", "deg"}, {"ppm", "percent"}, {"ug", "g"})
        same = self.unit == unit or any({self.unit, unit} <= kind for kind in kinds)
        return self.U / self.k * TO_SI[self.unit] if same else None
