"""Profiles of random vibration: breakpoints of the density, one file each in ``schemas/vibration``."""

from __future__ import annotations

from importlib.resources import files
from itertools import pairwise
from typing import Annotated

from pydantic import Field, ValidationError, field_validator

from schemas.bounds import Positive, Text
from schemas.errors import RecipeInvalid, close_matches, did_you_mean
from schemas.recipe import Strict
from schemas.toml_files import explain, parse_toml


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
    folder = files("schemas").joinpath("vibration")
    return sorted(item.name.removesuffix(".toml") for item in folder.iterdir() if item.name.endswith(".toml"))


def load_vibration_profile(name: str) -> VibrationProfile:
    """The built-in profile of this name; :class:`RecipeInvalid` names close ones."""
    if name not in vibration_profiles():
        known = vibration_profiles()
        raise RecipeInvalid(
            f"profile: no vibration profile '{name}'; {did_you_mean(name, known)}",
            key="profile",
            close=close_matches(name, known),
        )
    source = f"vibration/{name}.toml"
    text = files("schemas").joinpath("vibration", f"{name}.toml").read_text("utf-8")
    try:
        return VibrationProfile.model_validate(parse_toml(text, source))
    except ValidationError as problem:
        raise explain(problem, source, VibrationProfile) from None
