"""Capture: drives a station through a recipe and hands every record to a sink; the only place that does."""

from pipelines.capture.acquisition import Acquisition, CaptureSink
from pipelines.capture.look import DWELL_S, Looks, recorded_look
from pipelines.capture.supervision import LINK_ATTEMPTS, LOST_FOR, WARMING, StillSuspended, Supervisor
from pipelines.capture.time_left import Approach, Remaining
from pipelines.schedule.early_end import left_out
from pipelines.schedule.steps import Step, steps
from schemas.errors import LeaseLost, LinkLost, NotReached, StationError, StationTimeout
from schemas.event import EventLog, MemoryLog
from schemas.lot import Lot
from schemas.progress import Progress
from schemas.recipe import Recipe
from stations.safety.suspenders import Suspended
from stations.station import Station, Unsettled


def capture(
    station: Station,
    recipe: Recipe,
    lot: Lot,
    sink: CaptureSink,
    *,
    progress: Progress,
    events: EventLog | None = None,
    looks: Looks | None = None,
) -> None:
    """Takes every record of a recipe that the sink does not have yet, in order.

    The recipe is checked against the station's limits before anything moves. A unit that stops answering is marked in its
    readings; the others continue. A condition that spoils data pauses the run, which returns to its last checkpoint (soak and
    pose) and measures again. A fault that only a person can correct ends the run and leaves the station in its safe state.

    Parameters
    ----------
    events : journal of pauses, repeats and their reasons; kept in memory only where there is none
    looks : decide during the capture whether the rest of the poses is needed; they all are where None
    """
    plan = steps(recipe)
    check(station, recipe, plan)
    supervisor = Supervisor(station, events if events is not None else MemoryLog())
    remaining = Remaining(plan, station.config, recipe)
    CaptureRun(Acquisition(station, recipe, lot, sink, supervisor), remaining, progress, looks).run(plan)


def check(station: Station, recipe: Recipe, plan: list[Step]) -> None:
    """Refuses a recipe outside the station's limits, before anything moves."""
    for step in plan:
        if step.off_s > 0.0:
            station.reader.require_switch()
        station.chamber.check(step.temperature)
        station.table.check(step.pose.outer_deg, step.pose.inner_deg)
        for turn in step.turns:
            station.table.axes[turn.axis].check(turn.to_deg)
        if step.rate_hz is not None and (step.order is None or not step.order.role or step.order.on_table):
            station.reader.check(step.rate_hz)
    station.reader.check(recipe.rate_hz)


