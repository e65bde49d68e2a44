"""Power orders of a capture: the devices are switched off and on again before a record, once for each record."""

from __future__ import annotations

from dataclasses import dataclass

from pipelines.capture.supervision import Supervisor
from pipelines.schedule.steps import Step
from schemas.event import NO_RECORD
from stations.safety.suspenders import require_released
from stations.station import Station

OFF_S = "off_s"


@dataclass
class Power:
    """The devices' supply during a capture. Switching is journalled: a run that was killed resumes from these events.

    ordered : whether the recipe has power orders
    """

    station: Station
    supervisor: Supervisor
    ordered: bool

    def require_on(self) -> None:
        """Switches on devices that a killed run has left without power; its events give the time without power."""
        reader = self.station.reader
        if reader.powered():
            return
        last = [event for event in self.supervisor.past() if event.kind == "power"]
        left = last[-1] if last and OFF_S not in last[-1].figures else None
        reader.switch("on")
        seconds = 0.0 if left is None else self.station.clock.now() - left.time_s
        record = NO_RECORD if left is None else left.record
        self._on_again(record, seconds, "the devices had no power when the run resumed")

    def off_before(self, step: Step) -> float:
        """Time without power directly before a record, s; 0 where the devices were not off."""
        return {
            event.record: event.figures[OFF_S]
            for event in self.supervisor.past()
            if event.kind == "power" and OFF_S in event.figures
        }.get(step.record, 0.0)

    def cycle(self, step: Step) -> None:
        """Switches the devices off for the step's ``off_s`` and on again, also after an error; once for each record."""
        if step.off_s <= 0.0 or self.off_before(step) > 0.0:
            return
        reader, clock = self.station.reader, self.station.clock
        reader.stop()
        self.supervisor.note("power", step.record, f"the recipe orders {step.off_s:g} s without power", "devices off")
        start = clock.now()
        reader.switch("off")
        try:
            self._watch(start + step.off_s)
        finally:
            reader.switch("on")
            self._on_again(step.record, clock.now() - start, f"the recipe orders {step.off_s:g} s without power")

    def _watch(self, end: float) -> None:
        """Waits with the devices off; only the reader's safety inputs can be read meanwhile."""
        clock, rules = self.station.clock, self.supervisor.watched.rules
        while end - clock.now() > 1e-6:
            self.station.require()
            require_released(self.station.reader.guarded())
            clock.sleep(min(rules.poll_s, end - clock.now()))

    def _on_again(self, record: int, seconds: float, reason: str) -> None:
        self.supervisor.clocks = None  # the reader's time since power-on starts again
        self.supervisor.note("power", record, reason, "devices on again", {OFF_S: round(seconds, 3)})
