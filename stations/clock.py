"""Clocks of a station: wall time on hardware, the time of the simulated plant in simulation."""

import json
import time
from typing import Protocol


def steady() -> float:
    """Monotonic seconds that include the time in which the machine is suspended; for ages and deadlines, not for dates."""
    boot = getattr(time, "CLOCK_BOOTTIME", None)
    return time.monotonic() if boot is None else time.clock_gettime(boot)


class Clock(Protocol):
    """A monotonic clock in seconds."""

    def now(self) -> float:
        """Seconds since the zero of the clock."""
        ...

    def sleep(self, seconds: float) -> None:
        """Returns ``seconds`` later."""


class WallClock:
    """The monotonic clock of the machine; its zero is its creation, or that of the earlier clock with this ``state``.

    ``speed`` is in seconds per second of the machine: 1 on hardware, that of the server for a simulated station served faster.
    """

    def __init__(self, resume: bytes | None = None, speed: float = 1.0) -> None:
        self._zero, self._speed = time.monotonic(), speed
        if resume:
            earlier: dict[str, float] = json.loads(resume)
            # the date may have been set back meanwhile; the time of a run is monotonic
            self._zero -= max(earlier["now_s"] / speed, time.time() - earlier["began_s"])

    def now(self) -> float:
        """Seconds since the creation of the clock, or of the first clock that it continues."""
        return self._speed * (time.monotonic() - self._zero)

    def sleep(self, seconds: float) -> None:
        """Waits."""
        time.sleep(max(0.0, seconds) / self._speed)

    def state(self) -> bytes:
        """State from which a later clock continues: the time now and the date of its zero."""
        now = self.now()
        return json.dumps({"now_s": now, "began_s": time.time() - now / self._speed}).encode()
