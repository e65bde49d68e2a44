"""A station: clock, table, chamber and reader, and the soak that needs them together."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from schemas.errors import StationTimeout

if TYPE_CHECKING:
    from collections.abc import Sequence

    from schemas.station import Soak
    from stations.clock import Clock
    from stations.devices.chamber import ThermalChamber
    from stations.devices.reader import Reader
    from stations.devices.table import TiltTable

Observe = Callable[[], list[float]]


def _no_state() -> bytes:
    return b""


@dataclass(frozen=True)
class Station:
    """Everything that a capture drives. ``state()`` is what a simulated station is resumed from; empty on hardware."""

    name: str
    clock: Clock
    table: TiltTable
    chamber: ThermalChamber
    reader: Reader
    soak_limits: Soak
    state: Callable[[], bytes] = _no_state

    def soak(self, target: float, shortest: float, slots: Sequence[int], observe: Observe) -> float:
        """Takes the devices to ``target`` °C and gives the seconds it took until they had settled.

        Settled: every device inside the band around the target and changing slower than the rate over the window, and
        ``shortest`` seconds gone. ``observe`` gives the temperatures by slot and may note them.
        """
        limits, clock = self.soak_limits, self.clock
        self.chamber.set_temperature(target)
        start = clock.now()
        past: deque[tuple[float, list[float]]] = deque()
        while True:
            self.reader.require_closed_door()
            now, temperatures = clock.now(), observe()
            past.append((now, [temperatures[slot] for slot in slots]))
            while past[-1][0] - past[0][0] > limits.window_s:
                past.popleft()
            if now - start >= shortest and self._settled(past, target):
                return now - start
            if now - start > shortest + limits.limit_s:
                worst = max((temperatures[slot] for slot in slots), key=lambda t: abs(t - target))
                message = (
                    f"soak: a device at {worst:.2f} °C after {now - start:.0f} s, {target:g} ± {limits.band_K:g} °C and "
                    f"{limits.rate_K_per_min:g} K/min are needed; check the chamber, or widen [soak] in the station's file"
                )
                raise StationTimeout(message)
            clock.sleep(limits.poll_s)

    def _settled(self, past: deque[tuple[float, list[float]]], target: float) -> bool:
        """Whether the past window lies in the band and its two halves differ by less than the rate allows."""
        limits = self.soak_limits
        span = past[-1][0] - past[0][0]
        if span < limits.window_s - 1.5 * limits.poll_s:
            return False
        inside = all(abs(t - target) <= limits.band_K for _, row in past for t in row)
        rows = [row for _, row in past]
        half = len(rows) // 2
        drift = max(abs(_mean(rows[half:], k) - _mean(rows[:half], k)) for k in range(len(rows[0])))
        return inside and drift / (span / 2.0) * 60.0 <= limits.rate_K_per_min


def _mean(rows: list[list[float]], column: int) -> float:
    return sum(row[column] for row in rows) / len(rows)
