"""Power orders of a capture: the devices switched off and on again before a record, watched meanwhile, and never twice for it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from schemas.event import NO_RECORD
from stations.safety.suspenders import require_released

if TYPE_CHECKING:
    from pipelines.capture.supervision import Supervisor
    from pipelines.schedule.steps import Step
    from stations.station import Station

OFF_S = "off_s"


@dataclass
class Power:
    """The devices' supply during a capture. What was switched is kept as events: a run that was killed goes by them.

    ordered : whether the recipe switches at all
    """

    station: Station
    guard: Supervisor
    ordered: bool

    def require_on(self) -> None:
        """Switches devices on that a run which was killed has left without power; for how long is told by its events."""
        reader = self.station.reader
        if reader.powered():
            return
        last = [event for event in self.guard.past() if event.kind == "power"]
        left = last[-1] if last and OFF_S not in last[-1].figures else None
        reader.switch("on")
        seconds = 0.0 if left is None else self.station.clock.now() - left.time_s
        record = NO_RECORD if left is None else left.record
        self._on_again(record, seconds, "the devices had no power as the run went on")

    def off_before(self, step: Step) -> float:
        """Seconds for which the devices were off right before a record; 0 where they were not."""
        return {
            event.record: event.figures[OFF_S]
            for event in self.guard.past()
            if event.kind == "power" and OFF_S in event.figures
        }.get(step.record, 0.0)

    def cycle(self, step: Step) -> None:
        """Switches the devices off for as long as a step wants, and on again, whatever ends the wait; once for each record."""
        if step.off_s <= 0.0 or self.off_before(step) > 0.0:
            return
        reader, clock = self.station.reader, self.station.clock
        reader.stop()
        self.guard.note("power", step.record, f"the recipe asks for {step.off_s:g} s without power", "devices off")
        start = clock.now()
        reader.switch("off")
        try:
            self._watch(start + step.off_s)
        finally:
            reader.switch("on")
            self._on_again(step.record, clock.now() - start, f"the recipe asks for {step.off_s:g} s without power")

    def _watch(self, end: float) -> None:
        """Lets time pass with the devices off: only what the reader watches for people can be asked."""
        clock, rules = self.station.clock, self.guard.watched.rules
        while end - clock.now() > 1e-6:
            self.station.require()
            require_released(self.station.reader.guarded())
            clock.sleep(min(rules.poll_s, end - clock.now()))

    def _on_again(self, record: int, seconds: float, reason: str) -> None:
        self.guard.clocks = None  # the reader counts the seconds with power anew
        self.guard.note("power", record, reason, "devices on again", {OFF_S: round(seconds, 3)})
