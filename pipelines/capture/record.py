"""The data of one record during a capture, the tables made from them, and its checks while it can still be measured again.

Means and outliers come from the one module that decodes samples, which validation and reduction use, too.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pandas as pd

from inertial.arrays import Array
from inertial.pointing import TURNED_AWAY, Pointing, contradicts
from inertial.quantities import ANGLE_COLUMNS, BY_ATTRIBUTE, READINGS
from pipelines.tables.summaries import first_outlier, unit_means
from schemas.errors import OperatorNeeded, StationError
from schemas.event import Event
from schemas.lot import Unit
from schemas.poses import Pose
from schemas.units import AXES
from stations.devices.reader import Instruments, Reader
from stations.devices.slot import Identity, Samples
from stations.safety.suspenders import Reason, Suspended

TABLE = "table: "
TURNED = f"{TABLE}{TURNED_AWAY}"
POWER_OFF = BY_ATTRIBUTE["power_off"].column


@dataclass
class TemperatureLog:
    """Temperatures against time since the last record was stored."""

    rows: list[tuple[float, float, int, str, float]] = field(default_factory=list)
    last: float | None = None
    air: float = math.nan

    def due(self, now: float, every: float) -> bool:
        """Whether the last row is old enough."""
        return self.last is None or now - self.last >= every - 1e-6

    def add(self, now: float, chamber: float, units: Sequence[Unit], by_slot: Sequence[float]) -> None:
        """Adds the temperatures of air and devices, °C, at ``now`` s."""
        self.last, self.air = now, chamber
        self.rows += [(now, chamber, unit.slot, unit.serial, by_slot[unit.slot]) for unit in units]

    def drain(self) -> pd.DataFrame:
        """The rows as a table; the log is empty afterwards and due at once, so that a resumed run logs the same rows."""
        frame = pd.DataFrame(self.rows, columns=["time_s", "chamber_C", "slot", "unit", "unit_C"])
        self.rows, self.last = [], None
        return frame


@dataclass
class Record:
    """One record while it is measured: the observations of the station, and the samples by unit."""

    number: int
    kind: str
    pose: Pose
    soak: int
    start: float
    duration: float
    rate: float
    since_move: float = 0.0
    since_power: float = 0.0
    power_off: float | None = None
    observations: list[dict[str, Array]] = field(default_factory=list)
    recorded: dict[str, list[float]] = field(default_factory=dict)
    parts: dict[str, list[Samples]] = field(default_factory=dict)
    stored: dict[str, int] = field(default_factory=dict)
    lossy: set[str] = field(default_factory=set)
    pieces: int = 0

    def observe(self, angles: tuple[float, float], chamber: float, instruments: Instruments) -> None:
        """Adds one observation: encoders in degrees, air in °C, instruments."""
        values: dict[str, float | Sequence[float]] = {
            **dict(zip(ANGLE_COLUMNS, angles, strict=True)),
            "chamber_C": chamber,
            "unit_C": instruments.temperature_C,
            "supply_V": instruments.supply_V,
            "vibration_g": instruments.vibration_g,
        }
        self.observations.append({column: np.atleast_1d(value) for column, value in values.items()})
        for column, value in instruments.recorded.items():
            self.recorded.setdefault(column, []).append(value)

    def observed(self, slot: int) -> dict[str, float]:
        """Means over the observations, for the station and one slot, by column of the readings."""
        first = self.observations[0]
        # in one: the mean of a single column is summed up in another order
        means = np.mean([np.concatenate(list(observation.values())) for observation in self.observations], axis=0)
        by_slot = np.split(means, np.cumsum([values.size for values in first.values()]))
        return {
            **{column: float(mean[slot if mean.size > 1 else 0]) for column, mean in zip(first, by_slot, strict=False)},
            "since_move_s": self.since_move,
            "since_power_s": self.since_power,
            **{column: float(np.mean(values)) for column, values in self.recorded.items()},
        }

    def keep(self, serial: str, samples: Samples) -> None:
        """Adds samples of a unit."""
        self.parts.setdefault(serial, []).append(samples)
        if samples.overflow:
            self.lossy.add(serial)

    def count(self, serial: str) -> int:
        """Samples of a unit so far."""
        return self.stored.get(serial, 0) + self._held(serial)

    def rows(self) -> int:
        """Number of samples of all units in memory."""
        return sum(self._held(serial) for serial in self.parts)

    def piece(self, units: Sequence[Unit]) -> pd.DataFrame:
        """The samples in memory as a table to be stored; the memory is empty afterwards."""
        frame = self.samples(units)
        self.stored = {serial: self.count(serial) for serial in self.parts}
        self.parts = {serial: [] for serial in self.parts}
        self.pieces += 1
        return frame

    def outlier(self, serial: str, lsb: float, full_scale: float) -> str:
        """The first outlier among the samples of a unit in memory, in words; empty where there is none.

        In a static dwell an outlier was changed in transmission, or the unit was knocked.
        """
        outputs = _joined(self.parts.get(serial, []))
        first = first_outlier(outputs, lsb, full_scale)
        if first is None:
            return ""
        return (
            f"sample {self.stored.get(serial, 0) + first.row} is {first.value:g} on {AXES[first.axis]}, the median of the dwell "
            f"is {first.median:g}"
        )

    def _held(self, serial: str) -> int:
        return sum(len(part.outputs) for part in self.parts.get(serial, []))

    def samples(self, units: Sequence[Unit]) -> pd.DataFrame:
        """The samples of these units, one row each; a sample's time follows from its number since the start.

        Axes without an output are NaN.
        """
        units = [unit for unit in units if self._held(unit.serial)]
        counts = [self._held(unit.serial) for unit in units]
        parts = [part for unit in units for part in self.parts[unit.serial]]
        table = _joined(parts)
        since = np.concatenate(
            [np.zeros(0), *(part.first + np.arange(len(part.outputs), dtype=float) for part in parts)]
        )
        columns: dict[str, Any] = {
            "unit": pd.Series([u.serial for u in units], dtype="str").repeat(counts).reset_index(drop=True),
            "slot": np.repeat(np.array([u.slot for u in units], dtype=np.int64), counts),
            "record": np.full(len(table), self.number, dtype=np.int64),
            "kind": pd.Series([self.kind], dtype="str").repeat(len(table)).reset_index(drop=True),
            "time_s": self.start + (since + 1.0) / self.rate,
        }
        return pd.DataFrame(
            columns | {axis: table[:, i] if i < table.shape[1] else np.nan for i, axis in enumerate(AXES)}
        )


def _joined(parts: Sequence[Samples]) -> Array:
    """Outputs (n, m) of all parts; (0, 3) without any."""
    return np.concatenate([part.outputs for part in parts]) if parts else np.zeros((0, len(AXES)))


def readings_row(record: Record, unit: Unit, identity: Identity, status: str) -> dict[str, object]:
    """A row of the readings: measurements of the station for a unit, as means over the observations of a record."""
    observed = record.observed(unit.slot)
    return {
        "unit": unit.serial,
        "slot": unit.slot,
        "record": record.number,
        "kind": record.kind,
        "pose": record.pose.name,
        "soak": record.soak,
        **{column: observed[column] for column in ANGLE_COLUMNS},
        "outer_command_deg": record.pose.outer_deg,
        "inner_command_deg": record.pose.inner_deg,
        **{column: observed[column] for column in READINGS},
        **({} if record.power_off is None else {POWER_OFF: record.power_off}),
        "start_s": record.start,
        "duration_s": record.duration,
        "rate_hz": record.rate,
        "n": record.count(unit.serial) if status == "ok" else 0,
        "overflow": unit.serial in record.lossy,
        "status": status,
        "out_unit": identity.out_unit,
        "full_scale": identity.full_scale,
        **{column: observed[column] for column in record.recorded},
    }


@dataclass
class Plausibility:
    """Checks of a record: the slots' identities, outliers among its samples, and the table's angles against all units."""

    reader: Reader
    identities: Mapping[str, Identity]
    pointing: Pointing = field(default_factory=Pointing)

    def unreachable_units(self, units: Sequence[Unit]) -> Iterator[tuple[Unit, StationError]]:
        """Units whose slots no longer answer, with the error.

        Raises
        ------
        OperatorNeeded : another unit sits in a slot than at the start, so its samples have no known unit
        """
        for unit in units:
            try:
                matches = self.reader.slots[unit.slot].holds(unit.serial)
            except StationError as problem:
                yield unit, problem
                continue
            if not matches:
                raise OperatorNeeded(
                    f"slot {unit.slot}: '{unit.serial}' is no longer there; seat the units as they were, or measure "
                    "the lot anew"
                )

    def refuse_outliers(self, record: Record, units: Sequence[Unit]) -> None:
        """Suspends a record with an implausible sample."""
        outliers: dict[int, str] = {}
        for unit in units:
            identity = self.identities[unit.serial]
            if text := record.outlier(unit.serial, identity.lsb, identity.full_scale):
                outliers[unit.slot] = text
        if outliers:
            slot = min(outliers)
            raise Suspended([Reason("samples", f"slot {slot}: {outliers[slot]}", tuple(outliers))], spoilt=True)

    @staticmethod
    def refuse_contradicted(past: Sequence[Event]) -> None:
        """Refuses to resume a run that ended because all units contradicted the table's encoders."""
        for event in past:
            if event.kind == "stopped" and event.reason.startswith(TURNED):
                raise OperatorNeeded(event.reason)

    def refuse_contradiction(self, soak: int, samples: pd.DataFrame, readings: pd.DataFrame) -> None:
        """Ends the run where all units contradict the encoders of the table.

        Parameters
        ----------
        soak : number of the soak; the table's error is judged over the dwells of one
        samples, readings : the tables of one record
        """
        if samples.empty:  # all of a long record's samples are stored already
            return
        first = readings.iloc[0]
        angles = float(first["outer_deg"]), float(first["inner_deg"])
        text = contradicts(self.pointing.add(soak, angles, unit_means(samples)))
        if text:
            raise OperatorNeeded(f"{TABLE}{text}")
