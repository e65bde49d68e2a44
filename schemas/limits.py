"""Limits of a product's figures, the decision rule that applies them, and the grades.

The rule is agreed before anything is measured (ISO/IEC 17025:2017, 7.1.3) and is named in every decision. With
``guarded_acceptance`` the guard band is the expanded uncertainty, w = U (ILAC-G8:09/2019, 4.2.2 and 4.2.3), and there
are four outcomes; with ``simple_acceptance`` (4.2.1) the limit itself decides.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import (
    Field,
    SerializerFunctionWrapHandler,
    ValidationError,
    ValidationInfo,
    field_validator,
    model_serializer,
    model_validator,
)

from schemas.bounds import Name, Number, Positive
from schemas.errors import RecipeInvalid, close_matches, did_you_mean
from schemas.recipe import Strict, explain, parse_toml

if TYPE_CHECKING:
    from collections.abc import Mapping

VALIDITY_MONTHS = 12
"""Longest that a certificate may hold where the limits file does not say: a year, the usual first interval (ILAC-G24:2022)."""
MOST_MONTHS = 120

Rule = Literal["guarded_acceptance", "simple_acceptance"]
Outcome = Literal["pass", "conditional pass", "conditional fail", "fail"]

# The notes give the grades by the bias that is left: consumer to 1000 µg, industrial to 200 µg, navigation under 50 µg.
GRADES: Mapping[str, float] = {
    "navigation": 50.0,
    "industrial": 200.0,
    "consumer": 1000.0,
}
GRADE_FIGURE = "bias_error_ug"


class Limit(Strict):
    """The largest magnitude of a figure that a unit may have, in the figure's unit, which the file states again."""

    max: Positive
    unit: str


class Limits(Strict):
    """The limits file: name, rule, coverage factor and a limit per figure.

    Parameters
    ----------
    validity_months : longest that a certificate by these limits may hold; :data:`VALIDITY_MONTHS` where it is not stated.
    """

    name: Name
    rule: Rule = "guarded_acceptance"
    coverage_factor: Annotated[Number, Field(ge=1.0, le=4.0)] = 2.0
    grade: Literal["navigation", "industrial", "consumer"] = "consumer"
    validity_months: Annotated[int, Field(strict=True, ge=1, le=MOST_MONTHS)] | None = None
    figures: Annotated[dict[str, Limit], Field(min_length=1)]

    @property
    def longest_validity_months(self) -> int:
        """Longest that a certificate by these limits may hold, months: as the file says, else the product's policy."""
        return VALIDITY_MONTHS if self.validity_months is None else self.validity_months

    @model_serializer(mode="wrap")
    def _as_before(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """Without what is not stated: runs are named for their limits, and those of earlier versions keep their names."""
        content = handler(self)
        return {name: value for name, value in content.items() if name != "validity_months" or value is not None}

    @field_validator("figures")
    @classmethod
    def _known(cls, figures: dict[str, Limit], info: ValidationInfo) -> dict[str, Limit]:
        units = _units(info)
        for name in figures:
            if name not in units:
                raise ValueError(f"unknown figure '{name}'; {did_you_mean(name, units)}")
        return figures

    @model_validator(mode="after")
    def _units_agree(self, info: ValidationInfo) -> Limits:
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


@dataclass(frozen=True)
class Decision:
    """What a rule says of one figure of one unit."""

    figure: str
    value: float
    uncertainty: float
    limit: float
    unit: str
    rule: str
    outcome: Outcome

    @property
    def passed(self) -> bool:
        """Whether the unit may be delivered: a conditional pass may not, under a guarded rule."""
        return self.outcome == "pass"

    @property
    def margin(self) -> float:
        """Limit minus magnitude, in the figure's unit: negative where the limit is broken."""
        return self.limit - abs(self.value)

    @property
    def sentence(self) -> str:
        """The decision for people: figure, value, uncertainty, limit and margin."""
        unit = "" if self.unit == "1" else f" {self.unit}"
        spread = f" ± {self.uncertainty:.2g}" if self.uncertainty > 0.0 else ""
        within = ", less than U: measure longer, or again" if self.outcome.startswith("conditional") else ""
        return (
            f"{self.figure} {self.outcome}: {self.value:.4g}{spread}{unit}, "
            f"limit {self.limit:.4g}{unit}, margin {self.margin:.3g}{unit}{within}"
        )


def decide(limits: Limits, figure: str, value: float, standard_uncertainty: float) -> Decision:
    """The decision on a figure by the limits' rule.

    Parameters
    ----------
    figure : a key of ``limits.figures``.
    value, standard_uncertainty : in the figure's unit; the rule's coverage factor is applied here.
    """
    expanded = limits.coverage_factor * standard_uncertainty
    limit = limits.figures[figure].max
    return Decision(
        figure=figure,
        value=value,
        uncertainty=expanded,
        limit=limit,
        unit=limits.figures[figure].unit,
        rule=describe_rule(limits),
        outcome=_outcome(limits.rule, abs(value), limit, expanded),
    )


def _outcome(rule: Rule, magnitude: float, limit: float, expanded: float) -> Outcome:
    guard = expanded if rule == "guarded_acceptance" else 0.0
    if magnitude <= limit - guard:
        return "pass"
    if magnitude > limit + guard:
        return "fail"
    return "conditional pass" if magnitude <= limit else "conditional fail"


def describe_rule(limits: Limits) -> str:
    """The decision rule in the words that stand beside every result."""
    if limits.rule == "simple_acceptance":
        return f"ILAC-G8:09/2019 simple acceptance, U with k = {limits.coverage_factor:g}"
    return f"ILAC-G8:09/2019 guarded acceptance, w = U with k = {limits.coverage_factor:g}"


def grade_of(value_ug: float, expanded_ug: float, rule: Rule) -> str | None:
    """The best grade whose bias limit accepts the value under the rule; None where not even the lowest does."""
    for name, limit in GRADES.items():
        if _outcome(rule, abs(value_ug), limit, expanded_ug) == "pass":
            return name
    return None


def limits_of(document: Mapping[str, Any], units: Mapping[str, str]) -> Limits:
    """The limits of a document that was checked when it was archived.

    Parameters
    ----------
    units : unit of every known figure, by name.
    """
    return Limits.model_validate(document, context=units)


def parse_limits(text: str, source: str, units: Mapping[str, str]) -> Limits:
    """The limits of a file, or :class:`RecipeInvalid` naming the key and what is needed.

    Parameters
    ----------
    units : unit of every known figure, by name.
    """
    try:
        return limits_of(parse_toml(text, source), units)
    except ValidationError as problem:
        raise explain(problem, source, Limits) from None


def unknown_limits(name: str, known: list[str]) -> RecipeInvalid:
    """The error for a name that is neither a file nor one of the built-in limits."""
    message = f"recipe: key 'limits': no file and no built-in limits are called '{name}'; {did_you_mean(name, known)}"
    return RecipeInvalid(message, key="limits", close=close_matches(name, known))
