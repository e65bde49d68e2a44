"""Faults of test equipment: exciter, shock machine and centrifuge with their recorder."""

from typing import ClassVar

from stations.plant.faults.base import UNIT, Fault
from stations.plant.world import World


class _BenchCondition(Fault):
    """A condition of the bench, named as the fault, while it lasts; the simulated controllers look for it."""

    def begins(self, world: World) -> None:
        """Sets the condition."""
        world.bench.conditions.add(self.kind)

    def ends(self, world: World) -> None:
        """Clears the condition."""
        world.bench.conditions.discard(self.kind)


def _condition(kind: str, meaning: str) -> type[Fault]:
    """The fault that sets a condition of the bench."""
    return type(kind, (_BenchCondition,), {"kind": kind, "__doc__": meaning})


MissedTrigger = _condition("missed_trigger", "The recorder misses its trigger: the test leaves no recording.")
ClippedReference = _condition("clipped_reference", "The conditioner of the reference sensor clips.")
ControllerAbort = _condition("controller_abort", "The controller aborts every test: its interlock is open.")
LevelNotReached = _condition(
    "level_not_reached", "The exciter reaches a third of its level, the shock machine a third of its peak."
)
GuardDoor = _condition(
    "guard_door", "The guard door of shock machine or centrifuge is open: it does not start, and stops."
)
Overspeed = _condition("overspeed", "The centrifuge's speed monitor trips.")
CurrentLimit = _condition(
    "current_limit", "The current limit of the power supply holds a raised voltage a tenth too low."
)
ReferenceCableOff = _condition(
    "reference_cable_off",
    "The cable of the reference sensor on the exciter or shock machine is loose: its channel shows noise alone.",
)
DriveRunaway = _condition(
    "drive_runaway",
    "The drive of the centrifuge turns half as fast again as it is told, and its speed monitor does not trip.",
)


class CableOff(Fault):
    """The cable of a unit on the test equipment is off: noise alone is recorded."""

    kind: ClassVar[str] = "cable_off"
    targets: ClassVar[tuple[str, ...]] = (UNIT,)

    def begins(self, world: World) -> None:
        """Takes the cable off."""
        world.bench.cable_off.add(self.unit)

    def ends(self, world: World) -> None:
        """Puts the cable back."""
        world.bench.cable_off.discard(self.unit)
