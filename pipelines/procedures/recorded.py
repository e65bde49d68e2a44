"""What a procedure plans and gets: steps, the records of units read from tables, the units before it; tables that it writes."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal, NamedTuple

import numpy as np
import pandas as pd

from inertial.arrays import Array
from inertial.dynamics.stability import ShortNoise
from inertial.dynamics.wander import IdentifiedNoise
from pipelines.tables.frames import empty_table
from schemas.poses import Pose
from schemas.units import AXES

REFERENCE = "@reference"
"""The name of the reference sensor in the tables of samples; no serial begins with it."""
StepKind = Literal["dwell", "verification", "allan", "procedure"]


@dataclass(frozen=True)
class Turn:
    """A turn of an axis of the table (``outer`` or ``inner``) to an angle at a rate, after ``stand_s`` s at rest."""

    axis: str
    to_deg: float
    rate_deg_s: float
    stand_s: float


@dataclass(frozen=True)
class ProcedureStep:
    """One record of a procedure.

    Attributes
    ----------
    name : shown while it is measured
    lasting_s, rate_hz : of the record; None for those of the recipe
    wait_s : after the move; None for the recipe's
    off_s : without power before the move, s
    soak : number of the soak within the procedure, from 0
    role : equipment of the station that performs it; empty for a record on the tilt table
    on_table : the equipment of the role is set first, then the record is taken on the tilt table
    setting : what the equipment is set to, by name with unit
    turns : of the table during the record, one after the other, from the pose on
    """

    name: str
    pose: Pose
    temperature_C: float
    kind: StepKind = "procedure"
    lasting_s: float | None = None
    rate_hz: float | None = None
    wait_s: float | None = None
    off_s: float = 0.0
    soak: int = 0
    settled: bool = True
    role: str = ""
    on_table: bool = False
    setting: Mapping[str, float] = field(default_factory=dict[str, float])
    turns: tuple[Turn, ...] = ()


def at_rest(name: str) -> Pose:
    """The pose of records that turn nothing: both axes of the table at 0°."""
    return Pose(name=name, outer_deg=0.0, inner_deg=0.0)


def on_equipment(
    role: str, name: str, part: Any, lasting_s: float, setting: Mapping[str, float], *, pose: str = ""
) -> ProcedureStep:
    """A record that equipment performs while the table turns nothing; its pose is named for the role where no name is given."""
    rest = at_rest(pose or role)
    return ProcedureStep(name, rest, part.temperature_C, lasting_s=lasting_s, role=role, setting=setting)


@dataclass(frozen=True)
class UnitRecord:
    """The samples of one unit, or of the reference, in one record.

    time : (n,), s on the station's clock; output : (n, m) of the axes with an output, in its unit, or g for the reference
    """

    time: Array
    output: Array

    @property
    def letters(self) -> tuple[str, ...]:
        """The axes with an output, in order."""
        return AXES[: self.output.shape[1]]

    @property
    def rate_hz(self) -> float:
        """Nominal rate of the samples, Hz."""
        return (len(self.time) - 1) / float(self.time[-1] - self.time[0])


@dataclass(frozen=True)
class ProcedureRecord:
    """One record of a procedure as it was measured: its step, the readings (a row for each unit), and samples by unit."""

    number: int
    step: ProcedureStep
    readings: pd.DataFrame
    samples: Mapping[str, UnitRecord]


Records = Sequence[ProcedureRecord]


class Taken(NamedTuple):
    """The part of a record that belongs to one unit; ``number`` is that of the record within the procedure, from 0."""

    number: int
    record: ProcedureRecord
    unit: str
    reading: Mapping[str, Any]
    samples: UnitRecord


def taken(records: Records) -> Iterator[Taken]:
    """Every unit that was recorded, in every record."""
    for number, record in enumerate(records):
        for reading in record.readings.to_dict("records"):
            unit = str(reading["unit"])
            if unit in record.samples:
                yield Taken(number, record, unit, {str(k): v for k, v in reading.items()}, record.samples[unit])


END = 1e-4
"""Share of the full scale within which a sample is at its end: to which a converter of 14 bits or more rounds it."""


@dataclass(frozen=True)
class Device:
    """The units before the procedure: nominal scale from the full scale, and their calibration if they have been calibrated.

    scale : (3,) output per g of each axis, by unit; full_scale, out_unit : of the lot
    scale_error : (3,) standard uncertainty of the scale as a share
    noise : that the static record of the run shows, µg, by unit and axis; none where it has no such record
    """

    scale: Mapping[str, Array]
    scale_error: Mapping[str, Array]
    full_scale: float
    out_unit: str
    noise: Mapping[tuple[str, str], IdentifiedNoise] = field(default_factory=dict[tuple[str, str], "IdentifiedNoise"])

    def at_end(self, output: Array) -> int:
        """Number of samples (n,) at the end of the range that the data sheet gives."""
        return int(np.count_nonzero(np.abs(output) >= (1.0 - END) * self.full_scale))


def procedure_record(
    number: int, step: ProcedureStep, samples: Iterable[pd.DataFrame], readings: pd.DataFrame, axes: int = len(AXES)
) -> ProcedureRecord:
    """One record: samples by unit from its tables, one or several of a long record.

    Parameters
    ----------
    axes : number of axes of the units with an output; the reference has three
    """
    parts: dict[str, list[tuple[Array, Array]]] = {}
    for table in samples:
        output, time = table[list(AXES)].to_numpy(dtype=float), table["time_s"].to_numpy(dtype=float)
        for unit, rows in table.groupby("unit", sort=False).indices.items():
            channels = output[rows] if unit == REFERENCE else output[rows, :axes]
            parts.setdefault(str(unit), []).append((time[rows], channels))
    joined = {
        unit: UnitRecord(np.concatenate([t for t, _ in pieces]), np.concatenate([o for _, o in pieces]))
        for unit, pieces in parts.items()
    }
    return ProcedureRecord(number, step, readings, joined)


def nominal_device(readings: pd.DataFrame) -> Device:
    """The units by their slots: a scale is known only from a calibration."""
    first = readings.iloc[0]
    return Device({}, {}, float(first["full_scale"]), str(first["out_unit"]))


def numbers(rows: pd.DataFrame, *names: str) -> list[Array]:
    """Columns of points as arrays: setting, value and uncertainty where none is named."""
    return [rows[name].to_numpy(dtype=float) for name in names or ("setting", "value", "uncertainty")]


def point_rows(**columns: Any) -> list[dict[str, Any]]:
    """Rows of points from columns in their order; a scalar is repeated in every row."""
    count = max(np.size(column) for column in columns.values())
    spread = {name: [column] * count if np.ndim(column) == 0 else column for name, column in columns.items()}
    return [dict(zip(spread, row, strict=True)) for row in zip(*spread.values(), strict=True)]


def point_table(rows: Iterable[Mapping[str, Any]]) -> pd.DataFrame:
    """Points from rows with unit, axis, series, point, setting, value, uncertainty and further numbers."""
    made = pd.DataFrame(list(rows))
    return (
        made
        if len(made)
        else empty_table(texts="unit axis series", integers="point", numbers="setting value uncertainty")
    )


EARLIER_SHARE = 0.8  # relative standard deviation of F² from two Allan variances, in points of earlier versions


def noise_columns(noise: ShortNoise) -> dict[str, float]:
    """Numbers of a point: N² per s, F², and the standard deviation of the estimate of F²."""
    return {"white": noise.white, "flicker": noise.flicker, "flicker_error": noise.flicker_error}


def pooled_noise(rows: pd.DataFrame) -> ShortNoise:
    """Noise of one device from all its records in ``rows``: means, each record counting alike."""
    white, flicker = (np.maximum(rows[name].to_numpy(dtype=float), 0.0) for name in ("white", "flicker"))
    known = "flicker_error" in rows  # points of earlier versions have none
    error = rows["flicker_error"].to_numpy(dtype=float) if known else EARLIER_SHARE * flicker
    return ShortNoise(float(white.mean()), float(flicker.mean()), float(np.sqrt(np.sum(error**2)) / len(rows)))
