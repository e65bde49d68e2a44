"""Measuring and storing one record: the move, the samples, the observations meanwhile, and units that stop answering."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
import pandas as pd

from pipelines.capture.record import Plausibility, Record, TemperatureLog, readings_row
from pipelines.capture.supervision import Power, Supervisor, short_of_samples
from pipelines.capture.turning import Turning
from pipelines.procedures import procedure_of
from pipelines.procedures.base import OnEquipment, SetsEquipment
from pipelines.procedures.recorded import ProcedureStep
from pipelines.schedule.steps import TUMBLED, Step
from schemas.errors import LinkLost, OperatorNeeded, StationError, StationTimeout
from schemas.event import NO_RECORD
from schemas.lot import Lot, Unit
from schemas.recipe import Recipe
from stations.devices.equipment import RecordingSpoilt
from stations.devices.reader import Instruments
from stations.devices.slot import Identity, Samples, SamplesLost
from stations.safety.suspenders import Reason, Suspended
from stations.station import Station


class CaptureSink(Protocol):
    """Storage of records: each is stored completely, or not at all."""

    def finished(self) -> set[int]:
        """Numbers of the records that are stored."""
        ...

    def part(self, record: int, number: int, samples: pd.DataFrame) -> None:
        """Stores a part of the samples of a long record before the record is complete; part 0 discards earlier parts."""

    def put(
        self,
        record: int,
        samples: pd.DataFrame,
        readings: pd.DataFrame,
        history: pd.DataFrame,
        station_state: bytes,
        parts: int = 0,
    ) -> None:
        """Stores a record durably, with the station's state after it; ``parts`` parts of its samples are stored already."""

    def last_state(self) -> bytes | None:
        """The station's state after the last stored record."""
        ...


OBSERVATIONS = 5  # observations of encoders and instruments within a dwell
HISTORY_S = 10.0
OK = "ok"
LONG_ROWS = 1_000_000  # most samples of a record in memory; a longer record is stored in pieces
PIECE_ROWS = 250_000
FILL = 0.5  # part of the slots' memory that may fill before it is emptied


def fault_text(slot: int, problem: StationError) -> str:
    """The status of a unit that no longer answers; it depends on the class of the error only, so a resumed run repeats it."""
    if isinstance(problem, StationTimeout):
        return f"slot {slot}: no answer"
    if isinstance(problem, LinkLost):
        return f"slot {slot}: link lost"
    return f"slot {slot}: implausible answer"


