"""A chamber that goes beyond its set point."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from stations.plant.faults.base import Fault

if TYPE_CHECKING:
    from stations.plant.plant import Plant


@dataclass
class ChamberOvershoot(Fault):
    """The controller's integral winds up while the actuator is at its end, so that the air goes far beyond the set point."""

    kind: ClassVar[str] = "chamber_overshoot"

    def begins(self, plant: Plant) -> None:
        """It winds up."""
        plant.fixture.chamber.winds_up = True

    def ends(self, plant: Plant) -> None:
        """It does not."""
        plant.fixture.chamber.winds_up = False


@dataclass
class ChamberPower(Fault):
    """The chamber loses the power for heating and cooling; its controller goes on answering."""

    kind: ClassVar[str] = "chamber_power"

    def begins(self, plant: Plant) -> None:
        """Off."""
        plant.fixture.chamber.powered = False

    def ends(self, plant: Plant) -> None:
        """On."""
        plant.fixture.chamber.powered = True


@dataclass
class ChamberUnsettled(Fault):
    """The controller hunts: its working set point swings by ``swing_K`` with a period of ``period_s``."""

    kind: ClassVar[str] = "chamber_unsettled"

    swing_K: float = 6.0
    period_s: float = 900.0

    def begins(self, plant: Plant) -> None:
        """It hunts."""
        plant.fixture.chamber.hunting = (self.swing_K, self.period_s)

    def ends(self, plant: Plant) -> None:
        """It is quiet."""
        plant.fixture.chamber.hunting = (0.0, 1.0)


@dataclass
class Door(Fault):
    """The chamber's door is opened."""

    kind: ClassVar[str] = "door"

    def begins(self, plant: Plant) -> None:
        """Open."""
        plant.fixture.chamber.door_open = True

    def ends(self, plant: Plant) -> None:
        """Closed."""
        plant.fixture.chamber.door_open = False


@dataclass
class EmergencyStop(Fault):
    """The emergency stop is pressed: both axes stop where they are and hold."""

    kind: ClassVar[str] = "emergency_stop"

    def begins(self, plant: Plant) -> None:
        """Pressed."""
        plant.emergency_stop = True
        for axis in (plant.outer, plant.inner):
            axis.stall(plant.now)

    def ends(self, plant: Plant) -> None:
        """Released; what was interrupted is not gone on with."""
        plant.emergency_stop = False
        for axis in (plant.outer, plant.inner):
            axis.release(plant.now, resumes=False)


@dataclass
class Vibration(Fault):
    """Something shakes the fixture: a fork-lift, a press next door."""

    kind: ClassVar[str] = "vibration"

    rms_g: float = 0.02

    def begins(self, plant: Plant) -> None:
        """It shakes."""
        plant.fixture.chamber.shaken_g = self.rms_g

    def ends(self, plant: Plant) -> None:
        """It is gone."""
        plant.fixture.chamber.shaken_g = 0.0
