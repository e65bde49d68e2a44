"""Limits of a product's figures, the decision rule that applies them, and the grades.

The rule is agreed before anything is measured (ISO/IEC 17025:2017, 7.1.3) and is named in every decision. With
``guarded_acceptance`` the guard band is the expanded uncertainty, w = U (ILAC-G8:09/2019, 4.2.2 and 4.2.3), and there
are four outcomes; with ``simple_acceptance`` (4.2.1) the limit itself decides; with ``allowed_pfa`` the guard band is as wide as
an allowed probability of false acceptance needs (JCGM 106:2012, 8.3.3).
"""

from collections.abc import Mapping
from statistics import NormalDist
from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field, ValidationInfo, field_validator, model_validator

from schemas.bounds import Name, Number, Positive
from schemas.errors import RecipeInvalid, close_matches, did_you_mean
from schemas.strict import Grown
from schemas.toml_files import parse_as

VALIDITY_MONTHS = 12
"""Longest that a certificate may hold where the limits file does not say: a year, the usual first interval (ILAC-G24:2022)."""
MOST_MONTHS = 120

Rule = Literal["guarded_acceptance", "simple_acceptance", "allowed_pfa"]
LARGEST_PFA = 0.02
"""Largest probability of false acceptance of one decision that limits may allow."""
ADEQUACY_P_MIN = 0.001
"""Least p of a model that is certified where the limits file does not say. At the 5 % of the verdict one good lot in twenty would
be refused, at this one in a thousand; a smaller p is a score and no probability."""


class Limit(Grown):
    """The largest magnitude of a figure that a unit may have, or its least value; the file states the unit again."""

    later: ClassVar[frozenset[str]] = frozenset({"max", "min"})

    max: Positive | None = None
    min: Positive | None = None
    unit: str

    @model_validator(mode="after")
    def _one_side(self) -> "Limit":
        if (self.max is None) == (self.min is None):
            given = "neither" if self.max is None else "both"
            raise ValueError(f"max, min: {given} given, one of them is needed; state max, or min for a least value")
        return self

    @property
    def text(self) -> str:
        """The limit for people, without its unit."""
        return f"at least {self.min:.10g}" if self.min is not None else f"{self.max:.10g}"


class Limits(Grown):
    """The limits file: name, rule, coverage factor and a limit per figure.

    Parameters
    ----------
    grade : least grade that a unit needs; ``none``: the limits of the figures alone decide.
    validity_months : longest that a certificate by these limits may hold; :data:`VALIDITY_MONTHS` where it is not stated.
    pfa_max : probability of false acceptance that the rule ``allowed_pfa`` allows; 2 % where it is not stated.
    adequacy_p_min : least p of the model's residual with which a run is certified; :data:`ADEQUACY_P_MIN` where it is not stated.
    """

    later: ClassVar[frozenset[str]] = frozenset({"validity_months", "pfa_max", "adequacy_p_min"})

    name: Name
    rule: Rule = "guarded_acceptance"
    coverage_factor: Annotated[Number, Field(ge=1.0, le=4.0)] = 2.0
    grade: Literal["navigation", "industrial", "consumer", "none"] = "consumer"
    validity_months: Annotated[int, Field(strict=True, ge=1, le=MOST_MONTHS)] | None = None
    pfa_max: Annotated[Number, Field(gt=0.0, le=LARGEST_PFA)] | None = None
    adequacy_p_min: Annotated[Number, Field(ge=ADEQUACY_P_MIN, le=0.05)] | None = None
    figures: Annotated[dict[str, Limit], Field(min_length=1)]

    @property
    def guard_factor(self) -> float:
        """Guard band of the rule over standard uncertainty."""
        if self.rule == "allowed_pfa":
            return -NormalDist().inv_cdf(self.pfa_max or LARGEST_PFA)
        return self.coverage_factor if self.rule == "guarded_acceptance" else 0.0

    @property
    def longest_validity_months(self) -> int:
        """Longest that a certificate by these limits may hold, months: as the file says, else the product's policy."""
        return VALIDITY_MONTHS if self.validity_months is None else self.validity_months

    @field_validator("figures")
    @classmethod
    def _known(cls, figures: dict[str, Limit], info: ValidationInfo) -> dict[str, Limit]:
        units = _units(info)
        for name in figures:
            if name not in units:
                raise ValueError(f"unknown figure '{name}'; {did_you_mean(name, units)}")
        return figures

    @model_validator(mode="after")
    def _units_agree(self, info: ValidationInfo) -> "Limits":
        units = _units(info)
        for name, limit in self.figures.items():
            if limit.unit != units[name]:
                raise ValueError(
                    f"figures.{name}: the limit is in {limit.unit}, the figure is in {units[name]}; "
                    f"give the limit in {units[name]}"
                )
        return self


def _units(info: ValidationInfo) -> Mapping[str, str]:
    """The known figures with their units, which the caller hands in: this room does not compute figures."""
    if info.context is None:
        raise TypeError("limits are checked against the known figures; make them by limits_of or parse_limits")
    return info.context


def limits_of(document: Mapping[str, Any], units: Mapping[str, str]) -> Limits:
    """The limits of a document that was checked when it was archived; ``units``: of every known figure, by name."""
    return Limits.model_validate(document, context=units)


def parse_limits(text: str, source: str, units: Mapping[str, str]) -> Limits:
    """The limits of a file, or :class:`RecipeInvalid` naming the key and what is needed; ``units``: of every known figure."""
    limits = parse_as(Limits, text, source, context=units)
    if limits.pfa_max is not None and limits.rule != "allowed_pfa":  # archived limits are read with it
        found = (
            f"{source}: key 'pfa_max': found {limits.pfa_max:g} beside rule = '{limits.rule}', which does not use it"
        )
        raise RecipeInvalid(f"{found}; write rule = 'allowed_pfa', or delete pfa_max", key="pfa_max")
    return limits


def unknown_limits(name: str, known: list[str]) -> RecipeInvalid:
    """The error for a name that is neither a file nor one of the built-in limits."""
    message = f"recipe: key 'limits': no file and no built-in limits are called '{name}'; {did_you_mean(name, known)}"
    return RecipeInvalid(message, key="limits", close=close_matches(name, known))
