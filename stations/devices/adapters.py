"""Adapters by device family: each module in ``families`` has the adapter of the family it is named for."""

import pkgutil
from collections.abc import Callable
from functools import cache
from importlib import import_module
from inspect import isabstract
from typing import TypeVar

from schemas.errors import RecipeInvalid, did_you_mean
from schemas.profile import Profile
from stations.devices import families
from stations.devices.chamber import ThermalChamber
from stations.devices.equipment import Equipment
from stations.devices.table import TableAxis

Adapter = TypeVar("Adapter", bound="TableAxis | ThermalChamber | Equipment")


@cache
def adapters() -> dict[str, type[TableAxis | ThermalChamber | Equipment]]:
    """Every adapter by the name of its family, sorted; raises LookupError for a module without exactly one adapter."""
    by_family: dict[str, type[TableAxis | ThermalChamber | Equipment]] = {}
    for module in pkgutil.iter_modules(families.__path__):
        content = vars(import_module(f"{families.__name__}.{module.name}")).values()
        classes = [
            kind
            for kind in content
            if isinstance(kind, type) and issubclass(kind, (TableAxis, ThermalChamber, Equipment))
        ]
        concrete = [kind for kind in classes if not isabstract(kind)]
        if len(concrete) != 1:
            raise LookupError(
                f"stations/devices/families/{module.name}.py: {len(concrete)} adapters, 1 is needed; give it one complete "
                "subclass of TableAxis, ThermalChamber or Equipment"
            )
        by_family[module.name] = concrete[0]
    return dict(sorted(by_family.items()))


def adapter_of(profile: Profile, kind: str, base: type[Adapter]) -> Callable[..., Adapter]:
    """The adapter that drives an axis, a chamber, or test equipment in the role ``kind`` by this profile."""
    known = {name: adapter for name, adapter in adapters().items() if issubclass(adapter, base)}
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
