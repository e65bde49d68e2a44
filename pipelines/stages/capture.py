"""Capture: drives a station through a recipe and hands every record to a sink; the only place that does."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal, Protocol

import numpy as np
import pandas as pd

from pipelines.stages.approach import Approach
from pipelines.stages.captured import History, Record, readings_row
from pipelines.stages.guard import LINK_ATTEMPTS, LOST_FOR, WARMING, Guard, StillSuspended, short_of_samples
from pipelines.stages.remaining import Remaining
from pipelines.stages.soundness import Soundness
from schemas.errors import LinkLost, NotReached, OperatorNeeded, StationError, StationTimeout
from schemas.event import NO_RECORD, MemoryLog
from stations.devices.slot import SamplesLost
from stations.safety.suspenders import Reason, Suspended
from stations.station import Unsettled

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from pipelines.progress import Progress
    from schemas.event import EventLog
    from schemas.recipe import Lot, Pose, Recipe, Unit
    from stations.devices.reader import Instruments
    from stations.devices.slot import Identity
    from stations.station import Station

Kind = Literal["dwell", "verification", "allan"]

OBSERVATIONS = 5  # looks at encoders and instruments within a dwell
HISTORY_S = 10.0
OK = "ok"
LONG_ROWS = 1_000_000  # samples of a record that lie in memory together; of a longer one they are stored in pieces
PIECE_ROWS = 250_000
FILL = 0.5  # part of the slots' memory that may fill before it is emptied


class CaptureSink(Protocol):
    """Where records go: each is stored whole, or not at all."""

    def finished(self) -> set[int]:
        """Numbers of the records that are stored."""
        ...

    def part(self, record: int, number: int, samples: pd.DataFrame) -> None:
        """Stores a part of the samples of a long record ahead of the rest; part 0 begins anew."""
        ...

    def put(
        self,
        record: int,
        samples: pd.DataFrame,
        readings: pd.DataFrame,
        history: pd.DataFrame,
        station_state: bytes,
        parts: int = 0,
    ) -> None:
        """Stores a record durably, with the station's state after it; ``parts`` of its samples are stored already."""
        ...

    def last_state(self) -> bytes | None:
        """The station's state after the record that was stored last."""
        ...


@dataclass(frozen=True)
class Step:
    """One record to take: its number, what it is for, the soak that it belongs to, and the pose.

    wait_s : after the move; the recipe's where None
    settled : whether the devices settle at the soak's temperature first, or are read while they follow the chamber
    """

    record: int
    kind: Kind
    soak: int
    temperature: float
    pose: Pose
    wait_s: float | None = None
    settled: bool = True


def steps(recipe: Recipe) -> list[Step]:
    """Every record of a recipe in order: per temperature the poses, then those for verification; the static record last.

    The static record has a soak of its own, unless it is taken at the last temperature.
    """
    found: list[Step] = []
    for soak, temperature in enumerate(recipe.temperatures_C):
        poses, waits, settled = recipe.poses_at(soak), recipe.waits_at(soak), recipe.settles_at(soak)
        for pose, wait in zip(poses, waits, strict=True):
            found.append(Step(len(found), "dwell", soak, temperature, pose, wait, settled))
        for pose in recipe.verification_at(soak):
            found.append(Step(len(found), "verification", soak, temperature, pose, settled=settled))
    if recipe.static_record_s > 0.0:
        again = recipe.static_temperature_C == recipe.temperatures_C[-1]
        soak = len(recipe.temperatures_C) - (1 if again else 0)
        found.append(Step(len(found), "allan", soak, recipe.static_temperature_C, recipe.static_pose))
    return found


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
    guard = Guard(station, events if events is not None else MemoryLog())
    work = _Work(station, recipe, lot, sink, guard, Remaining(plan, station.config, recipe), progress)
    work.run(plan)


def check(station: Station, recipe: Recipe, plan: list[Step]) -> None:
    """Refuses a recipe that the station may not do; nothing has moved then."""
    for step in plan:
        station.chamber.check(step.temperature)
        station.table.check(step.pose.outer_deg, step.pose.inner_deg)
    station.reader.check(recipe.rate_hz)


