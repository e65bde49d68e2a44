"""Profiles of exposures to temperature, humidity and low pressure: legs of a cycle, one file each in ``schemas/exposure``."""

from typing import Annotated, Literal

from pydantic import Field, model_validator

from schemas.bounds import Celsius, Positive, Text, Wait
from schemas.built_in_profiles import built_in_profile, profile_names
from schemas.strict import Strict

FOLDER = "exposure"
AMBIENT_HPA = 1013.25
Level = Literal["low", "high", "rest"]
Percent = Annotated[float, Field(ge=5.0, le=98.0)]
Pressure = Annotated[float, Field(ge=10.0, le=1100.0)]


class ExposureLeg(Strict):
    """One leg of a cycle: the air goes to a temperature on a straight line and is held there.

    temperature : of the profile or the recipe, low or high; rest is the temperature of the test
    change_min : of the straight line; K_per_min is its rate instead. Neither: the chamber goes there at its own rate, and a
        measurement lasts as long as the recipe's soak.
    humidity_pct : relative; that of the room where it is left out
    low_pressure : whether the pressure is the profile's low one
    measured : whether the six poses are measured at its end
    """

    temperature: Level
    change_min: Positive | None = None
    K_per_min: Positive | None = None
    hold_min: Wait = 0.0
    humidity_pct: Percent | None = None
    low_pressure: bool = False
    measured: bool = False

    @property
    def by_unit(self) -> bool:
        """Whether a climate unit carries it out."""
        return self.change_min is not None or self.K_per_min is not None

    @model_validator(mode="after")
    def _one_rate(self) -> "ExposureLeg":
        if self.change_min is not None and self.K_per_min is not None:
            raise ValueError("change_min, K_per_min: both are stated, one is needed; leave the other out")
        if not self.by_unit and (self.humidity_pct is not None or self.low_pressure or self.hold_min > 0.0):
            raise ValueError(
                "change_min: missing, a leg with a humidity, a low pressure or a hold needs it, or K_per_min; add one"
            )
        return self


class ExposureProfile(Strict):
    """Legs of one cycle, the number of cycles, and the levels where a recipe states none; 60 min of recovery by default."""

    name: str
    description: Text
    source: Text
    cycles: Annotated[int, Field(ge=1, le=100)]
    low_C: Celsius | None = None
    high_C: Celsius | None = None
    pressure_hPa: Pressure | None = None
    recovery_min: Positive = 60.0
    legs: Annotated[list[ExposureLeg], Field(min_length=1, max_length=20)]

    @property
    def by_unit(self) -> bool:
        """Whether the profile needs a climate unit."""
        return any(leg.by_unit for leg in self.legs)

    @property
    def conditioned(self) -> bool:
        """Whether the profile sets more than temperatures."""
        return any(leg.humidity_pct is not None or leg.low_pressure for leg in self.legs)

    def levels(self) -> set[str]:
        """The keys of the levels that its legs have."""
        keys = {"low": "low_C", "high": "high_C"}
        used = {keys[leg.temperature] for leg in self.legs if leg.temperature in keys}
        return used | ({"pressure_hPa"} if any(leg.low_pressure for leg in self.legs) else set())


def exposure_profiles() -> list[str]:
    """Names of the built-in profiles, sorted."""
    return profile_names(FOLDER)


def load_exposure_profile(name: str) -> ExposureProfile:
    """The built-in profile of this name; :class:`schemas.errors.RecipeInvalid` names similar profiles."""
    return built_in_profile(FOLDER, name, ExposureProfile)
