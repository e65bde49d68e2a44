"""The guard of a capture: conditions that pause it, the way back to the last checkpoint, and the journal of all that."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from schemas.errors import LeaseLost, OperatorNeeded, StationError
from schemas.event import NO_RECORD, Event, EventLog
from stations.safety.suspenders import EmergencyStop, Reason, Suspended, Watched, require_released

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from pipelines.schedule.steps import Step
    from schemas.event import Kind
    from schemas.recipe import Pose, Unit
    from stations.devices.reader import Instruments
    from stations.station import Station

LINK_ATTEMPTS = 3  # times a record is begun anew after a device did not answer; each costs its time-outs
FEWEST_SAMPLES = 0.99  # part of the samples that a record should have
LASTING = {"door", "vibration", "supply"}  # waited for; what is settled anew or measured anew needs no waiting
WARMING = {"door", "chamber", "device", "supply", "clock"}  # after these the shortest soak counts from its beginning
LOST_FOR = {"supply": "supply out of tolerance", "device": "left its temperature", "samples": "samples missing"}
VOLT = "_V"
CLOCK_S = 1.0  # by which the clocks of station and reader may differ; a slow link costs less
CLOCK_PART = 1e-3


@dataclass
class Supervisor:
    """Watches the station while a capture runs; ``watched`` are the rules, once the run has begun."""

    station: Station
    events: EventLog
    watched: Watched = field(init=False)
    clocks: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        config = self.station.config
        self.watched = Watched(config.suspenders, config.soak, {})

    def begin(self, units: Sequence[Unit]) -> None:
        """Notes the supplies from which later ones may not differ; a resumed run goes by those of its beginning."""
        config = self.station.config
        known = [event for event in self.past() if event.kind == "reference"]
        if known:
            figures = known[0].figures
        else:
            supply = self.station.reader.instruments().supply_V
            figures = {f"slot_{unit.slot}{VOLT}": supply[unit.slot] for unit in units}
            self.note(
                "reference", NO_RECORD, "supplies as the run begins", "later ones are compared with them", figures
            )
        reference = {int(name.removeprefix("slot_").removesuffix(VOLT)): volt for name, volt in figures.items()}
        self.watched = Watched(config.suspenders, config.soak, reference)

    def past(self) -> list[Event]:
        """Events until now: a simulated run that was killed goes on before some of them happen again."""
        now = self.station.clock.now()
        return [event for event in self.events.noted() if event.time_s <= now]

    def before(self, slots: Sequence[int]) -> None:
        """Suspends a record that should not begin now."""
        self.station.require()
        instruments = self.station.reader.instruments()
        require_released(instruments)
        reasons = self.watched.around(instruments, slots)
        if reasons:
            raise Suspended(reasons, spoilt=False)

    def require_steady_clocks(self, *, spoilt: bool) -> None:
        """Suspends what is under way where the station's clock and the reader's have gone apart since the last look.

        One of them jumped, or the reader and the devices in it were without power for a moment.
        """
        now, powered = self.station.clock.now(), self.station.reader.since_power()
        before, self.clocks = self.clocks, (now, powered)
        if before is None:
            return
        ours, theirs = now - before[0], powered - before[1]
        if not abs(ours - theirs) <= CLOCK_S + CLOCK_PART * abs(theirs):
            text = f"{ours:.1f} s have passed by the station's clock and {theirs:.1f} s by the reader's, the same is needed"
            raise Suspended([Reason("clock", text)], spoilt=spoilt)

    def soaking(self, instruments: Instruments) -> None:
        """Suspends a soak while the door is open or a clock jumps; what only spoils records does not matter yet."""
        self.station.require()
        self.require_steady_clocks(spoilt=False)
        require_released(instruments)
        reasons = [reason for reason in self.watched.around(instruments, ()) if reason.condition == "door"]
        if reasons:
            raise Suspended(reasons, spoilt=False)

    def during(
        self,
        pose: Pose,
        target: float | None,
        angles: tuple[float, float],
        air: float,
        look: Instruments,
        slots: Sequence[int],
    ) -> None:
        """Suspends a record in which something is not as it must be; it is spoilt then.

        Parameters
        ----------
        target : °C at which air and devices must be; None where they are read on their way
        """
        self.station.require()
        require_released(look)
        reasons = [
            *self.watched.around(look, slots),
            *([] if target is None else self.watched.thermal(target, air, look, slots)),
            *self._table(pose, angles),
        ]
        if reasons:
            raise Suspended(reasons, spoilt=True)

    def _table(self, pose: Pose, angles: tuple[float, float]) -> list[Reason]:
        """Axes that do not stand where they were told; one that still says so when it is asked again needs a person."""
        away = self._away(pose, angles)
        if away and (still := self._away(pose, self.station.table.angles())):
            raise OperatorNeeded(
                f"{still[0].text}, and nothing moved it: either the axis was pushed or its zero is lost; look at the table, home "
                "the axis at the drive and check its zero"
            )
        return away

    def _away(self, pose: Pose, angles: tuple[float, float]) -> list[Reason]:
        allowed = self.station.config.limits.position_deg
        wanted = (("outer", pose.outer_deg, angles[0]), ("inner", pose.inner_deg, angles[1]))
        return [
            Reason("table", f"{name} axis at {found:.4f} deg, {target:g} ± {allowed:g} deg is needed")
            for name, target, found in wanted
            if not abs(found - target) <= allowed
        ]

    def suspended(self, record: int, why: Suspended) -> None:
        """Notes why a record is measured again, or why the run waits."""
        kind = "spoilt" if why.spoilt else "suspended"
        action = "thrown away; " if why.spoilt else ""
        self.note(kind, record, str(why), f"{action}back to the last checkpoint")

    def refuse_too_many(self, step: Step, why: Suspended, spoilt: int) -> None:
        """Gives a record up that was spoilt as often as it may be."""
        if spoilt >= self.watched.rules.attempts:
            raise StillSuspended(f"record {step.record} (pose {step.pose.name}) spoilt {spoilt} times", why)

    def wait(self, record: int, why: Suspended, slots: Sequence[int], observe: Callable[[], Instruments]) -> None:
        """Comes back when the conditions have been gone for long enough; :class:`OperatorNeeded` when they never go."""
        rules, clock = self.watched.rules, self.station.clock
        if not any(reason.condition in LASTING for reason in why.reasons):
            return
        start = clock.now()
        clear = start
        while True:
            self.station.require()
            instruments = observe()
            require_released(instruments)
            reasons, now = self.watched.around(instruments, slots), clock.now()
            if reasons:
                clear, why = now, Suspended(reasons, spoilt=False)
            elif now - clear >= rules.clear_s:
                self.note(
                    "resumed",
                    record,
                    f"gone for {rules.clear_s:g} s",
                    "settled anew, then measured",
                    {"paused_s": round(now - start, 3)},
                )
                return
            if now - start > rules.limit_s:
                raise StillSuspended(f"paused for {now - start:.0f} s", why)
            clock.sleep(rules.poll_s)

    def named(self, problem: StationError) -> None:
        """Raises what a person has done to the station, where that is why something failed."""
        try:
            instruments = self.station.reader.instruments()
        except StationError:
            return
        require_released(instruments)
        if self.watched.rules.door and instruments.door_open:
            text = f"the chamber's door is open, closed is needed ({problem})"
            raise Suspended([Reason("door", text)], spoilt=True)

    def stopped(self, record: int, problem: StationError | LeaseLost) -> None:
        """Leaves the station in its safe state and notes why the run ended; :class:`LeaseLost` where it may command no more."""
        kind = "emergency_stop" if isinstance(problem, EmergencyStop) else "stopped"
        try:
            reached = self.station.make_safe()
        except LeaseLost as lost:  # whatever it found at a station that is not its own any more is not why it ended
            action = "nothing more was sent: its watchdog, or the run that has the station now, sees to it"
            self.note("stopped", record, str(lost), action)
            raise lost from problem
        self.note(kind, record, str(problem), reached.sentence())

    def note(self, kind: Kind, record: int, reason: str, action: str, figures: dict[str, float] | None = None) -> None:
        """Keeps an event, at the station's time."""
        time = round(self.station.clock.now(), 6)
        self.events.note(Event(time, kind, record, reason, action, figures or {}))


class StillSuspended(OperatorNeeded):
    """A condition that did not go in time, or spoiled a record too often; ``reasons`` say which."""

    def __init__(self, what: str, why: Suspended) -> None:
        self.reasons = why.reasons
        super().__init__(
            f"station: {what}: {why}; put it right and give the command again: nothing that was measured is lost"
        )


def short_of_samples(counts: dict[int, int], overflow: set[int], duration: float, rate: float) -> list[Reason]:
    """Slots whose record lacks samples: counts by slot against what ``duration`` s at ``rate`` Hz should give."""
    wanted = int(duration * rate + 1e-6)
    found = {slot: n for slot, n in counts.items() if n < FEWEST_SAMPLES * wanted - 1.0 or slot in overflow}
    if not found:
        return []
    slot = min(found)
    more = f" (and {len(found) - 1} more slots)" if len(found) > 1 else ""
    what = "samples lost in the reader's memory" if slot in overflow else f"{found[slot]} samples of {wanted}"
    return [Reason("samples", f"slot {slot}: {what}, all are needed{more}", tuple(found))]
