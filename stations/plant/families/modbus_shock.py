"""The simulated shock machine behind registers: the machine is that with lines of text."""

from collections.abc import Callable

from schemas.profile import Profile
from stations.codec import NotEncodable, Value
from stations.plant.bank import Bank, Busy, number
from stations.plant.families.arm_release_shock import Machine
from stations.plant.world import World

HEADS = {"peak": "PEAK", "duration": "DUR", "axis": "AXIS", "direction": "DIR"}
"""Registers of numbers, and the machine's words for them."""


def simulated(world: World, profile: Profile) -> Bank:
    """The registers of a machine in front of the world's bench."""
    machine = Machine(world, profile)

    def report(head: str) -> str:
        return machine.answer(f"{head}?")[0]

    def setting(head: str) -> Callable[[], Value]:
        return lambda: float(report(head))

    def named(head: str, name: str) -> Callable[[], Value]:
        return lambda: profile.register(name).enumeration[report(head)]

    def command(values: dict[str, Value]) -> None:
        for name, value in values.items():
            if name in HEADS:
                machine.answer(f"{HEADS[name]} {number(values, name):.9g}")
            elif name == "arm":
                machine.answer(f"ARM {'ON' if value == 1 else 'OFF'}")
            elif name == "release" and machine.answer("REL NOW")[0] != "OK":
                raise Busy(profile.name)
            elif name != "release":
                raise NotEncodable(f"{name}: read-only")

    sources: dict[str, Callable[[], Value]] = {
        **{name: setting(head) for name, head in HEADS.items()},
        "arm": lambda: int(report("STAT") == "ARMED"),
        "door": named("DOOR", "door"),
        "state": named("STAT", "state"),
        "file": lambda: report("FILE"),
    }
    return Bank(profile, sources, command)
