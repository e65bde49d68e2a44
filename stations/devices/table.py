"""The two-axis tilt table: each axis behind a servo drive, with absolute moves, each commanded once and read back.

The adapter of a drive family defines the meaning of its registers; this module defines a move.
"""

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar, Literal

from schemas.errors import LinkLost, OperatorNeeded, StationRefused, StationTimeout
from schemas.station import Limits
from stations.clock import Clock
from stations.devices.registers import Registers

SETTLING_DEG = 0.5  # largest distance from the target while an axis settles
BEGIN_LOOKS = 3  # readings of the drive after which a move that has not started counts as finished


@dataclass(frozen=True)
class DriveState:
    """State of a drive; ``alarm`` is the text of its alarm, empty without an alarm."""

    ready: bool
    homed: bool
    moving: bool
    in_position: bool
    alarm: str = ""


class TableAxis(ABC):
    """One axis behind a servo drive; ``which`` says which of the table's two."""

    needs: ClassVar[tuple[str, ...]] = ()
    coils: ClassVar[tuple[str, ...]] = ()  # that are on before commands are accepted: source of commands, servo

    def __init__(
        self,
        registers: Registers,
        bounds: tuple[float, float],
        limits: Limits,
        which: Literal["outer", "inner"] = "outer",
    ) -> None:
        self._registers = registers
        self.name, self.which = registers.name, which
        self._low, self._high = bounds
        self._limits = limits
        self._target: float | None = None
        self._pending: float | None = None  # the target of a command that has not been confirmed
        self._looks = 0

    @abstractmethod
    def state(self) -> DriveState:
        """The present state of the drive."""

    def prepare(self) -> None:
        """Enables the drive for commands; nothing moves."""
        for coil in self.coils:
            if self._registers.text(coil) != "on":
                self._registers.set(coil, "on")

    @abstractmethod
    def order(self, target: float) -> None:
        """Commands a move to ``target`` degrees with the speed and acceleration of the station; the start is sent once."""

    @abstractmethod
    def stop(self) -> None:
        """Stops the axis; it holds its position and discards the rest of its move."""

    def check(self, target: float) -> None:
        """Refuses a target outside the limits of the station before anything moves."""
        if not self._low <= target <= self._high:
            raise StationRefused(
                f"{self.name}: target {target:g} deg, {self._low:g} to {self._high:g} deg is allowed; change the pose"
            )

    def start(self, target: float) -> float:
        """Starts a move to ``target`` degrees and returns its expected duration, s.

        Where the answer to the command is lost, the state of the drive decides whether it has accepted it; the command is never
        sent twice. If the drive has not accepted it, the error of the link is raised. A later start to the same target checks
        again. A command that depends on a reading is not sent when the reading is too old.
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

    def turn(self, target: float, rate_deg_s: float) -> float:
        """Starts a move to ``target`` degrees at a given rate, °/s, and returns its expected duration, s."""
        before, self._limits = self._limits, self._limits.model_copy(update={"speed_deg_s": rate_deg_s})
        try:
            return self.start(target)
        finally:
            self._limits = before

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
        """Whether the drive moves to its target, settles at it, or stands there."""
        state = self.state()
        settling = not state.in_position and abs(self.position() - target) <= SETTLING_DEG
        return state.moving or settling or self._stands(target)

    def _stands(self, target: float) -> bool:
        return abs(self.position() - target) <= self._tolerance()

    def _tolerance(self) -> float:
        return self._limits.position_deg + self.resolution_deg / 2.0

    @property
    def resolution_deg(self) -> float:
        """The smallest difference of two readings, degrees."""
        return self._registers.step("feedback_position")

    def _require_ready(self) -> None:
        """Enables the drive; refuses a drive that is not ready, with the reason."""
        self.prepare()
        state = self.state()
        self._refuse_alarm(state)
        if not state.homed:
            message = (
                f"{self.name}: the drive has no home position, its angles are not valid; home the axis at the drive"
            )
            raise OperatorNeeded(f"{message} and check its zero")
        if not state.ready or state.moving:
            reason = "busy with a move" if state.moving else "not ready"
            raise StationRefused(
                f"{self.name}: the drive is {reason}, a drive that stands still and is ready is needed; wait, or check its panel"
            )

    def _refuse_alarm(self, state: DriveState) -> None:
        if state.alarm:
            raise OperatorNeeded(f"{self.name}: {state.alarm}, none is needed; clear the cause and reset the drive")

    def moving(self) -> bool:
        """Whether the drive reports a move."""
        return self.state().moving

    def arrived(self) -> bool:
        """Whether the drive reports that it is in position; an alarm stops the run.

        A drive starts after a delay: a drive that stands far from its target is read again before the move counts as finished.
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
        """Ends the move: both axes are confirmed, so that the next command starts a new move, also to the same target."""
        self._pending = None

    def confirm(self, target: float) -> None:
        """Refuses to continue where the encoder reads another angle than the target."""
        angle = self.position()
        if not abs(angle - target) <= self._tolerance():
            raise OperatorNeeded(
                f"{self.name}: stands at {angle:.4f} deg, {target:g} ± {self._limits.position_deg:g} deg is needed; "
                "check the load and the brake of the table"
            )


