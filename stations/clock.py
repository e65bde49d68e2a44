"""The clock that devices are given: the wall's on hardware, the plant's in simulation."""

from __future__ import annotations

import time
from typing import Protocol


class Clock(Protocol):
    """Seconds that only go forward."""

    def now(self) -> float:
        """Seconds since the clock's own beginning."""
        ...

    def sleep(self, seconds: float) -> None:
        """Comes back ``seconds`` later."""
        ...


class WallClock:
    """The machine's monotonic clock, zero when it is made."""

    def __init__(self) -> None:
        self._zero = time.monotonic()

    def now(self) -> float:
        """Seconds since the clock was made."""
        return time.monotonic() - self._zero

    def sleep(self, seconds: float) -> None:
        """Waits."""
        time.sleep(max(0.0, seconds))
