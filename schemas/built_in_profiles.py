"""Profiles of tests that come with the product: one TOML file each in a folder of this package."""

from importlib.resources import files
from typing import TypeVar

from schemas.errors import RecipeInvalid, close_matches, did_you_mean
from schemas.strict import Strict
from schemas.toml_files import parse_as

Profile = TypeVar("Profile", bound=Strict)


def profile_names(folder: str) -> list[str]:
    """Names of the profiles in a folder, sorted."""
    entries = files("schemas").joinpath(folder).iterdir()
    return sorted(item.name.removesuffix(".toml") for item in entries if item.name.endswith(".toml"))


def built_in_profile(folder: str, name: str, kind: type[Profile]) -> Profile:
    """The profile of this name in a folder; :class:`RecipeInvalid` names similar profiles."""
    known = profile_names(folder)
    if name not in known:
        raise RecipeInvalid(
            f"profile: no {folder} profile '{name}'; {did_you_mean(name, known)}",
            key="profile",
            close=close_matches(name, known),
        )
    text = files("schemas").joinpath(folder, f"{name}.toml").read_text("utf-8")
    return parse_as(kind, text, f"{folder}/{name}.toml")
