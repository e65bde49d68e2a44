"""One axis of the table behind a servo drive: absolute moves, ordered once, each read back.

What a drive's registers mean is the business of the adapter of its family; what a move is, is said here.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from schemas.errors import LinkLost, OperatorNeeded, StationRefused, StationTimeout

if TYPE_CHECKING:
    from schemas.station import Limits
    from stations.devices.registers import Registers

SETTLING_DEG = 0.5  # how near its target an axis is while it comes to rest
BEGIN_LOOKS = 3  # looks at the drive before a move that has not begun counts as over


@dataclass(frozen=True)
class DriveState:
    """What a drive says of itself; ``alarm`` is empty when there is none, else what a person should read."""

    ready: bool
    homed: bool
    moving: bool
    in_position: bool
    alarm: str = ""


class TableAxis(ABC):
    """One axis behind a servo drive."""

    needs: ClassVar[tuple[str, ...]] = ()

    def __init__(self, registers: Registers, bounds: tuple[float, float], limits: Limits) -> None:
        self._registers = registers
        self.name = registers.name
        self._low, self._high = bounds
        self._limits = limits
        self._target: float | None = None
        self._pending: float | None = None  # a target that was ordered and has not been confirmed
        self._looks = 0

    @abstractmethod
    def state(self) -> DriveState:
        """What the drive says of itself now."""

    @abstractmethod
    def prepare(self) -> None:
        """Makes the drive take orders, without moving anything."""

    @abstractmethod
    def order(self, target: float) -> None:
        """Orders a move to ``target`` degrees, with the station's speed and acceleration; what starts it is sent once."""

    @abstractmethod
    def stop(self) -> None:
        """Stops the axis where it is; it holds, and what was left of its move is dropped."""

    def check(self, target: float) -> None:
        """Refuses a target outside the station's limits; nothing has moved then."""
        if not self._low <= target <= self._high:
            raise StationRefused(
                f"{self.name}: target {target:g} deg, {self._low:g} to {self._high:g} deg is allowed; change the pose"
            )

    def start(self, target: float) -> float:
        """Starts a move to ``target`` degrees and gives the seconds it should take.

        Where the answer to the order is lost, the drive is asked whether it has taken it; it is never sent a second time. A drive
        that has not taken it raises what was lost. A later start to the same target finds out whether it has in the
        meantime. An order that could not be sent soon after the reading that it rests on is not sent at all.
        """
        self.check(target)
        limits = self._limits
        with self._registers.deciding():
            distance = abs(target - self.position())
            pending, self._pending = self._pending, target
            self._target, self._looks = target, 0
            if pending != target or not self._took(target):
                self._require_ready()
                self._order_once(target)
        return distance / limits.speed_deg_s + 2.0 * math.sqrt(distance / limits.acceleration_deg_s2)

    def _order_once(self, target: float) -> None:
        try:
            self.order(target)
        except (StationTimeout, LinkLost):
            if not self._took(target):
                raise
        except StationRefused:
            self._pending = None
            raise

    def _took(self, target: float) -> bool:
        """Whether the drive is on its way, still rings at its target, or stands there."""
        state = self.state()
        settling = not state.in_position and abs(self.position() - target) <= SETTLING_DEG
        return state.moving or settling or self._stands(target)

    def _stands(self, target: float) -> bool:
        return abs(self.position() - target) <= self._tolerance()

    def _tolerance(self) -> float:
        return self._limits.position_deg + self._registers.step("feedback_position") / 2.0

    def _require_ready(self) -> None:
        """A drive that takes orders; one that does not says why, to whom it may concern."""
        self.prepare()
        state = self.state()
        self._refuse_alarm(state)
        if not state.homed:
            message = f"{self.name}: the drive has no home, its angles mean nothing; home the axis at the drive"
            raise OperatorNeeded(f"{message} and check its zero")
        if not state.ready or state.moving:
            found = "busy with a move" if state.moving else "not ready"
            raise StationRefused(
                f"{self.name}: the drive is {found}, one that stands and is ready is needed; wait, or look at its panel"
            )

    def _refuse_alarm(self, state: DriveState) -> None:
        if state.alarm:
            raise OperatorNeeded(f"{self.name}: {state.alarm}, none is needed; clear the cause and reset the drive")

    def moving(self) -> bool:
        """Whether the drive says that it moves."""
        return self.state().moving

    def arrived(self) -> bool:
        """Whether the drive says that it is in position; an alarm stops the run.

        A drive takes a moment to begin: one that says it stands, far from its target, is looked at again.
        """
        state = self.state()
        self._refuse_alarm(state)
        if state.moving or not state.in_position:
            self._looks = BEGIN_LOOKS
            return False
        if self._target is None or self._looks >= BEGIN_LOOKS or self._stands(self._target):
            return True
        self._looks += 1
        return False

    def position(self) -> float:
        """The encoder's reading, degrees."""
        return self._registers.number("feedback_position")

    def done(self) -> None:
        """Forgets the order: all that was ordered with it has been confirmed, and the next one is new, whatever its target."""
        self._pending = None

    def confirm(self, target: float) -> None:
        """Refuses to go on when the encoder says another angle than was asked."""
        found = self.position()
        if abs(found - target) > self._tolerance():
            raise OperatorNeeded(
                f"{self.name}: stands at {found:.4f} deg, {target:g} ± {self._limits.position_deg:g} deg is needed; "
                "check load and brake of the table"
            )
