"""A statement of the references of imported measurements: the file of ``import --references FILE``.

The tables ``[[reference]]`` and ``[uncertainty]`` are those of a station's file, ``[stability]`` and ``[certificate]`` those of a
recipe; the whole is kept with the import, and a run that is made from it states no more.
"""

from datetime import UTC, date, datetime
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field, model_validator

from schemas.bounds import Celsius, Text
from schemas.errors import RecipeInvalid, WrongUse
from schemas.reference import Reference
from schemas.station import refuse_untraced
from schemas.strict import Strict
from schemas.toml_files import parse_as, read_text
from schemas.uncertainty import Uncertainty
from schemas.units import AXES
from schemas.validity import CertificateTerms, Stability

GRAVITY_SIGMAS = 3.0


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
        """The statements in the form of a captured run's station."""
        return {
            "name": self.name,
            "kind": "imported",
            "description": self.description,
            "pace": {"room_C": self.room_C},
            "reference": [reference.model_dump(mode="json") for reference in self.reference],
            "uncertainty": self.uncertainty.model_dump(mode="json"),
        }

    def recipe(self) -> dict[str, Any]:
        """The statements as keys of a captured run's recipe."""
        parts = {"stability": self.stability, "certificate": self.certificate}
        return {name: part.model_dump(mode="json") for name, part in parts.items() if part is not None}


def stated_references(path: Path, content: dict[str, Any]) -> ImportReferences:
    """The statement of a file, compared with the mapping; local gravity is taken from it into the mapping where that has none.

    Raises
    ------
    RecipeInvalid
        A key is wrong, or gravity contradicts local_gravity_m_s2.
    WrongUse
        The day of the measurement is not given, which is needed to check whether references were due; or the device has fewer
        axes than a budget.
    """
    axes = content.get("axes")
    if axes and len(axes) < len(AXES):
        raise WrongUse(
            f"import: --references states a budget of three axes, axes are {', '.join(axes)} alone; leave --references out: "
            "the uncertainties are then those of the noise"
        )
    where = f"references {path.name}"
    references = parse_as(ImportReferences, read_text(path, "references"), where)
    _refuse_day(str(content.get("measured", "")), where)
    gravity = references.uncertainty.gravity
    if gravity is None:
        raise RecipeInvalid(
            f"{where}: key 'uncertainty.gravity' is missing, local gravity and its uncertainty rule the scale of every import; "
            "state it as surveyed, or latitude_deg and height_m with source = 'formula'",
            key="uncertainty.gravity",
        )
    given = content.setdefault("local_gravity_m_s2", gravity.value)
    apart = float(given) / gravity.value - 1.0
    u = gravity.relative().u
    if not abs(apart) <= GRAVITY_SIGMAS * u:
        raise RecipeInvalid(
            f"{where}: key 'uncertainty.gravity': {gravity.value:.8g} m/s² ± {2e6 * u:.2g} ppm (k = 2), local_gravity_m_s2 is "
            f"{float(given):.8g}, they differ by {1e6 * apart:.0f} ppm; leave local_gravity_m_s2 out, or correct one of the two",
            key="uncertainty.gravity",
        )
    return references


def _refuse_day(day: str, where: str) -> None:
    if not day:
        raise WrongUse(
            f"{where}: the day of the measurement is not given, it decides which references were due; add "
            "--set measured=YYYY-MM-DD"
        )
    try:
        parsed = date.fromisoformat(day)
    except ValueError:
        return  # the check of the mapping reports it
    if parsed > datetime.now(tz=UTC).date():
        raise WrongUse(f"{where}: measured {day} lies in the future, the day of the measurement is needed; correct it")
