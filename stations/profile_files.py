"""The device profiles by name: those of the product, and those of the user (:mod:`schemas.own_files`)."""

from functools import cache
from importlib.resources import files
from importlib.resources.abc import Traversable

from schemas.errors import RecipeInvalid, did_you_mean
from schemas.own_files import own_file, own_files
from schemas.profile import Profile, WordOrder
from schemas.station_devices import Carried
from schemas.toml_files import parse_as, read_text


def profile_folder() -> Traversable:
    """The folder of the profiles."""
    return files("stations").joinpath("profiles")


def profile_names() -> list[str]:
    """Names of the profiles, sorted."""
    return sorted({*built_in_profiles(), *own_files("profiles")})


def profile_of(device: Carried) -> Profile:
    """The profile of a device of a station, with the word order that it is set to and the station's own largest values."""
    profile = load_profile(device.profile).limited(getattr(device, "maximum", {}))
    return profile if device.word_order is None else in_order(profile, device.word_order)


def in_order(profile: Profile, order: WordOrder) -> Profile:
    """A profile with a word order for all its registers."""
    registers = [register.model_copy(update={"word_order": None}) for register in profile.registers]
    return profile.model_copy(update={"word_order": order, "registers": registers})


def recorded_columns(reader: Carried) -> list[str]:
    """Additional columns that the reader of a station records with every dwell."""
    return [register.column for register in profile_of(reader).registers if register.column]


def load_profile(name: str) -> Profile:
    """The profile with a name; an unknown name is refused with the most similar names."""
    path = own_file("profiles", name, built_in_profiles())
    return _parsed(profile_text(name), f"stations/profiles/{name}.toml" if path is None else str(path))


def profile_text(name: str) -> str:
    """The file of the profile with a name; an unknown name is refused with the most similar names."""
    path = own_file("profiles", name, built_in_profiles())
    if path is not None:
        return read_text(path, "profile")
    if name not in built_in_profiles():
        raise RecipeInvalid(f"profile: no '{name}'; {did_you_mean(name, profile_names())}", key="profile")
    return profile_folder().joinpath(f"{name}.toml").read_text("utf-8")


def built_in_profiles() -> list[str]:
    """Names of the profiles of the product."""
    return [item.name.removesuffix(".toml") for item in profile_folder().iterdir() if item.name.endswith(".toml")]


@cache
def _parsed(text: str, source: str) -> Profile:
    return parse_as(Profile, text, source)
