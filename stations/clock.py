"""The clock that devices are given: the wall's on hardware, the plant's in simulation."""

from __future__ import annotations

import json
import time
from typing import Protocol


def steady() -> float:
    """Seconds that never go back and go on while the machine is suspended; for ages and deadlines, not for dates."""
    boot = getattr(time, "CLOCK_BOOTTIME", None)
    return time.monotonic() if boot is None else time.clock_gettime(boot)


class Clock(Protocol):
    """Seconds that only go forward."""

    def now(self) -> float:
        """Seconds since the clock's own beginning."""
        ...

    def sleep(self, seconds: float) -> None:
        """Comes back ``seconds`` later."""
        ...


class WallClock:
    """The machine's monotonic clock, zero when it is made; or going on from an earlier one's ``state``."""

    def __init__(self, resume: bytes | None = None) -> None:
        self._zero = time.monotonic()
        if resume:
            earlier: dict[str, float] = json.loads(resume)
            # the date may have been set back in between, the time of a run never goes back
            self._zero -= max(earlier["now_s"], time.time() - earlier["began_s"])

    def now(self) -> float:
        """Seconds since the clock was made, or since the first of those that it goes on from."""
        return time.monotonic() - self._zero

    def sleep(self, seconds: float) -> None:
        """Waits."""
        time.sleep(max(0.0, seconds))

    def state(self) -> bytes:
        """What a later clock goes on from: the time now, and the date of its zero."""
        now = self.now()
        return json.dumps({"now_s": now, "began_s": time.time() - now}).encode()
