"""The two-axis tilt table: absolute moves, each read back."""

from schemas.errors import StationTimeout
from stations.clock import Clock
from stations.devices.axis import TableAxis

__all__ = ["TableAxis", "TiltTable"]

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
