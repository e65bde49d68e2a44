"""Adapters by the names that profiles give."""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeVar

from schemas.errors import RecipeInvalid, did_you_mean
from stations.devices.axis_az import DirectDataAxis
from stations.devices.axis_iai import NumericAxis
from stations.devices.axis_smc import StepDataAxis
from stations.devices.chambers import (
    BinderChamber,
    EurothermChamber,
    F4Chamber,
    F4TChamber,
    P300Chamber,
    SetPointChamber,
)

if TYPE_CHECKING:
    from collections.abc import Mapping

    from schemas.profile import Profile
    from stations.devices.axis import TableAxis
    from stations.devices.chamber import ThermalChamber

Adapter = TypeVar("Adapter", "TableAxis", "ThermalChamber")

AXES: dict[str, type[TableAxis]] = {
    "oriental_az": DirectDataAxis,
    "smc_lec": StepDataAxis,
    "iai_numeric": NumericAxis,
}
CHAMBERS: dict[str, type[ThermalChamber]] = {
    "set_point": SetPointChamber,
    "watlow_f4t": F4TChamber,
    "watlow_f4": F4Chamber,
    "binder": BinderChamber,
    "eurotherm_3200": EurothermChamber,
    "espec_p300": P300Chamber,
}


def axis_adapter(profile: Profile) -> type[TableAxis]:
    """The adapter that drives an axis by this profile."""
    return _adapter(profile, "axis", AXES)


def chamber_adapter(profile: Profile) -> type[ThermalChamber]:
    """The adapter that drives a chamber by this profile."""
    return _adapter(profile, "chamber", CHAMBERS)


def _adapter(profile: Profile, kind: str, known: Mapping[str, type[Adapter]]) -> type[Adapter]:
    adapter = known.get(profile.adapter)
    if adapter is None or profile.kind != kind:
        message = f"profile {profile.name}: adapter {profile.adapter} of kind {profile.kind} drives no {kind}"
        raise RecipeInvalid(f"{message}; {did_you_mean(profile.adapter, known)}", key="adapter")
    lacking = [name for name in adapter.needs if not profile.has(name)]
    if lacking:
        raise RecipeInvalid(
            f"profile {profile.name}: {', '.join(lacking)} missing, adapter {profile.adapter} needs them; add them",
            key=lacking[0],
        )
    return adapter
