"""How one record is taken: the move, the samples, what is looked at meanwhile, and whose unit is lost on the way."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from pipelines.capture.plausibility import Soundness
from pipelines.capture.power_cycling import Power
from pipelines.capture.record import Record, TemperatureLog, readings_row
from pipelines.capture.supervision import Supervisor, short_of_samples
from schemas.errors import LinkLost, OperatorNeeded, StationError, StationTimeout
from schemas.event import NO_RECORD
from stations.devices.slot import SamplesLost
from stations.safety.suspenders import Reason, Suspended

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from pipelines.capture.sink import CaptureSink
    from pipelines.schedule.steps import Step
    from schemas.recipe import Lot, Recipe, Unit
    from stations.devices.reader import Instruments
    from stations.devices.slot import Identity
    from stations.station import Station

OBSERVATIONS = 5  # looks at encoders and instruments within a dwell
HISTORY_S = 10.0
OK = "ok"
LONG_ROWS = 1_000_000  # samples of a record that lie in memory together; of a longer one they are stored in pieces
PIECE_ROWS = 250_000
FILL = 0.5  # part of the slots' memory that may fill before it is emptied


def fault_text(slot: int, problem: StationError) -> str:
    """What readings say of a unit that is lost; the same whenever it is asked, so that a resumed run says it too."""
    if isinstance(problem, StationTimeout):
        return f"slot {slot}: no answer"
    if isinstance(problem, LinkLost):
        return f"slot {slot}: link lost"
    return f"slot {slot}: implausible answer"


@dataclass
class Acquisition:
    """The units of a lot on a station while records are taken: who still answers, and the history since the last record."""

    station: Station
    recipe: Recipe
    lot: Lot
    sink: CaptureSink
    guard: Supervisor
    history: TemperatureLog = field(default_factory=TemperatureLog)
    lost: dict[str, str] = field(default_factory=dict)
    identities: dict[str, Identity] = field(default_factory=dict)
    soundness: Soundness = field(init=False)
    power: Power = field(init=False)
    at: int = NO_RECORD

    def __post_init__(self) -> None:
        """Data are judged by what the slots say of their units; the supply is switched where the recipe says so."""
        switched = any(seconds > 0.0 for part in self.recipe.soaks for seconds in part.off_s or ())
        self.power = Power(self.station, self.guard, switched)
        self.soundness = Soundness(self.station.reader, self.identities)

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
                raise OperatorNeeded(
                    f"slot {unit.slot}: '{identity.serial}' sits there, '{unit.serial}' is needed; "
                    "seat the unit, or correct the lot"
                )
            self.identities[unit.serial] = identity
            if unit.serial in lost:
                self.lost[unit.serial] = lost[unit.serial]
        if not self.identities:
            raise OperatorNeeded(
                "reader: no unit of the lot answers, one is needed at least; check reader, power and cables"
            )

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
            raise OperatorNeeded(
                f"reader: no unit of the lot is left ({text}), one is needed at least; check reader, power and cables"
            )

    def lose_slots(self, slots: Sequence[int], text: str) -> None:
        """Gives the units of these slots up."""
        for unit in self.lot.units:
            if unit.slot in slots and unit.serial not in self.lost:
                self.lose(unit.serial, f"slot {unit.slot}: {text}")

    def noted(self) -> Instruments:
        """The instruments, noted in the history when it is due; a run that may not go on is told so here too."""
        self.station.require()
        instruments = self.station.reader.instruments()
        self.note(instruments)
        return instruments

    def note(self, instruments: Instruments) -> None:
        """Notes the temperatures in the history when it is due."""
        now = self.station.clock.now()
        if self.history.due(now, HISTORY_S):
            self.history.add(now, self.station.chamber.temperature(), self.lot.units, instruments.temperature_C)

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
        record.power_off = self.power.off_before(step) if self.power.ordered else None
        if not step.settled:
            self.observe(step, record)  # looks as the spans end alone are late by half a span: too warm, or too cold
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
