"""A station: clock, table, chamber and reader, and the soak that needs them together."""

import math
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from schemas.errors import NotReached
from schemas.station import StationConfig
from stations.clock import Clock
from stations.devices.chamber import ThermalChamber
from stations.devices.reader import Reader
from stations.devices.table import TiltTable
from stations.safety.safe_state import Reached, SafeStep, reach_safe_state

Observe = Callable[[], list[float]]


class Unsettled(NotReached):
    """Devices that have not settled in time; ``slots`` are theirs."""

    def __init__(self, message: str, slots: Sequence[int]) -> None:
        self.slots = tuple(slots)
        super().__init__(message)


def nobody_else() -> None:
    """``Station.require`` of a simulated station in this process, which no other run can drive."""


@dataclass(frozen=True)
class Station:
    """The clock and devices of a station, as driven by a capture.

    ``state()`` gives the state from which it can be resumed. ``exact``: a resumed station is in exactly the earlier state; any
    other may have changed, and the devices are soaked again. ``require()`` refuses if another run has taken over the station.
    ``safe_steps`` are the commands towards the safe state. ``equipment`` has the adapters of the roles that a run needs.
    """

    config: StationConfig
    clock: Clock
    table: TiltTable
    chamber: ThermalChamber
    reader: Reader
    state: Callable[[], bytes] = bytes
    exact: bool = True
    require: Callable[[], None] = nobody_else
    safe_steps: list[SafeStep] = field(default_factory=list[SafeStep])
    equipment: Mapping[str, Any] = field(default_factory=dict[str, Any])

    @property
    def name(self) -> str:
        """The station's name."""
        return self.config.name

    def make_safe(self, patience_s: float = 0.0) -> Reached:
        """Puts the station into its safe state; returns the commands that succeeded and failed."""
        return reach_safe_state(self.safe_steps, patience_s=patience_s)

    def soak(self, target: float, shortest: float, slots: Sequence[int], observe: Observe) -> float:
        """Soaks the devices at ``target`` °C and returns the time in seconds until they have settled.

        Settled: every device is within the band around the target and changes more slowly than the rate over the window, after
        at least ``shortest`` seconds. ``observe`` returns the temperatures by slot and may record them; its errors end the soak.
        """
        limits, clock = self.config.soak, self.clock
        self.chamber.set_temperature(target)
        start = clock.now()
        past: deque[tuple[float, list[float]]] = deque()
        while True:
            now, temperatures = clock.now(), observe()
            past.append((now, [temperatures[slot] for slot in slots]))
            while past[-1][0] - past[0][0] > limits.window_s:
                past.popleft()
            if now - start >= shortest and self._settled(past, target):
                return now - start
            if now - start > shortest + limits.limit_s:
                raise self._unsettled(past, target, slots, now - start)
            clock.sleep(limits.poll_s)

    def _settled(self, past: deque[tuple[float, list[float]]], target: float) -> bool:
        """Whether the past window lies in the band and its two halves differ by less than the rate allows."""
        limits = self.config.soak
        span = past[-1][0] - past[0][0]
        if span < limits.window_s - 1.5 * limits.poll_s:
            return False
        return all(self._still([row[k] for _, row in past], target, span) for k in range(len(past[0][1])))

    def _still(self, temperatures: list[float], target: float, span: float) -> bool:
        """Whether one device has settled over a window of ``span`` seconds; false if a temperature is unknown."""
        limits = self.config.soak
        if not all(abs(t - target) <= limits.band_K for t in temperatures):
            return False
        half = len(temperatures) // 2
        drift = abs(_mean(temperatures[half:]) - _mean(temperatures[:half]))
        return drift / (span / 2.0) * 60.0 <= limits.rate_K_per_min

    def _unsettled(
        self, past: deque[tuple[float, list[float]]], target: float, slots: Sequence[int], seconds: float
    ) -> Unsettled:
        """The exception with the slots of the devices that have not settled, and the temperature of the worst one."""
        limits, span = self.config.soak, past[-1][0] - past[0][0]
        rows = [row for _, row in past]
        late = {
            slot: rows[-1][k] for k, slot in enumerate(slots) if not self._still([r[k] for r in rows], target, span)
        }
        worst = max(late.values(), key=lambda t: abs(t - target) if math.isfinite(t) else math.inf, default=math.nan)
        message = (
            f"soak: a device at {worst:.2f} °C after {seconds:.0f} s, {target:g} ± {limits.band_K:g} °C and "
            f"{limits.rate_K_per_min:g} K/min are needed; check the chamber, or widen [soak] in the station's file"
        )
        return Unsettled(message, list(late))


def _mean(values: list[float]) -> float:
    return sum(values) / len(values)
