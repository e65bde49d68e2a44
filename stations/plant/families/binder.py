"""The simulated Binder MB1 and MB2."""

from schemas.profile import Profile
from stations.codec import Value
from stations.plant.bank import Bank, Source, store, stored
from stations.plant.controller import controller_bank, set_by
from stations.plant.world import World


def simulated(world: World, profile: Profile) -> Bank:
    """Binder: writable set points beside the active one; the MB1 is in manual operation."""
    chamber = world.fixture.chamber
    written: dict[str, Value] = {
        name: chamber.set_point for name in ("set_point_basic", "set_point_manual") if profile.has(name)
    }
    act = set_by(chamber, "set_point_manual")

    def command(values: dict[str, Value]) -> None:
        store(written, values)
        act(values)

    sources: dict[str, Source] = {
        **stored(written),
        "mode": lambda: "manual",
        "door": lambda: int(chamber.door_open),
        "operation_lines": lambda: 0,
        "operation_lines_now": lambda: 0,
    }
    return controller_bank(world, profile, sources, command)
