"""Supervision of a capture: conditions that pause it, the journal of pauses, repeats and their reasons, and power orders."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

from pipelines.schedule.steps import Step
from schemas.errors import LeaseLost, OperatorNeeded, StationError
from schemas.event import NO_RECORD, Event, EventLog, Kind
from schemas.lot import Unit
from schemas.poses import Pose
from stations.devices.reader import Instruments
from stations.safety.suspenders import EmergencyStop, Reason, Suspended, Watched, require_released
from stations.station import Station

LINK_ATTEMPTS = 3  # attempts at a record whose device does not answer; each takes its time-outs
FEWEST_SAMPLES = 0.99  # smallest part of the expected samples
LASTING = {"door", "vibration", "supply"}  # end by themselves and are waited for; the others with a new soak or record
WARMING = {"door", "chamber", "device", "supply", "clock"}  # after these the shortest soak starts again
LOST_FOR = {"supply": "supply out of tolerance", "device": "left its temperature", "samples": "samples missing"}
VOLT = "_V"
CLOCK_S = 1.0  # by which the clocks of station and reader may differ; a slow link costs less
CLOCK_PART = 1e-3
TWICE = 2.0  # the reader's clock over the station's: no lost power does that, a simulated station served faster does


@dataclass
class Supervisor:
    """Checks the station while a capture runs; ``watched`` are the rules, with the supplies at the start."""

    station: Station
    events: EventLog
    watched: Watched = field(init=False)
    clocks: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        config = self.station.config
        self.watched = Watched(config.suspenders, config.soak, {})

    def begin(self, units: Sequence[Unit]) -> None:
        """Journals the supplies at the start, the reference of later checks; a resumed run uses those of its first start."""
        config = self.station.config
        if known := self.past("reference"):
            figures = known[0].figures
        else:
            supply = self.station.reader.instruments().supply_V
            figures = {f"slot_{unit.slot}{VOLT}": supply[unit.slot] for unit in units}
            self.note("reference", NO_RECORD, "supplies at the start", "reference of later supplies", figures)
        reference = {int(name.removeprefix("slot_").removesuffix(VOLT)): volt for name, volt in figures.items()}
        supply = config.fitted().get("power_supply")
        most = math.inf if supply is None else supply.maximum.get("voltage", math.inf)
        self.watched = Watched(config.suspenders, config.soak, reference, most_V=most)

    def expect_supply(self, ratio: float) -> None:
        """The devices' supply that later checks expect, over that at the start: a procedure may set it."""
        self.watched = replace(self.watched, supply_ratio=ratio)

    def past(self, kind: Kind) -> list[Event]:
        """Events of a kind until now: a simulated run that was killed resumes at an earlier time than its last events."""
        now = self.station.clock.now()
        return [event for event in self.events.recorded() if event.kind == kind and event.time_s <= now]

    def check_before(self, slots: Sequence[int]) -> None:
        """Suspends a record before it starts, where a condition holds."""
        self.station.require()
        instruments = self.station.reader.instruments()
        require_released(instruments)
        if reasons := self.watched.instrument_reasons(instruments, slots):
            raise Suspended(reasons, spoilt=False)

    def require_steady_clocks(self, *, spoilt: bool) -> None:
        """Suspends where the station's clock and the reader's clock have diverged since the last check.

        One of them jumped, or the reader and its devices lost their power for a moment.
        """
        now, powered = self.station.clock.now(), self.station.reader.since_power()
        before, self.clocks = self.clocks, (now, powered)
        if before is None:
            return
        ours, theirs = now - before[0], powered - before[1]
        answers = max(1.0, self.station.config.link.speed)  # of a served station come later by its own time
        if not abs(ours - theirs) <= answers * CLOCK_S + CLOCK_PART * abs(theirs):
            text = f"station's clock advanced {ours:.1f} s, reader's clock {theirs:.1f} s, equal times are needed"
            if theirs > TWICE * ours > 0.0:
                text += "; a station that 'tumbleline station serve --speed' serves needs the same speed in [link] of its file"
            raise Suspended([Reason("clock", text)], spoilt=spoilt)

    def check_soak(self, instruments: Instruments) -> None:
        """Suspends a soak while the door is open, or after a jump of a clock; other conditions concern records only."""
        self.station.require()
        self.require_steady_clocks(spoilt=False)
        require_released(instruments)
        reasons = [reason for reason in self.watched.instrument_reasons(instruments, ()) if reason.condition == "door"]
        if reasons:
            raise Suspended(reasons, spoilt=False)

    def check_during(
        self,
        pose: Pose | None,
        target: float | None,
        angles: tuple[float, float],
        air: float,
        look: Instruments,
        slots: Sequence[int],
    ) -> None:
        """Suspends a record during which a condition holds; the record is spoilt.

        Parameters
        ----------
        pose : where the table stands; None while it turns
        target : required temperature of air and devices, °C; None for a record on the way to it
        """
        self.station.require()
        require_released(look)
        reasons = [
            *self.watched.instrument_reasons(look, slots),
            *([] if target is None else self.watched.thermal_reasons(target, air, look, slots)),
            *([] if pose is None else self._table(pose, angles)),
        ]
        if reasons:
            raise Suspended(reasons, spoilt=True)

    def _table(self, pose: Pose, angles: tuple[float, float]) -> list[Reason]:
        """Axes away from their commanded angles; an axis that a second reading confirms needs an operator."""
        away = self._away(pose, angles)
        if away and (still := self._away(pose, self.station.table.angles())):
            raise OperatorNeeded(
                f"{still[0].text}, without a move: the axis was pushed or its zero is lost; check the table, home the "
                "axis at the drive and check its zero"
            )
        return away

    def _away(self, pose: Pose, angles: tuple[float, float]) -> list[Reason]:
        allowed = self.station.config.limits.position_deg
        axes = (("outer", pose.outer_deg, angles[0]), ("inner", pose.inner_deg, angles[1]))
        return [
            Reason("table", f"{name} axis at {angle:.4f} deg, {target:g} ± {allowed:g} deg is needed")
            for name, target, angle in axes
            if not abs(angle - target) <= allowed
        ]

    def note_interruption(self, record: int, why: Suspended) -> None:
        """Journals why a record is measured again, or why the run waits."""
        kind = "spoilt" if why.spoilt else "suspended"
        action = "record discarded; " if why.spoilt else ""
        self.note(kind, record, str(why), f"{action}back to the last checkpoint")

    def refuse_too_many(self, step: Step, why: Suspended, spoilt: int) -> None:
        """Ends the run where a record was spoilt as often as the station's file allows."""
        if spoilt >= self.watched.rules.attempts:
            raise StillSuspended(f"record {step.record} (pose {step.pose.name}) spoilt {spoilt} times", why)

    def wait(self, record: int, why: Suspended, slots: Sequence[int], observe: Callable[[], Instruments]) -> None:
        """Waits until the conditions have been absent for ``clear_s``; :class:`StillSuspended` after ``limit_s``."""
        rules, clock = self.watched.rules, self.station.clock
        if not any(reason.condition in LASTING for reason in why.reasons):
            return
        start = clear = clock.now()
        while True:
            self.station.require()
            instruments = observe()
            require_released(instruments)
            reasons, now = self.watched.instrument_reasons(instruments, slots), clock.now()
            if reasons:
                clear, why = now, Suspended(reasons, spoilt=False)
            elif now - clear >= rules.clear_s:
                figures = {"paused_s": round(now - start, 3)}
                self.note("resumed", record, f"absent for {rules.clear_s:g} s", "soaked again, then measured", figures)
                return
            if now - start > rules.limit_s:
                long = f"{now - start:.0f} s" if now - start < 600.0 else f"{(now - start) / 60.0:.0f} min"
                raise StillSuspended(f"paused for {long}", why)
            clock.sleep(rules.poll_s)

    def raise_operator_cause(self, problem: StationError) -> None:
        """Raises the emergency stop or the open door in place of an error that one of them may have caused."""
        try:
            instruments = self.station.reader.instruments()
        except StationError:
            return
        require_released(instruments)
        if self.watched.rules.door and instruments.door_open:
            text = f"the chamber's door is open, closed is needed ({problem})"
            raise Suspended([Reason("door", text)], spoilt=True)

    def stop(self, record: int, problem: StationError | LeaseLost) -> None:
        """Leaves the station in its safe state and journals the reason; :class:`LeaseLost` where the run has lost the station."""
        kind = "emergency_stop" if isinstance(problem, EmergencyStop) else "stopped"
        try:
            reached = self.station.make_safe()
        except LeaseLost as lost:  # the lost lease is the reason, not an error at a station that another run drives
            action = "no further command was sent: the watchdog, or the run that has the station now, makes it safe"
            self.note("stopped", record, str(lost), action)
            raise lost from problem
        self.note(kind, record, str(problem), reached.sentence())

    def note(self, kind: Kind, record: int, reason: str, action: str, figures: dict[str, float] | None = None) -> None:
        """Journals an event at the station's time."""
        time = round(self.station.clock.now(), 6)
        self.events.note(Event(time, kind, record, reason, action, figures or {}))


