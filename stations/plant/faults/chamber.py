"""Faults of the chamber, the emergency stop and vibration."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from stations.plant.faults.base import Fault
from stations.plant.world import World


@dataclass
class ChamberOvershoot(Fault):
    """Integral wind-up: the controller integrates while its actuator is saturated, and the air overshoots the set point."""

    kind: ClassVar[str] = "chamber_overshoot"

    def begins(self, world: World) -> None:
        """Switches anti-windup off."""
        world.fixture.chamber.winds_up = True

    def ends(self, world: World) -> None:
        """Switches anti-windup on."""
        world.fixture.chamber.winds_up = False


@dataclass
class ChamberPower(Fault):
    """The chamber loses the power for heating and cooling; its controller still answers."""

    kind: ClassVar[str] = "chamber_power"

    def begins(self, world: World) -> None:
        """Switches the power off."""
        world.fixture.chamber.powered = False

    def ends(self, world: World) -> None:
        """Switches the power on."""
        world.fixture.chamber.powered = True


@dataclass
class ChamberUnsettled(Fault):
    """The controller hunts: its working set point oscillates by ±``swing_K`` with a period of ``period_s``."""

    kind: ClassVar[str] = "chamber_unsettled"

    swing_K: float = 6.0
    period_s: float = 900.0

    def begins(self, world: World) -> None:
        """Starts the oscillation."""
        world.fixture.chamber.hunting = (self.swing_K, self.period_s)

    def ends(self, world: World) -> None:
        """Ends the oscillation."""
        world.fixture.chamber.hunting = (0.0, 1.0)


@dataclass
class Door(Fault):
    """The chamber's door is opened."""

    kind: ClassVar[str] = "door"

    def begins(self, world: World) -> None:
        """Opens the door."""
        world.fixture.chamber.door_open = True

    def ends(self, world: World) -> None:
        """Closes the door."""
        world.fixture.chamber.door_open = False


@dataclass
class EmergencyStop(Fault):
    """The emergency stop is pressed: both axes stop and hold their positions."""

    kind: ClassVar[str] = "emergency_stop"

    def begins(self, world: World) -> None:
        """Stops both axes."""
        world.emergency_stop = True
        for axis in (world.outer, world.inner):
            axis.stall(world.now)

    def ends(self, world: World) -> None:
        """Releases both axes; an interrupted move does not continue."""
        world.emergency_stop = False
        for axis in (world.outer, world.inner):
            axis.release(world.now, resumes=False)


@dataclass
class Vibration(Fault):
    """External vibration of the fixture, ``rms_g`` g rms: a fork-lift, a press nearby."""

    kind: ClassVar[str] = "vibration"

    rms_g: float = 0.02

    def begins(self, world: World) -> None:
        """Starts the vibration."""
        world.fixture.chamber.shaken_g = self.rms_g

    def ends(self, world: World) -> None:
        """Ends the vibration."""
        world.fixture.chamber.shaken_g = 0.0
