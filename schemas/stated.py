"""A stated standard uncertainty: u, or U with its k, or a half-width with its distribution; the unit stands in the key."""

import math
import re
from typing import Annotated, Any, ClassVar, Literal, NamedTuple

from pydantic import Field, model_validator

from schemas.bounds import NotNegative, Number, Positive, Text
from schemas.strict import OnlyStated

Scope = Literal["station", "run", "soak", "pose", "slot", "mount", "unit", "dwell"]
Distribution = Literal["normal", "rectangular", "triangular", "arcsine"]
DIVISORS = {"normal": 1.0, "rectangular": math.sqrt(3.0), "triangular": math.sqrt(6.0), "arcsine": math.sqrt(2.0)}
TO_SI = {
    "urad": 1e-6, "arcsec": math.pi / 648000.0, "deg": math.pi / 180.0, "ppm": 1e-6, "percent": 1e-2, "ug": 1e-6, "K": 1.0,
    "s": 1.0, "g": 1.0, "m_s2": 1.0,
}  # fmt: skip
"""Factors to rad, 1, g, K and s."""
SYMBOLS = {
    "urad": "µrad", "arcsec": "″", "deg": "°", "ppm": "ppm", "percent": "%", "ug": "µg", "K": "K", "s": "s", "g": "g",
    "m_s2": "m/s²",
}  # fmt: skip
"""Of the units in names of keys."""
SHARED_SCOPES = ("station", "run", "slot", "mount")
STATED = re.compile(r"^(?:(?P<part>[a-z]+)_)?(?P<form>u|U|half_width)_(?P<unit>[A-Za-z0-9_]+)$")


class StandardUncertainty(NamedTuple):
    """A standard uncertainty in rad, g, K, s or relative, and how it was stated.

    unit : of the entry's key; stated : the value there; divisor : k, or that of the distribution
    """

    u: float
    unit: str
    stated: float
    distribution: str
    divisor: float


class Entry(OnlyStated):
    """One entry of the budget.

    rectangular : key of a half-width whose distribution is rectangular unless another distribution is stated; empty for none
    exact : what the entry does not state, or states as 0, is exactly 0; without this word a 0 counts as not stated
    """

    rectangular: ClassVar[str] = ""

    k: Annotated[Number, Field(ge=1.0, le=4.0)] | None = None
    dof: Positive | None = None
    distribution: Distribution | None = None
    scope: Scope = "station"
    reference: Text = ""
    source: str = ""
    exact: bool = False

    def standard(self, part: str = "") -> StandardUncertainty:
        """The standard uncertainty of a part of the entry; 0 where the entry is exact or the part is not stated."""
        for name, name_of_part, form, unit in _forms(self):
            if name_of_part == part:
                return self._converted(form, unit, float(getattr(self, name)))
        return StandardUncertainty(0.0, "", 0.0, "normal", 1.0)

    def states(self, part: str = "") -> bool:
        """Whether a part of the entry has an uncertainty, or is said to be exact."""
        return self.exact or self.standard(part).u > 0.0

    def _converted(self, form: str, unit: str, value: float) -> StandardUncertainty:
        if form == "U":
            divisor, kind = float(self.k or 1.0), "normal"
        elif form == "half_width":
            kind = self.distribution or "rectangular"
            divisor = DIVISORS[kind]
        else:
            divisor, kind = 1.0, self.distribution or "normal"
        return StandardUncertainty(value * TO_SI[unit] / divisor, unit, value, kind, divisor)

    @model_validator(mode="before")
    @classmethod
    def _assume_rectangular(cls, given: Any) -> Any:
        if isinstance(given, dict) and cls.rectangular in given and "distribution" not in given:
            return {**given, "distribution": "rectangular"}
        return given

    @model_validator(mode="after")
    def _stated_once(self) -> "Entry":
        given = _forms(self)
        parts, forms = [part for _, part, _, _ in given], {form for _, _, form, _ in given}
        twice = sorted({part for part in parts if parts.count(part) > 1})
        if twice:
            both = ", ".join(name for name, part, _, _ in given if part == twice[0])
            raise ValueError(f"{both}: the same uncertainty stated twice, one is needed; leave one out")
        if "U" in forms and self.k is None:
            raise ValueError("k: missing beside an expanded uncertainty U; add the coverage factor of its certificate")
        if "half_width" in forms and self.distribution is None:
            raise ValueError("distribution: missing beside a half_width; add rectangular, triangular or arcsine")
        if self.exact and "" in parts:
            raise ValueError("exact: true beside an uncertainty; leave one of the two out")
        if not self.exact and not given and self._needs_value:
            raise ValueError("no uncertainty is stated; add u_…, U_… with k, or half_width_… with distribution")
        positive = any(getattr(self, name) > 0.0 for name, *_ in given)
        if positive and self.scope in SHARED_SCOPES and not (self.reference or self.origin):
            raise ValueError("reference: missing; name the reference standard by its id, or give a source")
        return self

    @property
    def _needs_value(self) -> bool:
        return True

    @property
    def origin(self) -> str:
        """Origin of a figure that comes from no reference standard."""
        return self.source


def _forms(entry: Entry) -> list[tuple[str, str, str, str]]:
    """(key, part, form, unit) of the uncertainties that an entry states."""
    matches = (STATED.match(name) for name in type(entry).model_fields)
    stated = ((m[0], m["part"] or "", m["form"], m["unit"]) for m in matches if m and m["unit"] in TO_SI)
    return [form for form in stated if getattr(entry, form[0]) is not None]


Stated = NotNegative | None


class RelativeEntry(Entry):
    """A share of the quantity: gravity, supply."""

    u_ppm: Stated = None
    U_ppm: Stated = None
    half_width_ppm: Stated = None


class AngleEntry(Entry):
    """An angle: level, orthogonality, encoder offset, harmonic, pose, seat."""

    u_urad: Stated = None
    U_urad: Stated = None
    half_width_urad: Stated = None
    u_arcsec: Stated = None
    U_arcsec: Stated = None
    half_width_arcsec: Stated = None
    u_deg: Stated = None
    U_deg: Stated = None
    half_width_deg: Stated = None
