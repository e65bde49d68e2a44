"""The simulated Eurotherm 3200."""

from schemas.profile import Profile
from stations.codec import Value
from stations.plant.bank import Bank, Source, number
from stations.plant.controller import controller_bank
from stations.plant.world import World


def simulated(world: World, profile: Profile) -> Bank:
    """Eurotherm 3200: the remote set point is active while it is enabled, set point 1 otherwise."""
    chamber = world.fixture.chamber
    local = chamber.set_point
    state: dict[str, float] = {"remote": local, "enabled": 0.0}

    def command(values: dict[str, Value]) -> None:
        if "set_point" in values:
            state["remote"] = number(values, "set_point")
        if "remote_enable" in values:
            state["enabled"] = number(values, "remote_enable")
        chamber.set_point = state["remote"] if state["enabled"] else local

    sources: dict[str, Source] = {
        "set_point": lambda: state["remote"],
        "target_set_point": lambda: chamber.set_point,
        "set_point_1": lambda: local,
        "set_point_2": lambda: local,
        "remote_enable": lambda: int(state["enabled"]),
        "program_status": lambda: "reset",
    }
    return controller_bank(world, profile, sources, command)