class StillSuspended(OperatorNeeded):
    """A condition that did not end in time, or spoiled a record too often; ``reasons`` says which."""

    def __init__(self, what: str, why: Suspended) -> None:
        self.reasons = why.reasons
        self._condition = f"station: {what}: {why}; correct it"
        super().__init__(f"{self._condition} and give the command again: no measured record is lost")

    @property
    def condition(self) -> str:
        """The condition without the advice to give the command again."""
        return self._condition


def short_of_samples(counts: dict[int, int], overflow: set[int], duration: float, rate: float) -> list[Reason]:
    """Slots whose record lacks samples: counts by slot against ``duration`` s at ``rate`` Hz."""
    expected = int(duration * rate + 1e-6)
    short = {slot: n for slot, n in counts.items() if n < FEWEST_SAMPLES * expected - 1.0 or slot in overflow}
    if not short:
        return []
    slot = min(short)
    more = f" (and {len(short) - 1} more slots)" if len(short) > 1 else ""
    what = "samples lost in the reader's memory" if slot in overflow else f"{short[slot]} samples of {expected}"
    return [Reason("samples", f"slot {slot}: {what}, all are needed{more}", tuple(short))]


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
        last = self.supervisor.past("power")
        left = last[-1] if last and OFF_S not in last[-1].figures else None
        reader.switch("on")
        seconds = 0.0 if left is None else self.station.clock.now() - left.time_s
        record = NO_RECORD if left is None else left.record
        self._on_again(record, seconds, "the devices had no power when the run resumed")

    def off_before(self, step: Step) -> float:
        """Time without power directly before a record, s; 0 where the devices were not off."""
        events = [event for event in self.supervisor.past("power") if OFF_S in event.figures]
        return {event.record: event.figures[OFF_S] for event in events}.get(step.record, 0.0)

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