def fault_text(slot: int, problem: StationError) -> str:
    """What readings say of a unit that is lost; the same whenever it is asked, so that a resumed run says it too."""
    if isinstance(problem, StationTimeout):
        return f"slot {slot}: no answer"
    if isinstance(problem, LinkLost):
        return f"slot {slot}: link lost"
    return f"slot {slot}: implausible answer"


@dataclass
class _Work:
    """The capture of one lot: who still answers, and the history since the last record."""

    station: Station
    recipe: Recipe
    lot: Lot
    sink: CaptureSink
    guard: Guard
    remaining: Remaining
    progress: Progress
    history: History = field(default_factory=History)
    lost: dict[str, str] = field(default_factory=dict)
    identities: dict[str, Identity] = field(default_factory=dict)
    approach: Approach | None = None
    soundness: Soundness = field(init=False)
    at: int = NO_RECORD

    def __post_init__(self) -> None:
        """Data are judged by what the slots say of their units."""
        self.soundness = Soundness(self.station.reader, self.identities)

    def run(self, plan: list[Step]) -> None:
        """Every step that is not done; whatever the station ends the run with is noted, and leaves it safe."""
        done = self.sink.finished()
        self.identify()
        try:
            self.guard.begin(self.lot.units)
            soak = max((step.soak for step in plan if step.record in done), default=-1) if self.station.exact else -1
            for number, step in enumerate(plan):
                if step.record not in done:
                    self.at = number
                    self.record(step, settled=step.soak <= soak)
                    soak = max(soak, step.soak)
        except StationError as problem:
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
                self.lose_slots(reason.slots, LOST_FOR[reason.condition])
            return 0
        return spoilt

    @property
    def slots(self) -> list[int]:
        """Slots whose units still answer."""
        return [unit.slot for unit in self.lot.units if unit.serial not in self.lost]

    @property
    def answering(self) -> list[Unit]:
        """Units that still answer."""
        return [unit for unit in self.lot.units if unit.serial not in self.lost]

    def lose(self, serial: str, text: str) -> None:
        """Gives a unit up; its readings say why, in a resumed run too."""
        self.lost[serial] = text
        self.guard.note("unit_lost", max(self.at, 0), text, f"unit {serial} is refused, the others go on")
        if not self.answering and self.at != NO_RECORD:
            message = (
                f"reader: no unit of the lot is left ({text}), one is needed at least; check reader, power and cables"
            )
            raise OperatorNeeded(message)

    def lose_slots(self, slots: Sequence[int], text: str) -> None:
        """Gives the units of these slots up."""
        for unit in self.lot.units:
            if unit.slot in slots and unit.serial not in self.lost:
                self.lose(unit.serial, f"slot {unit.slot}: {text}")

    def identify(self) -> None:
        """Asks every slot who sits in it; another serial than the lot's stops the run before anything is measured."""
        lost = {event.action.split()[1]: event.reason for event in self.guard.past() if event.kind == "unit_lost"}
        for unit in self.lot.units:
            try:
                identity = self.station.reader.slots[unit.slot].identity()
            except StationError as problem:
                if unit.serial in lost:
                    self.lost[unit.serial] = lost[unit.serial]
                else:
                    self.lose(unit.serial, fault_text(unit.slot, problem))
                continue
            if identity.serial != unit.serial:
                message = (
                    f"slot {unit.slot}: '{identity.serial}' sits there, '{unit.serial}' is needed; "
                    "seat the unit, or correct the lot"
                )
                raise OperatorNeeded(message)
            self.identities[unit.serial] = identity
            if unit.serial in lost:
                self.lost[unit.serial] = lost[unit.serial]
        if not self.identities:
            message = "reader: no unit of the lot answers, one is needed at least; check reader, power and cables"
            raise OperatorNeeded(message)

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

    def noted(self) -> Instruments:
        """The instruments, noted in the history when it is due."""
        instruments = self.station.reader.instruments()
        self.note(instruments)
        return instruments

    def note(self, instruments: Instruments) -> None:
        """Notes the temperatures in the history when it is due."""
        now = self.station.clock.now()
        if self.history.due(now, HISTORY_S):
            self.history.add(now, self.station.chamber.temperature(), self.lot.units, instruments.temperature_C)

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

    def measured(self, step: Step) -> Record:
        """One record, whole; conditions were as they must be before, while and when it was taken."""
        station, recipe = self.station, self.recipe
        station.table.move(step.pose.outer_deg, step.pose.inner_deg)
        self.rest(recipe.settle_s if step.wait_s is None else step.wait_s)
        self.guard.before(self.slots)
        self.guard.require_steady_clocks(spoilt=False)
        duration = recipe.static_record_s if step.kind == "allan" else recipe.dwell_s
        powered = station.reader.since_power()
        station.reader.start(recipe.rate_hz)
        record = Record(step.record, step.kind, step.pose, step.soak, station.clock.now(), duration, recipe.rate_hz)
        record.since_move = record.start + duration / 2.0 - station.table.still_since  # in the middle, as the mean is
        record.since_power = powered + duration / 2.0
        for _ in self._spans(record):
            self.observe(step, record)
            self.empty(record)
            if duration * recipe.rate_hz * len(self.slots) > LONG_ROWS and record.rows() >= PIECE_ROWS:
                self.soundness.refuse_strays(record, self.answering)
                self.sink.part(step.record, record.pieces, record.piece(self.answering))
        station.reader.stop()
        self.empty(record)
        self.guard.require_steady_clocks(spoilt=True)
        for unit, problem in self.soundness.others(self.answering):
            self.lose(unit.serial, fault_text(unit.slot, problem))
        counts = {u.slot: record.count(u.serial) for u in self.lot.units if u.serial not in self.lost}
        overflow = {u.slot for u in self.lot.units if u.serial not in self.lost and record.overflow(u.serial)}
        reasons = short_of_samples(counts, overflow, duration, recipe.rate_hz)
        if reasons:
            raise Suspended(reasons, spoilt=True)
        self.soundness.refuse_strays(record, self.answering)
        if step.kind != "allan" and step.settled:
            self.soundness.refuse_contradiction(record, self.answering)
        return record

    def rest(self, seconds: float) -> None:
        """Lets the devices come to rest after a move, and keeps the history of a long wait."""
        clock = self.station.clock
        end = clock.now() + seconds
        while end - clock.now() > HISTORY_S:
            clock.sleep(HISTORY_S)
            self.noted()
        clock.sleep(end - clock.now())

    def _spans(self, record: Record) -> Iterator[float]:
        """Sleeps through a record in spans, short enough for the slots' memories and for the history."""
        memory = min(identity.capacity for identity in self.identities.values()) / record.rate * FILL
        longest = min(HISTORY_S, memory, record.duration / OBSERVATIONS)
        count = int(np.ceil(record.duration / longest - 1e-9))
        for number in range(count):
            end = record.start + record.duration * (number + 1) / count
            self.station.clock.sleep(end - self.station.clock.now())
            yield end

    def observe(self, step: Step, record: Record) -> None:
        """Notes encoders and instruments; a condition that holds now has spoilt the record."""
        station = self.station
        angles, air, instruments = station.table.angles(), station.chamber.temperature(), station.reader.instruments()
        self.note(instruments)
        target = step.temperature if step.settled else None
        self.guard.during(step.pose, target, angles, air, instruments, self.slots)
        record.look(angles, air, instruments)

    def empty(self, record: Record) -> None:
        """Takes what the slots have sampled; a slot that does not answer any more is not asked again."""
        for unit in self.lot.units:
            if unit.serial not in self.lost:
                try:
                    record.keep(unit.serial, self.station.reader.slots[unit.slot].take())
                except SamplesLost as problem:
                    raise Suspended([Reason("samples", str(problem), (unit.slot,))], spoilt=True) from None
                except StationError as problem:
                    self.lose(unit.serial, fault_text(unit.slot, problem))

    def tables(self, record: Record) -> tuple[pd.DataFrame, pd.DataFrame]:
        """The record as tables: samples of the units that answered, readings of all."""
        of_the_lot = next(iter(self.identities.values()))  # one kind of device: who fell silent had the same unit
        rows = [
            readings_row(record, unit, self.identities.get(unit.serial, of_the_lot), self.lost.get(unit.serial, OK))
            for unit in self.lot.units
        ]
        return record.samples(self.answering), pd.DataFrame(rows)
