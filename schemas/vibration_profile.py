"""Profiles of random vibration: breakpoints of the density, one file each in ``schemas/vibration``."""

from importlib.resources import files
from itertools import pairwise
from typing import Annotated

from pydantic import Field, field_validator

from schemas.bounds import Positive, Text
from schemas.errors import RecipeInvalid, close_matches, did_you_mean
from schemas.strict import Strict
from schemas.toml_files import parse_as


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
    known = vibration_profiles()
    if name not in known:
        raise RecipeInvalid(
            f"profile: no vibration profile '{name}'; {did_you_mean(name, known)}",
            key="profile",
            close=close_matches(name, known),
        )
    text = files("schemas").joinpath("vibration", f"{name}.toml").read_text("utf-8")
    return parse_as(VibrationProfile, text, f"vibration/{name}.toml")
