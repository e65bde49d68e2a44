"""The statement of the references of an import, compared with its mapping before anything is read."""

from __future__ import annotations

from datetime import UTC, date, datetime
from pathlib import Path
from typing import Any

from schemas.errors import RecipeInvalid, WrongUse
from schemas.import_references import ImportReferences, read_references
from schemas.units import AXES

GRAVITY_SIGMAS = 3.0


def stated_references(path: Path, content: dict[str, Any]) -> ImportReferences:
    """The statement of a file; local gravity is taken from it into the mapping where that has none.

    Raises
    ------
    RecipeInvalid
        A key is wrong, or gravity contradicts --local-g.
    WrongUse
        The day of the measurement is not given, which is needed to check whether references were due; or the device has fewer
        axes than a budget.
    """
    axes = content.get("axes")
    if axes and len(axes) < len(AXES):
        raise WrongUse(
            f"import: --references states a budget of three axes, --axes has {', '.join(axes)} alone; leave --references out: "
            "the uncertainties are then those of the noise"
        )
    references = read_references(path)
    where = f"references {path.name}"
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
            f"{where}: key 'uncertainty.gravity': {gravity.value:.8g} m/s² ± {2e6 * u:.2g} ppm (k = 2), --local-g is "
            f"{float(given):.8g}, they differ by {1e6 * apart:.0f} ppm; leave --local-g out, or correct one of the two",
            key="uncertainty.gravity",
        )
    return references


def _refuse_day(day: str, where: str) -> None:
    if not day:
        raise WrongUse(
            f"{where}: the day of the measurement is not given, it decides which references were due; add --measured YYYY-MM-DD"
        )
    try:
        parsed = date.fromisoformat(day)
    except ValueError:
        return  # the check of the mapping reports it
    if parsed > datetime.now(tz=UTC).date():
        raise WrongUse(
            f"{where}: --measured {day} lies in the future, the day of the measurement is needed; correct it"
        )
