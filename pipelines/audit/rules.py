"""The audit's rules: intervals, tolerances, check standards; complete values in the file ``default.toml`` of this package."""

import tomllib
from fnmatch import fnmatchcase
from importlib.resources import files
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Field, FiniteFloat, ValidationError, model_validator

from pipelines.audit.parameters import FAMILIES
from schemas.errors import did_you_mean
from schemas.recipe import Strict
from schemas.toml_files import explain, parse_toml, read_text

Positive = Annotated[FiniteFloat, Field(gt=0.0)]
Months = Annotated[int, Field(ge=1, le=120)]


class Tolerance(Strict):
    """Allowed change of a parameter from its certified value, in the parameter's unit, which the file repeats."""

    max: Positive
    unit: str


def _checked(tolerances: dict[str, Tolerance]) -> dict[str, Tolerance]:
    for name, tolerance in tolerances.items():
        if name not in FAMILIES or not FAMILIES[name].of_unit:
            families = [family for family, content in FAMILIES.items() if content.of_unit]
            raise ValueError(f"unknown parameter '{name}'; {did_you_mean(name, families)}")
        if tolerance.unit != FAMILIES[name].unit:
            raise ValueError(
                f"tolerance.{name}: found {tolerance.unit}, the parameter is in {FAMILIES[name].unit}; give it in that"
            )
    return tolerances


Tolerances = Annotated[dict[str, Tolerance], AfterValidator(_checked)]


class DeviceRules(Strict):
    """Rules for one kind of device."""

    interval_months: Months | None = None
    tolerance: Tolerances = Field(default_factory=dict[str, Tolerance])


class Rules(Strict):
    """The rules file."""

    interval: Literal["fixed", "drift"]
    reliability_target: Annotated[FiniteFloat, Field(gt=0.5, lt=1.0)]
    interval_months: Months
    shortest_months: Months
    longest_months: Months
    notice_days: Annotated[int, Field(ge=0, le=3660)]
    check_standards: list[str]
    baseline_points: Annotated[int, Field(ge=8, le=1_000_000)]
    gauge_days: Positive
    ppk_least: Positive
    gauge_most_percent: Positive
    tolerance: Tolerances
    device: dict[str, DeviceRules] = Field(default_factory=dict[str, DeviceRules])

    @model_validator(mode="after")
    def _ordered(self) -> "Rules":
        if self.shortest_months > self.longest_months:
            raise ValueError(
                f"shortest_months: {self.shortest_months} is above longest_months ({self.longest_months}); exchange them"
            )
        return self

    def months(self, device: str) -> int:
        """The fixed interval of a kind of device."""
        of_kind = self._kind(device).interval_months
        return of_kind if of_kind is not None else self.interval_months

    def tolerance_of(self, device: str, family: str) -> float:
        """The tolerance of a family of parameters of a kind of device; infinite without one."""
        entry = self._kind(device).tolerance.get(family) or self.tolerance.get(family)
        return entry.max if entry is not None else float("inf")

    def is_standard(self, serial: str) -> bool:
        """Whether a unit is a check standard of the stations."""
        return any(fnmatchcase(serial, pattern) for pattern in self.check_standards)

    def _kind(self, device: str) -> DeviceRules:
        return next((kind for name, kind in self.device.items() if name.upper() == device.upper()), DeviceRules())


def load_rules(path: Path | None = None) -> Rules:
    """The built-in rules, with the changes of a file."""
    content = tomllib.loads((files("pipelines.audit") / "default.toml").read_text(encoding="utf-8"))
    if path is None:
        return Rules.model_validate(content)
    changes = parse_toml(read_text(path, "rules"), f"rules {path.name}")
    try:
        return Rules.model_validate(_over(content, changes))
    except ValidationError as problem:
        raise explain(problem, f"rules {path.name}", Rules) from None


def _over(content: dict[str, Any], changes: dict[str, Any]) -> dict[str, Any]:
    """Tables merged key by key; later values replace earlier ones."""
    out = dict(content)
    for key, value in changes.items():
        tables = isinstance(value, dict) and isinstance(out.get(key), dict) and set(value) != {"max", "unit"}
        out[key] = _over(out[key], value) if tables else value
    return out
