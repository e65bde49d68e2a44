"""Faults of test equipment: exciter, shock machine and centrifuge with their recorder."""

from __future__ import annotations

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


class MissedTrigger(_BenchCondition):
    """The recorder misses its trigger: the test leaves no recording."""

    kind: ClassVar[str] = "missed_trigger"


class ClippedReference(_BenchCondition):
    """The conditioner of the reference sensor clips."""

    kind: ClassVar[str] = "clipped_reference"


class ControllerAbort(_BenchCondition):
    """The controller aborts every test: its interlock is open."""

    kind: ClassVar[str] = "controller_abort"


class LevelNotReached(_BenchCondition):
    """The exciter reaches a third of its level, the shock machine a third of its peak."""

    kind: ClassVar[str] = "level_not_reached"


class GuardDoor(_BenchCondition):
    """The guard door of shock machine or centrifuge is open: it does not start, and stops."""

    kind: ClassVar[str] = "guard_door"


class Overspeed(_BenchCondition):
    """The centrifuge's speed monitor trips."""

    kind: ClassVar[str] = "overspeed"


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


class CurrentLimit(_BenchCondition):
    """The current limit of the power supply holds a raised voltage a tenth too low."""

    kind: ClassVar[str] = "current_limit"


class ReferenceCableOff(_BenchCondition):
    """The cable of the reference sensor on the exciter or shock machine is loose: its channel shows noise alone."""

    kind: ClassVar[str] = "reference_cable_off"


class DriveRunaway(_BenchCondition):
    """The drive of the centrifuge turns half as fast again as it is told, and its speed monitor does not trip."""

    kind: ClassVar[str] = "drive_runaway"
