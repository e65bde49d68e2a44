"""The parts of a station that are leased, and their addresses."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

from stations.safety.addresses import address_of

if TYPE_CHECKING:
    from schemas.station import StationConfig

Part = Literal[
    "outer", "inner", "chamber", "reader", "exciter", "shock_machine", "centrifuge", "power_supply", "step_generator"
]
ROLES: tuple[Part, ...] = ("exciter", "shock_machine", "centrifuge", "power_supply", "step_generator")
PARTS: tuple[Part, ...] = ("outer", "inner", "chamber", "reader")


def addresses(config: StationConfig, *, every: bool = False) -> dict[Part, str]:
    """Addresses of table, chamber and reader of a station, in one form however the file writes them.

    Parameters
    ----------
    every : include parts that share an address with another; a lease is taken once per address
    """
    by_part: dict[Part, str] = {}
    for part in PARTS:
        address = address_of(getattr(config.devices, part))
        if every or address not in by_part.values():
            by_part[part] = address
    there = config.equipment.there()
    for role in ROLES:
        if role in there and (every or address_of(there[role]) not in by_part.values()):
            by_part[role] = address_of(there[role])
    return by_part
