"""Capture: drives a station through a recipe and hands every record to a sink; the only place that does."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal, Protocol

import numpy as np
import pandas as pd

from pipelines.stages.captured import History, Record, readings_row
from schemas.errors import LinkLost, OperatorNeeded, StationError, StationTimeout

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pipelines.progress import Progress
    from schemas.recipe import Lot, Pose, Recipe
    from stations.devices.slot import Identity
    from stations.station import Station

Kind = Literal["dwell", "verification", "allan"]

OBSERVATIONS = 5  # looks at encoders and instruments within a dwell
HISTORY_S = 10.0
OK = "ok"
FILL = 0.5  # part of the slots' memory that may fill before it is emptied


class CaptureSink(Protocol):
    """Where records go: each is stored whole, or not at all."""

    def finished(self) -> set[int]:
        """Numbers of the records that are stored."""
        ...

    def put(
        self, record: int, samples: pd.DataFrame, readings: pd.DataFrame, history: pd.DataFrame, station_state: bytes
    ) -> None:
        """Stores a record durably, with the station's state after it."""
        ...

    def last_state(self) -> bytes | None:
        """The station's state after the record that was stored last."""
        ...


@dataclass(frozen=True)
class Step:
    """One record to take: its number, what it is for, the soak that it belongs to, and the pose."""

    record: int
    kind: Kind
    soak: int
    temperature: float
    pose: Pose


def steps(recipe: Recipe) -> list[Step]:
    """Every record of a recipe in order: per temperature the poses, then those for verification; the static record last.

    The static record has a soak of its own, unless it is taken at the last temperature.
    """
    found: list[Step] = []
    for soak, temperature in enumerate(recipe.temperatures_C):
        parts: tuple[tuple[Kind, list[Pose]], ...] = (("dwell", recipe.poses), ("verification", recipe.verification))
        for kind, poses in parts:
            found += [Step(len(found) + i, kind, soak, temperature, pose) for i, pose in enumerate(poses)]
    if recipe.static_record_s > 0.0:
        again = recipe.static_temperature_C == recipe.temperatures_C[-1]
        soak = len(recipe.temperatures_C) - (1 if again else 0)
        found.append(Step(len(found), "allan", soak, recipe.static_temperature_C, recipe.static_pose))
    return found


def capture(station: Station, recipe: Recipe, lot: Lot, sink: CaptureSink, *, progress: Progress) -> None:
    """Takes every record of a recipe that the sink does not have yet, in order.

    Everything that the recipe asks for is held against the station's limits before anything moves. A unit that stops answering is
    told so in its readings; the others go on. The door or an axis that does not arrive stops the run.
    """
    plan = steps(recipe)
    check(station, recipe, plan)
    work = _Work(station, recipe, lot, sink)
    done = sink.finished()
    work.identify()
    soak = max((step.soak for step in plan if step.record in done), default=-1)
    for number, step in enumerate(plan):
        if step.record in done:
            continue
        if step.soak > soak:
            progress(number, len(plan), f"soak at {step.temperature:g} °C")
            work.soak(step)
            soak = step.soak
        progress(number, len(plan), f"{step.temperature:g} °C, {step.kind} {step.pose.name}")
        work.take(step)
    progress(len(plan), len(plan), "captured")


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
    history: History = field(default_factory=History)
    lost: dict[str, str] = field(default_factory=dict)
    identities: dict[str, Identity] = field(default_factory=dict)

    def identify(self) -> None:
        """Asks every slot who sits in it; another serial than the lot's stops the run before anything is measured."""
        for unit in self.lot.units:
            try:
                identity = self.station.reader.slots[unit.slot].identity()
            except StationError as problem:
                self.lost[unit.serial] = fault_text(unit.slot, problem)
                continue
            if identity.serial != unit.serial:
                message = (
                    f"slot {unit.slot}: '{identity.serial}' sits there, '{unit.serial}' is needed; "
                    "seat the unit, or correct the lot"
                )
                raise OperatorNeeded(message)
            self.identities[unit.serial] = identity
        if not self.identities:
            message = "reader: no unit of the lot answers, one is needed at least; check reader, power and cables"
            raise OperatorNeeded(message)

    def soak(self, step: Step) -> None:
        """Settles the devices at the step's temperature."""
        shortest = self.recipe.soak_min_s
        slots = [unit.slot for unit in self.lot.units]
        self.station.soak(step.temperature, shortest, slots, self.note)

    def note(self) -> list[float]:
        """The temperatures by slot, noted in the history when it is due."""
        station = self.station
        instruments = station.reader.instruments()
        now = station.clock.now()
        if self.history.due(now, HISTORY_S):
            self.history.add(now, station.chamber.temperature(), self.lot.units, instruments.temperature_C)
        return instruments.temperature_C

    def take(self, step: Step) -> None:
        """Moves, settles, samples and stores one record."""
        station, recipe = self.station, self.recipe
        station.reader.require_closed_door()
        station.table.move(step.pose.outer_deg, step.pose.inner_deg)
        station.clock.sleep(recipe.settle_s)
        duration = recipe.static_record_s if step.kind == "allan" else recipe.dwell_s
        powered = station.reader.since_power()
        station.reader.start(recipe.rate_hz)
        record = Record(step.record, step.kind, step.pose, step.soak, station.clock.now(), duration, recipe.rate_hz)
        record.since_move = record.start + duration / 2.0 - station.table.still_since  # in the middle, as the mean is
        record.since_power = powered + duration / 2.0
        for _ in self._spans(record):
            self.observe(record)
            self.empty(record)
        station.reader.stop()
        self.empty(record)
        samples, readings = self.tables(record)
        self.sink.put(step.record, samples, readings, self.history.taken(), station.state())

    def _spans(self, record: Record) -> Iterator[float]:
        """Sleeps through a record in spans, short enough for the slots' memories and for the history."""
        memory = min(identity.capacity for identity in self.identities.values()) / record.rate * FILL
        longest = min(HISTORY_S, memory, record.duration / OBSERVATIONS)
        count = int(np.ceil(record.duration / longest - 1e-9))
        for number in range(count):
            end = record.start + record.duration * (number + 1) / count
            self.station.clock.sleep(end - self.station.clock.now())
            yield end

    def observe(self, record: Record) -> None:
        """Notes encoders and instruments."""
        record.look(self.station.table.angles(), self.station.chamber.temperature(), self.station.reader.instruments())
        self.note()

    def empty(self, record: Record) -> None:
        """Takes what the slots have sampled; a slot that does not answer any more is not asked again."""
        for unit in self.lot.units:
            if unit.serial not in self.lost:
                try:
                    record.keep(unit.serial, self.station.reader.slots[unit.slot].take())
                except StationError as problem:
                    self.lost[unit.serial] = fault_text(unit.slot, problem)

    def tables(self, record: Record) -> tuple[pd.DataFrame, pd.DataFrame]:
        """The record as tables: samples of the units that answered, readings of all."""
        of_the_lot = next(iter(self.identities.values()))  # one kind of device: who fell silent had the same unit
        rows = [
            readings_row(record, unit, self.identities.get(unit.serial, of_the_lot), self.lost.get(unit.serial, OK))
            for unit in self.lot.units
        ]
        return record.samples([u for u in self.lot.units if u.serial not in self.lost]), pd.DataFrame(rows)