class CaptureRun:
    """The capture of one lot, record by record, each from its checkpoint; ``approach`` follows the soak under way."""

    def __init__(
        self, acquisition: Acquisition, remaining: Remaining, progress: Progress, looks: Looks | None = None
    ) -> None:
        self.acquisition, self.remaining, self.progress, self.looks = acquisition, remaining, progress, looks
        self.station, self.supervisor = acquisition.station, acquisition.supervisor
        self.approach: Approach | None = None

    def run(self, plan: list[Step]) -> None:
        """Measures every step that is not stored; an error of the station is journalled and leaves it in its safe state."""
        acquisition, done = self.acquisition, self.acquisition.sink.finished()
        acquisition.plausibility.refuse_contradicted(self.supervisor.events.recorded())
        acquisition.power.require_on()
        acquisition.identify()
        try:
            self.supervisor.begin(acquisition.lot.units)
            soak = max((step.soak for step in plan if step.record in done), default=-1) if self.station.exact else -1
            missing = set[int]()
            for number, step in enumerate(plan):
                if step.record in missing:
                    continue
                if step.record not in done:
                    acquisition.at = number
                    self.record(step, settled=step.soak <= soak)
                    soak = max(soak, step.soak)
                if not missing and self.looks is not None and self.looks.due(step.record):
                    missing = self.look(plan, number, self.looks, passed=step.record < max(done, default=-1))
        except (StationError, LeaseLost) as problem:
            self.supervisor.stop(acquisition.at, problem)
            raise
        self.progress(len(plan), len(plan), "captured")

    def look(self, plan: list[Step], number: int, looks: Looks, *, passed: bool) -> set[int]:
        """Looks at the records so far, once for each; gives the records that are not needed any more.

        passed : whether the capture has gone on since, so that the journal alone says what was decided
        """
        step, supervisor, acquisition = plan[number], self.supervisor, self.acquisition
        look = recorded_look(supervisor.events.recorded(), step.record)
        if look is None and not passed:
            self.report(step, "comparing the records so far with what is asked for")
            known = frozenset(
                event.action.split()[1] for event in supervisor.events.recorded() if event.kind == "fails"
            )
            look = looks.look(step.record, known)
            for serial, sentence in look.fails.items():
                supervisor.note("fails", step.record, sentence, f"unit {serial} fails already, the others go on")
                self.report(step, f"unit {serial} fails already: {sentence}")
            for effect in look.given_up if look.known else ():
                supervisor.note("given_up", step.record, "the whole plan would show it", effect)
            missing = f"{len(left_out(plan, number))} records not taken" if look.known else "the lot goes on"
            figures = {} if look.dwell_s is None else {DWELL_S: look.dwell_s}
            supervisor.note("known" if look.known else "look", step.record, look.text, missing, figures)
        if look is None:
            return set()
        acquisition.dwell_s = look.dwell_s or acquisition.dwell_s
        if not look.known:
            return set()
        missing_steps = left_out(plan, number)
        self.remaining.leave_out({skipped.record for skipped in missing_steps})
        return {skipped.record for skipped in missing_steps}

    def record(self, step: Step, *, settled: bool) -> None:
        """Measures one record; after an interruption again from its checkpoint, as often as the station's file allows."""
        spoilt = unanswered = 0
        shortest = self.acquisition.recipe.soak_min_s
        while True:
            try:
                if not settled:
                    self.soak(step, shortest)
                settled = True
                if step.off_s > 0.0:
                    self.report(step, f"{step.temperature:g} °C, devices off for {step.off_s / 60.0:g} min")
                    self.acquisition.power.cycle(step)
                self.measure_and_store(step)
            except Suspended as why:
                spoilt += 1
                self.supervisor.note_interruption(step.record, why)
                warms = any(reason.condition in WARMING for reason in why.reasons)
                shortest = self.acquisition.recipe.soak_min_s if warms else 0.0
                spoilt = self.wait(step, why, spoilt)
                settled = False
            except (StationTimeout, LinkLost) as problem:
                unanswered += 1
                if isinstance(problem, NotReached) or unanswered == LINK_ATTEMPTS:
                    raise
                self.supervisor.note("suspended", step.record, str(problem), "back to the last checkpoint")
                self.station.clock.sleep(self.supervisor.watched.rules.poll_s)
                settled, shortest = False, 0.0
            else:
                return

    def wait(self, step: Step, why: Suspended, spoilt: int) -> int:
        """Waits until the condition has ended, and returns how many times the record counts as spoilt.

        A condition that does not end and concerns some slots only gives up their units; the others continue.
        """
        acquisition = self.acquisition
        self.report(step, f"paused: {why}")
        try:
            self.supervisor.refuse_too_many(step, why, spoilt)
            self.supervisor.wait(step.record, why, acquisition.slots, acquisition.read_instruments)
        except StillSuspended as problem:
            slots = {slot for reason in problem.reasons for slot in reason.slots}
            if not all(reason.slots for reason in problem.reasons) or slots >= set(acquisition.slots):
                raise
            for reason in problem.reasons:
                acquisition.give_up_slots(reason.slots, LOST_FOR.get(reason.condition, reason.condition))
            return 0
        return spoilt

    def soak(self, step: Step, shortest: float) -> None:
        """Settles the devices at the step's temperature; a device that alone does not settle is given up."""
        station, config, acquisition = self.station, self.station.config, self.acquisition
        name = f"soak {step.soak} at {step.temperature:g} °C"
        if config.safety.chamber == "off":
            station.chamber.on()
        if not step.settled:
            station.chamber.set_temperature(step.temperature)
            self.supervisor.note("soak", step.record, name, "read on the way there")
            return
        self.report(step, f"soak at {step.temperature:g} °C")
        start = station.clock.now()
        self.approach = Approach(step.temperature)
        try:
            station.soak(step.temperature, shortest, acquisition.slots, lambda: self.observe_soak(step))
        except Unsettled as problem:
            if not problem.slots or set(problem.slots) >= set(acquisition.slots):
                raise
            acquisition.give_up_slots(problem.slots, f"does not settle at {step.temperature:g} °C")
        seconds = station.clock.now() - start
        self.remaining.add_soak(step, seconds, self.approach if shortest > 0.0 else None)
        figures = {"target_C": step.temperature, "seconds": seconds, **self.approach.figures()}
        self.supervisor.note("soak", step.record, name, "settled", figures)
        self.approach = None

    def observe_soak(self, step: Step) -> list[float]:
        """The temperatures by slot during a soak, °C; logs them and reports the progress."""
        acquisition = self.acquisition
        try:
            instruments = acquisition.read_instruments()
            self.supervisor.check_soak(instruments)
        except StationError as problem:
            self.supervisor.raise_operator_cause(problem)
            raise
        temperatures = instruments.temperature_C
        if self.approach is not None:
            devices = [temperatures[slot] for slot in acquisition.slots]
            self.approach.add(self.station.clock.now(), acquisition.history.air, devices)
        farthest = max((temperatures[s] for s in acquisition.slots), key=lambda t: abs(t - step.temperature))
        self.report(step, f"soak at {step.temperature:g} °C, device at {farthest:.1f} °C")
        return temperatures

    def report(self, step: Step, note: str) -> None:
        """Reports the progress with the remaining station time."""
        left = self.remaining.text(step, self.station.clock.now())
        self.progress(self.acquisition.at, self.remaining.total, f"{note}, {left}")

    def measure_and_store(self, step: Step) -> None:
        """Measures one record and stores it.

        Raises
        ------
        Suspended : a condition spoiled the record
        """
        acquisition, begun = self.acquisition, self.station.clock.now()
        self.report(step, f"{step.temperature:g} °C, {step.kind} {step.pose.name}")
        try:
            self.supervisor.check_before(acquisition.slots)
            record, samples, readings = acquisition.measure(step)
        except Suspended:
            self.station.reader.stop()
            raise
        except StationError as problem:
            self.supervisor.raise_operator_cause(problem)
            raise
        history, state = acquisition.history.drain(), self.station.state()
        acquisition.sink.put(step.record, samples, readings, history, state, record.pieces)
        self.remaining.add_record(step, self.station.clock.now() - begun)
