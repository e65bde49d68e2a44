"""Faults of test equipment: exciter, shock machine and centrifuge with their recorder."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from stations.plant.faults.base import UNIT, Fault

if TYPE_CHECKING:
    from stations.plant.world import World


@dataclass
class _Trouble(Fault):
    """A condition of the bench while the fault lasts."""

    def begins(self, world: World) -> None:
        """Sets the condition."""
        world.bench.troubles.add(self.kind)

    def ends(self, world: World) -> None:
        """Clears the condition."""
        world.bench.troubles.discard(self.kind)


@dataclass
class MissedTrigger(_Trouble):
    """The recorder misses its trigger: the test leaves no recording."""

    kind: ClassVar[str] = "missed_trigger"


@dataclass
class ClippedReference(_Trouble):
    """The conditioner of the reference sensor clips."""

    kind: ClassVar[str] = "clipped_reference"


@dataclass
class ControllerAbort(_Trouble):
    """The controller aborts every test: its interlock is open."""

    kind: ClassVar[str] = "controller_abort"


@dataclass
class LevelNotReached(_Trouble):
    """The exciter reaches a third of its level, the shock machine a third of its peak."""

    kind: ClassVar[str] = "level_not_reached"


@dataclass
class GuardDoor(_Trouble):
    """The guard door of shock machine or centrifuge is open: it does not start, and stops."""

    kind: ClassVar[str] = "guard_door"


@dataclass
class Overspeed(_Trouble):
    """The centrifuge's speed monitor trips."""

    kind: ClassVar[str] = "overspeed"


@dataclass
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


@dataclass
class CurrentLimit(_Trouble):
    """The current limit of the power supply holds a raised voltage a tenth too low."""

    kind: ClassVar[str] = "current_limit"


@dataclass
class ReferenceCableOff(_Trouble):
    """The cable of the reference sensor on the exciter or shock machine is loose: its channel shows noise alone."""

    kind: ClassVar[str] = "reference_cable_off"


@dataclass
class DriveRunaway(_Trouble):
    """The drive of the centrifuge turns half as fast again as it is told, and its speed monitor does not trip."""

    kind: ClassVar[str] = "drive_runaway"
