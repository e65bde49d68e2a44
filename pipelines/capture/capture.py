"""Capture: drives a station through a recipe and hands every record to a sink; the only place that does."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from pipelines.capture.acquisition import Acquisition
from pipelines.capture.sink import CaptureSink
from pipelines.capture.soak_response import Approach
from pipelines.capture.supervision import LINK_ATTEMPTS, LOST_FOR, WARMING, StillSuspended, Supervisor
from pipelines.capture.time_left import Remaining
from pipelines.schedule.steps import Step, steps
from schemas.errors import LeaseLost, LinkLost, NotReached, StationError, StationTimeout
from schemas.event import MemoryLog
from stations.safety.suspenders import Suspended
from stations.station import Unsettled

if TYPE_CHECKING:
    from schemas.event import EventLog
    from schemas.progress import Progress
    from schemas.recipe import Lot, Recipe
    from stations.station import Station


__all__ = ["CaptureSink", "Step", "capture", "check", "steps"]


def capture(
    station: Station,
    recipe: Recipe,
    lot: Lot,
    sink: CaptureSink,
    *,
    progress: Progress,
    events: EventLog | None = None,
) -> None:
    """Takes every record of a recipe that the sink does not have yet, in order.

    Everything that the recipe asks for is held against the station's limits before anything moves. A unit that stops answering is
    told so in its readings; the others go on. A condition that spoils data pauses the run, which goes back to its last
    checkpoint, soak and pose, and measures again. What only a person can put right leaves the station safe and ends the run.

    Parameters
    ----------
    events : where the reasons of all that are kept; forgotten where there is none
    """
    plan = steps(recipe)
    check(station, recipe, plan)
    guard = Supervisor(station, events if events is not None else MemoryLog())
    remaining = Remaining(plan, station.config, recipe)
    work = CaptureRun(station, recipe, lot, sink, guard, remaining=remaining, progress=progress)
    work.run(plan)


def check(station: Station, recipe: Recipe, plan: list[Step]) -> None:
    """Refuses a recipe that the station may not do; nothing has moved then."""
    for step in plan:
        if step.off_s > 0.0:
            station.reader.require_switch()
        station.chamber.check(step.temperature)
        station.table.check(step.pose.outer_deg, step.pose.inner_deg)
    station.reader.check(recipe.rate_hz)


@dataclass
class CaptureRun(Acquisition):
    """The capture of one lot, record by record, each from its checkpoint."""

    remaining: Remaining = field(kw_only=True)
    progress: Progress = field(kw_only=True)
    approach: Approach | None = None

    def run(self, plan: list[Step]) -> None:
        """Every step that is not done; whatever the station ends the run with is noted, and leaves it safe."""
        done = self.sink.finished()
        self.soundness.refuse_contradicted(self.guard.events.noted())
        self.power.require_on()
        self.identify()
        try:
            self.guard.begin(self.lot.units)
            soak = max((step.soak for step in plan if step.record in done), default=-1) if self.station.exact else -1
            for number, step in enumerate(plan):
                if step.record not in done:
                    self.at = number
                    self.record(step, settled=step.soak <= soak)
                    soak = max(soak, step.soak)
        except (StationError, LeaseLost) as problem:
            self.guard.stopped(self.at, problem)
            raise
        self.progress(len(plan), len(plan), "captured")

    def record(self, step: Step, *, settled: bool) -> None:
        """One record, begun anew from its checkpoint (the soak, then the pose) as often as it takes and is allowed."""
        spoilt = unanswered = 0
        shortest = self.recipe.soak_min_s
        while True:
            try:
                if not settled:
                    self.soak(step, shortest)
                settled = True
                if step.off_s > 0.0:
                    self.tell(step, f"{step.temperature:g} °C, devices off for {step.off_s / 60.0:g} min")
                    self.power.cycle(step)
                self.take(step)
            except Suspended as why:
                spoilt += 1
                self.guard.suspended(step.record, why)
                shortest = self.recipe.soak_min_s if any(r.condition in WARMING for r in why.reasons) else 0.0
                spoilt = self.wait(step, why, spoilt)
                settled = False
            except (StationTimeout, LinkLost) as problem:
                unanswered += 1
                if isinstance(problem, NotReached) or unanswered == LINK_ATTEMPTS:
                    raise
                self.guard.note("suspended", step.record, str(problem), "back to the last checkpoint")
                self.station.clock.sleep(self.guard.watched.rules.poll_s)
                settled, shortest = False, 0.0
            else:
                return

    def wait(self, step: Step, why: Suspended, spoilt: int) -> int:
        """Waits for the end of what suspended a record, and gives how often it may still count as spoilt.

        What lasts and concerns some slots only costs their units; the others go on.
        """
        self.tell(step, f"paused: {why}")
        try:
            self.guard.refuse_too_many(step, why, spoilt)
            self.guard.wait(step.record, why, self.slots, self.noted)
        except StillSuspended as problem:
            slots = {slot for reason in problem.reasons for slot in reason.slots}
            if not all(reason.slots for reason in problem.reasons) or slots >= set(self.slots):
                raise
            for reason in problem.reasons:
                self.lose_slots(reason.slots, LOST_FOR.get(reason.condition, reason.condition))
            return 0
        return spoilt

    def soak(self, step: Step, shortest: float) -> None:
        """Settles the devices at the step's temperature; one that alone does not settle is given up."""
        station, config = self.station, self.station.config
        if config.safety.chamber == "off":
            station.chamber.on()
        if not step.settled:
            station.chamber.set_temperature(step.temperature)
            self.guard.note(
                "soak", step.record, f"soak {step.soak} at {step.temperature:g} °C", "read on the way there"
            )
            return
        self.tell(step, f"soak at {step.temperature:g} °C")
        start = station.clock.now()
        self.approach = Approach(step.temperature)
        try:
            station.soak(step.temperature, shortest, self.slots, lambda: self.settling(step))
        except Unsettled as problem:
            if not problem.slots or set(problem.slots) >= set(self.slots):
                raise
            self.lose_slots(problem.slots, f"does not settle at {step.temperature:g} °C")
        seconds = station.clock.now() - start
        self.remaining.soaked(step, seconds, self.approach if shortest > 0.0 else None)
        figures = {"target_C": step.temperature, "seconds": seconds, **self.approach.figures()}
        self.guard.note("soak", step.record, f"soak {step.soak} at {step.temperature:g} °C", "settled", figures)
        self.approach = None

    def settling(self, step: Step) -> list[float]:
        """The temperatures by slot within a soak, noted; and how far it is."""
        try:
            instruments = self.noted()
            self.guard.soaking(instruments)
        except StationError as problem:
            self.guard.named(problem)
            raise
        if self.approach is not None:
            now, devices = self.station.clock.now(), [instruments.temperature_C[slot] for slot in self.slots]
            self.approach.look(now, self.history.air, devices)
        worst = max((instruments.temperature_C[s] for s in self.slots), key=lambda t: abs(t - step.temperature))
        self.tell(step, f"soak at {step.temperature:g} °C, device at {worst:.1f} °C")
        return instruments.temperature_C

    def tell(self, step: Step, note: str) -> None:
        """Tells how far the capture is, with the station time that is left."""
        left = self.remaining.text(step, self.station.clock.now())
        self.progress(self.at, self.remaining.total, f"{note}, {left}")

    def take(self, step: Step) -> None:
        """Moves, settles, samples and stores one record; what spoiled it is told by :class:`Suspended`."""
        begun = self.station.clock.now()
        self.tell(step, f"{step.temperature:g} °C, {step.kind} {step.pose.name}")
        try:
            self.guard.before(self.slots)
            record = self.measured(step)
        except Suspended:
            self.station.reader.stop()
            raise
        except StationError as problem:
            self.guard.named(problem)
            raise
        samples, readings = self.tables(record)
        self.sink.put(step.record, samples, readings, self.history.taken(), self.station.state(), record.pieces)
        self.remaining.taken(step, self.station.clock.now() - begun)
