"""Profiles of random vibration: breakpoints of the density, one file each in ``schemas/vibration``."""

from itertools import pairwise
from typing import Annotated

from pydantic import Field, field_validator

from schemas.bounds import Positive, Text
from schemas.built_in_profiles import built_in_profile, profile_names
from schemas.strict import Strict


class VibrationProfile(Strict):
    """A density in g²/Hz over frequency in Hz, straight on log–log paper between its breakpoints."""

    name: str
    description: Text = ""
    source: Text
    breakpoints: Annotated[list[tuple[Positive, Positive]], Field(min_length=2, max_length=200)]

    @field_validator("breakpoints")
    @classmethod
    def _in_order(cls, points: list[tuple[float, float]]) -> list[tuple[float, float]]:
        for (first, _), (second, _) in pairwise(points):
            if second <= first:
                raise ValueError(
                    f"breakpoints: {second:g} Hz follows {first:g} Hz, rising frequencies are needed; order them"
                )
        return points


def vibration_profiles() -> list[str]:
    """Names of the built-in profiles, sorted."""
    return profile_names("vibration")


def load_vibration_profile(name: str) -> VibrationProfile:
    """The built-in profile of this name; :class:`schemas.errors.RecipeInvalid` names similar profiles."""
    return built_in_profile("vibration", name, VibrationProfile)