POLL_S = 0.25
PATIENCE = 2.0  # times the expected duration of a move
GRACE_S = 10.0
REST_S = 300.0  # longest time in which an axis may finish an earlier move


class TiltTable:
    """Outer and inner axis, moved together."""

    def __init__(self, outer: TableAxis, inner: TableAxis, clock: Clock) -> None:
        self._outer, self._inner = outer, inner
        self.axes = {"outer": outer, "inner": inner}
        self._clock = clock
        self.still_since = clock.now()

    def check(self, outer_deg: float, inner_deg: float) -> None:
        """Refuses a pose outside the limits of the station."""
        self._outer.check(outer_deg)
        self._inner.check(inner_deg)

    def move(self, outer_deg: float, inner_deg: float) -> None:
        """Moves to a pose and returns when both axes stand there, confirmed by the encoders."""
        self.check(outer_deg, inner_deg)
        self._rest()
        expected = max(self._outer.start(outer_deg), self._inner.start(inner_deg))
        give_up = self._clock.now() + PATIENCE * expected + GRACE_S
        while not (self._outer.arrived() and self._inner.arrived()):
            if self._clock.now() > give_up:
                raise StationTimeout(
                    f"table: not at ({outer_deg:g}, {inner_deg:g}) deg after {PATIENCE * expected + GRACE_S:.0f} s, "
                    f"{expected:.0f} s are expected; check drive and load"
                )
            self._clock.sleep(POLL_S)
        self.still_since = self._clock.now()
        self._outer.confirm(outer_deg)
        self._inner.confirm(inner_deg)
        for axis in self.axes.values():
            axis.done()

    def turn(self, name: str, target: float, rate_deg_s: float) -> float:
        """Starts a turn of one axis from rest and returns its expected duration, s; the other axis stands."""
        self._rest()
        self.axes[name].done()  # a turn to where the last turn went is a separate turn
        return self.axes[name].turn(target, rate_deg_s)

    def turned(self, name: str, target: float) -> bool:
        """Whether a turn has ended, confirmed by the encoder."""
        axis = self.axes[name]
        if not axis.arrived():
            return False
        self.still_since = self._clock.now()
        axis.confirm(target)
        axis.done()
        return True

    def _rest(self) -> None:
        """Waits for axes that still move after an earlier command or process."""
        give_up = self._clock.now() + REST_S
        while self._outer.moving() or self._inner.moving():
            if self._clock.now() > give_up:
                raise StationTimeout(
                    f"table: an axis has been moving for {REST_S:.0f} s, an axis at rest is needed; stop it at the drive"
                )
            self._clock.sleep(POLL_S)

    def angles(self) -> tuple[float, float]:
        """The readings of the encoders (outer, inner), degrees."""
        return self._outer.position(), self._inner.position()
