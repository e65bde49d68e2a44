"""A simulated controller with a set point only."""

from schemas.profile import Profile
from stations.plant.bank import Bank
from stations.plant.controller import controller_bank, set_by
from stations.plant.world import World


def simulated(world: World, profile: Profile) -> Bank:
    """A controller with a set point only."""
    chamber = world.fixture.chamber
    return controller_bank(world, profile, {}, set_by(chamber, "set_point"))
