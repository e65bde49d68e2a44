"""The two-axis tilt table: absolute moves, each read back."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from schemas.errors import OperatorNeeded, StationRefused, StationTimeout

if TYPE_CHECKING:
    from schemas.station import Limits
    from stations.clock import Clock
    from stations.devices.registers import Registers

POLL_S = 0.25
PATIENCE = 2.0  # times what a move should take
GRACE_S = 10.0


class TableAxis:
    """One axis behind a servo drive."""

    def __init__(self, registers: Registers, bounds: tuple[float, float], limits: Limits) -> None:
        self._registers = registers
        self.name = registers.name
        self._low, self._high = bounds
        self._limits = limits

    def check(self, target: float) -> None:
        """Refuses a target outside the station's limits; nothing has moved then."""
        if not self._low <= target <= self._high:
            message = (
                f"{self.name}: target {target:g} deg, {self._low:g} to {self._high:g} deg is allowed; change the pose"
            )
            raise StationRefused(message)

    def start(self, target: float) -> float:
        """Starts a move to ``target`` degrees and gives the seconds it should take."""
        self.check(target)
        limits = self._limits
        distance = abs(target - self.position())
        values = {
            "data_number": 0,
            "operation_type": "absolute",
            "target": target,
            "speed": limits.speed_deg_s,
            "acceleration": limits.acceleration_deg_s2,
            "deceleration": limits.acceleration_deg_s2,
            "current": 100.0,
            "trigger": "all",
            "forwarding": 0,
        }
        self._registers.write_group("direct_data", values)
        return distance / limits.speed_deg_s + 2.0 * math.sqrt(distance / limits.acceleration_deg_s2)

    def arrived(self) -> bool:
        """Whether the drive says that it is in position; an alarm stops the run."""
        flags = self._registers.flags("status")
        if flags["alarm"]:
            code = int(self._registers.number("alarm"))
            message = f"{self.name}: drive alarm 0x{code:02X}, none is needed; clear the cause and reset the drive"
            raise OperatorNeeded(message)
        return flags["in_position"] and not flags["move"]

    def stop(self) -> None:
        """Stops the axis where it is; it holds, and what was left of its move is dropped."""
        bit = self._registers.profile.register("command").bits["stop"]
        self._registers.write("command", 1 << bit)
        self._registers.write("command", 0)

    def position(self) -> float:
        """The encoder's reading, degrees."""
        return self._registers.number("feedback_position")

    def confirm(self, target: float) -> None:
        """Refuses to go on when the encoder says another angle than was asked."""
        found = self.position()
        if abs(found - target) > self._limits.position_deg:
            message = (
                f"{self.name}: stands at {found:.4f} deg, {target:g} ± {self._limits.position_deg:g} deg is needed; "
                "check load and brake of the table"
            )
            raise OperatorNeeded(message)


class TiltTable:
    """Outer and inner axis, moved together."""

    def __init__(self, outer: TableAxis, inner: TableAxis, clock: Clock) -> None:
        self._outer, self._inner = outer, inner
        self.axes = {"outer": outer, "inner": inner}
        self._clock = clock
        self.still_since = clock.now()

    def check(self, outer_deg: float, inner_deg: float) -> None:
        """Refuses a pose outside the station's limits."""
        self._outer.check(outer_deg)
        self._inner.check(inner_deg)

    def move(self, outer_deg: float, inner_deg: float) -> None:
        """Goes to a pose and comes back when both axes stand there, confirmed by the encoders."""
        self.check(outer_deg, inner_deg)
        expected = max(self._outer.start(outer_deg), self._inner.start(inner_deg))
        give_up = self._clock.now() + PATIENCE * expected + GRACE_S
        while not (self._outer.arrived() and self._inner.arrived()):
            if self._clock.now() > give_up:
                message = (
                    f"table: not at ({outer_deg:g}, {inner_deg:g}) deg after {PATIENCE * expected + GRACE_S:.0f} s, "
                    f"{expected:.0f} s should do; check drive and load"
                )
                raise StationTimeout(message)
            self._clock.sleep(POLL_S)
        self.still_since = self._clock.now()
        self._outer.confirm(outer_deg)
        self._inner.confirm(inner_deg)

    def angles(self) -> tuple[float, float]:
        """The encoders' readings (outer, inner), degrees."""
        return self._outer.position(), self._inner.position()