@dataclass
class Acquisition:
    """Measures records of a lot on a station: the units that still answer, and the temperatures since the last record."""

    station: Station
    recipe: Recipe
    lot: Lot
    sink: CaptureSink
    supervisor: Supervisor
    history: TemperatureLog = field(default_factory=TemperatureLog)
    lost: dict[str, str] = field(default_factory=dict)
    identities: dict[str, Identity] = field(default_factory=dict)
    plausibility: Plausibility = field(init=False)
    power: Power = field(init=False)
    at: int = NO_RECORD
    dwell_s: float | None = None
    """Length of the dwells of the fit that a look has chosen; that of the recipe where None."""

    def __post_init__(self) -> None:
        """Prepares the checks of records, and the power orders where the recipe has some."""
        switched = any(seconds > 0.0 for part in self.recipe.soaks for seconds in part.off_s or ())
        self.power = Power(self.station, self.supervisor, switched)
        self.plausibility = Plausibility(self.station.reader, self.identities)

    def identify(self) -> None:
        """Reads the identity of every unit; a serial number other than the lot's ends the run before anything is measured."""
        lost = {event.action.split()[1]: event.reason for event in self.supervisor.past("unit_lost")}
        for unit in self.lot.units:
            if unit.serial in lost:
                self.lost[unit.serial] = lost[unit.serial]
            try:
                identity = self.station.reader.slots[unit.slot].identity()
            except StationError as problem:
                if unit.serial not in lost:
                    self.give_up(unit.serial, fault_text(unit.slot, problem))
                continue
            if identity.serial != unit.serial:
                raise OperatorNeeded(
                    f"slot {unit.slot}: '{identity.serial}' sits there, '{unit.serial}' is needed; "
                    "seat the unit, or correct the lot"
                )
            if identity.axes != self.recipe.sensor_axes:
                raise OperatorNeeded(
                    f"slot {unit.slot}: unit {unit.serial} has {identity.axes} axes, the recipe says {self.recipe.sensor_axes}; "
                    "correct 'sensor_axes' in the recipe, or set the slot of the reader"
                )
            self.identities[unit.serial] = identity
        if not self.identities:
            raise OperatorNeeded(
                "reader: no unit of the lot answers, at least one is needed; check reader, power and cables"
            )

    @property
    def slots(self) -> list[int]:
        """Slots of the units that still answer."""
        return [unit.slot for unit in self.answering]

    @property
    def answering(self) -> list[Unit]:
        """Units that still answer."""
        return [unit for unit in self.lot.units if unit.serial not in self.lost]

    def give_up(self, serial: str, text: str) -> None:
        """Gives up a unit; the status of its readings says why, also in a resumed run."""
        self.lost[serial] = text
        self.supervisor.note("unit_lost", max(self.at, 0), text, f"unit {serial} is refused, the others go on")
        if not self.answering and self.at != NO_RECORD:
            raise OperatorNeeded(
                f"reader: no unit of the lot answers any more ({text}), at least one is needed; check reader, power and cables"
            )

    def give_up_slots(self, slots: Sequence[int], text: str) -> None:
        """Gives up the units of these slots."""
        for unit in self.answering:
            if unit.slot in slots:
                self.give_up(unit.serial, f"slot {unit.slot}: {text}")

    def read_instruments(self) -> Instruments:
        """The instruments; their temperatures are logged when due. Refuses where the run has lost its leases or watchdog."""
        self.station.require()
        instruments = self.station.reader.instruments()
        self.log_temperatures(instruments)
        return instruments

    def log_temperatures(self, instruments: Instruments) -> None:
        """Adds the temperatures to the history when a row is due."""
        now = self.station.clock.now()
        if self.history.due(now, HISTORY_S):
            self.history.add(now, self.station.chamber.temperature(), self.lot.units, instruments.temperature_C)

    def measure(self, step: Step) -> tuple[Record, pd.DataFrame, pd.DataFrame]:
        """One complete record with its samples and readings.

        Raises
        ------
        Suspended : a condition failed before, during or after the record
        """
        station, recipe = self.station, self.recipe
        self.prepare(step)
        if step.order is not None and step.order.role and not step.order.on_table:
            return self.measure_on_equipment(step, step.order)
        station.table.move(step.pose.outer_deg, step.pose.inner_deg)
        self.rest(recipe.settle_s if step.wait_s is None else step.wait_s)
        self.supervisor.check_before(self.slots)
        self.supervisor.require_steady_clocks(spoilt=False)
        # on a ramp the length of the dwells decides how far the devices come
        chosen = self.dwell_s if step.kind == "dwell" and step.settled else None
        duration, rate = chosen or step.lasts(recipe), step.rate_hz or recipe.rate_hz
        powered = station.reader.since_power()
        station.reader.start(rate)
        record = Record(step.record, step.kind, step.pose, step.soak, station.clock.now(), duration, rate)
        record.since_move = record.start + duration / 2.0 - station.table.still_since  # at its middle, as the means
        record.since_power = powered + duration / 2.0
        record.power_off = self.power.off_before(step) if self.power.ordered else None
        if not step.settled:
            # observations at the ends of the spans alone would be late by half a span on average
            self.observe(step, record)
        turning = Turning(station.table, station.clock, step.turns)
        for _ in turning.spans(self._longest(record)) if step.turns else self._spans(record):
            self.observe(step, record)
            self.read_samples(record)
            if not step.turns and duration * rate * len(self.slots) > LONG_ROWS and record.rows() >= PIECE_ROWS:
                self.plausibility.refuse_outliers(record, self.answering)
                self.sink.part(step.record, record.pieces, record.piece(self.answering))
        station.reader.stop()
        if step.turns:
            record.duration = duration = station.clock.now() - record.start
        self.read_samples(record)
        self.supervisor.require_steady_clocks(spoilt=True)
        for unit, problem in self.plausibility.unreachable_units(self.answering):
            self.give_up(unit.serial, fault_text(unit.slot, problem))
        counts = {unit.slot: record.count(unit.serial) for unit in self.answering}
        overflow = {unit.slot for unit in self.answering if unit.serial in record.lossy}
        if reasons := short_of_samples(counts, overflow, duration, rate):
            raise Suspended(reasons, spoilt=True)
        samples, readings = self.tables(record)
        if step.turns:
            return record, pd.concat([samples, turning.frame(record.number)]), readings
        self.plausibility.refuse_outliers(record, self.answering)
        if step.kind in TUMBLED and step.settled:
            self.plausibility.refuse_contradiction(record.soak, samples, readings)
        return record, samples, readings

    def prepare(self, step: Step) -> None:
        """Sets the equipment of a step on the table, and brings all other equipment to the state of records without it."""
        order = step.order if step.order is not None and step.order.on_table else None
        for role, equipment in self.station.equipment.items():
            if order is None or role != order.role:
                equipment.stand_by()
        ratio = 1.0
        if order is not None:
            procedure = procedure_of(self.recipe, step.procedure, SetsEquipment)
            ratio = procedure.set_equipment(self.station.equipment[order.role], order).get("supply_ratio", 1.0)
        self.supervisor.expect_supply(ratio)

    def measure_on_equipment(self, step: Step, order: ProcedureStep) -> tuple[Record, pd.DataFrame, pd.DataFrame]:
        """One record that other equipment of the station performs, with its samples, those of the reference, and readings.

        Raises
        ------
        Suspended : the recording is of no use, and is repeated
        """
        station = self.station
        self.supervisor.check_before(self.slots)
        procedure = procedure_of(self.recipe, step.procedure, OnEquipment)
        powered, start = station.reader.since_power(), station.clock.now()
        try:
            recording = procedure.measure(station.equipment[order.role], order, self.slots)
        except RecordingSpoilt as problem:
            raise Suspended([Reason("recording", str(problem))], spoilt=True) from None
        self.supervisor.require_steady_clocks(spoilt=True)
        duration = station.clock.now() - start
        record = Record(step.record, step.kind, step.pose, step.soak, start, duration, recording.rate_hz)
        record.since_power = powered + duration / 2.0
        record.observe(*self.look())
        for unit in self.answering:
            output = recording.outputs.get(unit.slot)
            if output is None:
                self.give_up(unit.serial, f"slot {unit.slot}: not recorded")
            else:
                record.keep(unit.serial, Samples(0, output[:, : self.recipe.sensor_axes], overflow=False))
        samples, readings = self.tables(record)
        return record, pd.concat([samples, recording.reference_frame(record.number, record.start)]), readings

    def rest(self, seconds: float) -> None:
        """Waits ``seconds`` for the devices to come to rest after a move; logs temperatures during a long wait."""
        clock = self.station.clock
        end = clock.now() + seconds
        while end - clock.now() > HISTORY_S:
            clock.sleep(HISTORY_S)
            self.read_instruments()
        clock.sleep(end - clock.now())

    def _spans(self, record: Record) -> Iterator[float]:
        """Waits through a record in spans, short enough for the slots' memories and for the history; gives the end of each, s."""
        longest = self._longest(record)
        count = int(np.ceil(record.duration / longest - 1e-9))
        for number in range(count):
            end = record.start + record.duration * (number + 1) / count
            self.station.clock.sleep(end - self.station.clock.now())
            yield end

    def _longest(self, record: Record) -> float:
        """Longest span of a record without a look, s: short enough for the slots' memories and for the history."""
        memory = min(identity.capacity for identity in self.identities.values()) / record.rate * FILL
        return min(HISTORY_S, memory, record.duration / OBSERVATIONS)

    def observe(self, step: Step, record: Record) -> None:
        """Adds an observation to the record; a failed condition spoils the record."""
        angles, air, instruments = self.look()
        target = step.temperature if step.settled else None
        pose = None if step.turns else step.pose
        self.supervisor.check_during(pose, target, angles, air, instruments, self.slots)
        record.observe(angles, air, instruments)

    def look(self) -> tuple[tuple[float, float], float, Instruments]:
        """Angles of the table, air and instruments now; logs the temperatures."""
        station = self.station
        angles, air, instruments = station.table.angles(), station.chamber.temperature(), station.reader.instruments()
        self.log_temperatures(instruments)
        return angles, air, instruments

    def read_samples(self, record: Record) -> None:
        """Moves the samples from the slots' memories to the record; the unit of a slot that does not answer is given up."""
        for unit in self.answering:
            try:
                record.keep(unit.serial, self.station.reader.slots[unit.slot].take())
            except SamplesLost as problem:
                raise Suspended([Reason("samples", str(problem), (unit.slot,))], spoilt=True) from None
            except StationError as problem:
                self.give_up(unit.serial, fault_text(unit.slot, problem))

    def tables(self, record: Record) -> tuple[pd.DataFrame, pd.DataFrame]:
        """The record as tables: samples of the units that answer, readings of all units."""
        of_the_lot = next(iter(self.identities.values()))  # a lot has one kind of device, so also one output unit
        rows = [
            readings_row(record, unit, self.identities.get(unit.serial, of_the_lot), self.lost.get(unit.serial, OK))
            for unit in self.lot.units
        ]
        return record.samples(self.answering), pd.DataFrame(rows)
