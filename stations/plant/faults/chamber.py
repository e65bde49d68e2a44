"""Faults of the chamber, the emergency stop and vibration."""

from dataclasses import dataclass
from typing import Any, ClassVar

from stations.plant.chamber import Chamber
from stations.plant.faults.base import Fault
from stations.plant.world import World


class _ChamberFault(Fault):
    """A fault that sets one attribute of the simulated chamber while it lasts."""

    attribute: ClassVar[str]

    def setting(self) -> Any:
        """What the attribute is meanwhile."""
        return True

    def begins(self, world: World) -> None:
        """Sets the attribute."""
        setattr(world.fixture.chamber, self.attribute, self.setting())

    def ends(self, world: World) -> None:
        """Sets it to what it is in a sound chamber."""
        setattr(world.fixture.chamber, self.attribute, getattr(Chamber, self.attribute))


@dataclass
class ChamberOvershoot(_ChamberFault):
    """Integral wind-up: the controller integrates while its actuator is saturated, and the air overshoots the set point."""

    kind: ClassVar[str] = "chamber_overshoot"
    attribute: ClassVar[str] = "winds_up"


@dataclass
class ChamberPower(_ChamberFault):
    """The chamber loses the power for heating and cooling; its controller still answers."""

    kind: ClassVar[str] = "chamber_power"
    attribute: ClassVar[str] = "powered"

    def setting(self) -> bool:
        """Without power."""
        return False


@dataclass
class ChamberUnsettled(_ChamberFault):
    """The controller hunts: its working set point oscillates by ±``swing_K`` with a period of ``period_s``."""

    kind: ClassVar[str] = "chamber_unsettled"
    attribute: ClassVar[str] = "hunting"

    swing_K: float = 6.0
    period_s: float = 900.0

    def setting(self) -> tuple[float, float]:
        """Swing and period."""
        return self.swing_K, self.period_s


@dataclass
class Door(_ChamberFault):
    """The chamber's door is opened."""

    kind: ClassVar[str] = "door"
    attribute: ClassVar[str] = "door_open"


@dataclass
class Vibration(_ChamberFault):
    """External vibration of the fixture, ``rms_g`` g rms: a fork-lift, a press nearby."""

    kind: ClassVar[str] = "vibration"
    attribute: ClassVar[str] = "shaken_g"

    rms_g: float = 0.02

    def setting(self) -> float:
        """The vibration, g rms."""
        return self.rms_g


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
