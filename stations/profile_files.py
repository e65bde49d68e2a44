"""The register-map profiles that come with the product, by name."""

from __future__ import annotations

from functools import cache
from importlib.resources import files

from schemas.errors import RecipeInvalid, did_you_mean
from schemas.profile import Profile, parse_profile


def profile_names() -> list[str]:
    """Names of the profiles, sorted."""
    folder = files("stations").joinpath("profiles")
    return sorted(item.name.removesuffix(".toml") for item in folder.iterdir() if item.name.endswith(".toml"))


@cache
def load_profile(name: str) -> Profile:
    """The profile of that name; an unknown one is refused with what looks like it."""
    if name not in profile_names():
        message = f"profile: no '{name}'; {did_you_mean(name, profile_names())}"
        raise RecipeInvalid(message, key="profile")
    source = f"stations/profiles/{name}.toml"
    return parse_profile(files("stations").joinpath("profiles", f"{name}.toml").read_text("utf-8"), source)
