"""The simulated controllers by the family in the profile; each module in ``families`` has the function ``simulated``."""

from __future__ import annotations

import pkgutil
from importlib import import_module
from typing import Any

from schemas.profile import Profile
from stations.plant import families
from stations.plant.bank import Bank
from stations.plant.line_device import LineDevice
from stations.plant.table import Axis
from stations.plant.world import World


def family_names() -> list[str]:
    """Names of the simulated families, sorted."""
    return sorted(module.name for module in pkgutil.iter_modules(families.__path__))


def axis_bank(world: World, axis: Axis, profile: Profile) -> Bank:
    """The registers of the drive with a profile."""
    return _module(profile).simulated(world, axis, profile)


def chamber_bank(world: World, profile: Profile) -> Bank:
    """The registers of the chamber controller with a profile."""
    return _module(profile).simulated(world, profile)


def chamber_line_device(world: World, profile: Profile) -> LineDevice:
    """The chamber controller with a profile of text commands."""
    return _module(profile).simulated(world, profile)


def _module(profile: Profile) -> Any:
    if profile.adapter not in family_names():
        raise LookupError(
            f"profile {profile.name}: no simulation of family {profile.adapter}, one is needed; add "
            f"stations/plant/families/{profile.adapter}.py with a function 'simulated'"
        )
    return import_module(f"{families.__name__}.{profile.adapter}")
