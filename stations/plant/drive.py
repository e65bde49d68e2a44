"""Common part of the simulated drives: the start of a move."""

from __future__ import annotations

from schemas.profile import Profile
from stations.codec import Value
from stations.plant.bank import Busy, number
from stations.plant.table import Axis
from stations.plant.world import World

ABSOLUTE = 1


def start_move(world: World, axis: Axis, profile: Profile, values: dict[str, Value]) -> None:
    """Starts a move of a drive at rest."""
    if axis.moving(world.now):
        raise Busy(profile.name)
    axis.go(world.now, number(values, "target"), number(values, "speed"), number(values, "acceleration"))
