"""The simulated Watlow F4."""

from schemas.profile import Profile
from stations.plant.bank import Bank, Source
from stations.plant.controller import controller_bank, set_by
from stations.plant.world import World


def simulated(world: World, profile: Profile) -> Bank:
    """Watlow F4: integers with one decimal, a static set point."""
    chamber = world.fixture.chamber
    sources: dict[str, Source] = {
        "status": lambda: "static",
        "decimals": lambda: 1,
        "temperature_2": lambda: 23.0,
        "set_point_2": lambda: 23.0,
    }
    return controller_bank(world, profile, sources, set_by(chamber, "set_point"))
