"""Foreign columns turned into a raw record and its dwells; contradictions to the mapping are refused."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import pandas as pd

from inertial import frames
from inertial.arrays import Array, Index
from inertial.quantities import ANGLE_COLUMNS, BY_COLUMN, FORCE_COLUMNS, SPREAD_COLUMNS
from pipelines.importers import clocks, exchange, pose_check, sample_faults, unit_check, values
from pipelines.importers.content import Content
from pipelines.importers.documents import SampleFaultDocument
from pipelines.importers.dwell_numbers import dwell_numbers
from pipelines.importers.held_out import with_held_out
from pipelines.importers.mapping import FACES, MEANINGS, OUTPUT_UNITS, TILT, Mapping
from pipelines.importers.record_time import backwards, gaps_of, seconds, time_doubts
from pipelines.importers.stated_units import column_name
from pipelines.importers.stretches import Stretches, stretches
from schemas.errors import DataRejected, WrongUse, did_you_mean
from schemas.foreign import shown
from schemas.serials import refuse_unusable_serials
from schemas.units import AXES


@dataclass(frozen=True)
class Imported:
    """One recording's samples and dwells, in the tables of the archive."""

    samples: pd.DataFrame | None
    """Raw record; None if the rows of the file are dwells."""
    dwells: pd.DataFrame | None
    """Exchange format; None if there is no static interval."""
    out_unit: str
    remarks: tuple[str, ...]
    faults: tuple[SampleFaultDocument, ...] = field(default=())
    """Faults of the samples that were left out or kept, for JSON."""

    @property
    def units(self) -> list[str]:
        """Serial numbers."""
        table = self.samples if self.dwells is None else self.dwells
        return [] if table is None else sorted(set(table["unit"].tolist()))


def imported(
    table: pd.DataFrame, mapping: Mapping, where: str, content: Content | None = None, breaks: Sequence[int] = ()
) -> Imported:
    """The record and dwells of a foreign table.

    Parameters
    ----------
    content : what the file states about its columns.
    breaks : rows before which another file begins.

    Raises
    ------
    DataRejected
        A column is not there, a value is not a finite number, time runs back, the norm contradicts the unit, samples are missing,
        an axis is constant, words are torn, or a dwell holds several positions.
    """
    content = content or Content(table)
    columns = _columns(table, mapping, where)
    kept, columns, dropped = _with_numbers(columns, mapping, where, content)
    left_out_before = {int(k) + 1 for k in np.flatnonzero(np.diff(kept) > 1)}
    breaks = sorted({int(np.searchsorted(kept, k)) for k in breaks} | left_out_before)
    raw = np.column_stack([values.finite(columns[axis], where, content) for axis in mapping.axes])
    raw = raw * [1.0 if sign == "+" else -1.0 for sign in mapping.signs[: len(mapping.axes)]]
    three = len(mapping.axes) == len(AXES)
    other: tuple[str, ...] = ()
    if three:  # the norm is that of three
        other = unit_check.refuse_other_unit(raw, mapping.units.output, where, means=mapping.rows == "dwells")
    remarks = (*content.remarks, *dropped, *other)
    out_unit, factor = OUTPUT_UNITS[mapping.units.output]
    serials = _serials(columns, mapping, where)
    extras = _extras(columns, mapping, where, content) | _spreads(columns, mapping, where, content)
    if mapping.rows == "dwells":
        return _as_dwells(columns, raw * factor, serials, extras, mapping, content, where, remarks)
    clock = seconds(columns, mapping, content, where)
    breaks, wide = gaps_of(clock.seconds, columns.get("dwell"), breaks, mapping, where)
    if len(set(serials)) > 1:
        raise DataRejected(
            f"{where}: samples of {len(set(serials))} units in one file, one unit is needed; divide the file"
        )
    time = clock.seconds - clock.seconds[0]
    twice = _twice(time, raw)
    faults = sample_faults.look(raw)
    remarks = (
        *remarks,
        *clock.remarks,
        *twice,
        *wide,
        *sample_faults.refuse_or_remark(faults, raw, time, mapping, where),
    )
    bad = faults.bad if mapping.faulty == "leave-out" else np.zeros(len(raw), dtype=bool)
    samples = pd.DataFrame({"unit": serials, "slot": 0, "record": 0, "kind": "dwell", "time_s": time})
    samples[list(AXES)] = np.nan  # of the axes that the device does not have
    samples[list(mapping.letters)] = raw * factor
    samples = samples.assign(**extras)
    labels = columns["dwell"].astype(str).tolist() if "dwell" in columns else None
    intervals = stretches(labels, sample_faults.mended(raw, faults, bad), time, breaks, mapping, where)
    record = np.zeros(len(samples), dtype=np.int64)
    for number, (a, b) in enumerate(zip(intervals.first, intervals.last, strict=True)):
        record[a:b] = number + 1
    record[bad] = 0
    intervals, record, short = sample_faults.without_short(intervals, record)
    samples["record"] = record
    dwells = None
    if len(intervals):
        numbers, numbered = dwell_numbers(intervals.labels, [serials[0]] * len(intervals))
        dwells = _means(samples, intervals, numbers, tuple(extras), mapping)
        remarks = (*remarks, *numbered, *pose_check.refuse_or_remark(dwells, mapping, where))
        dwells, held = with_held_out(dwells, mapping.verify, where)
        remarks = (*remarks, *held)
    remarks = (
        *remarks,
        *intervals.remarks,
        *short,
        *time_doubts(time, extras.get("unit_C"), intervals, mapping, searched=labels is None),
    )
    return Imported(samples, dwells, out_unit, remarks, tuple(faults.rows(time)))


def _columns(table: pd.DataFrame, mapping: Mapping, where: str) -> dict[str, pd.Series]:
    names = list(table.columns)
    columns: dict[str, pd.Series] = {}
    for meaning, source_column in mapping.columns.items():
        column = column_name(names, source_column)
        if not column:
            raise DataRejected(
                f"{where}: column '{shown(source_column)}' (for {meaning}) is not there; {did_you_mean(source_column, names)}"
            )
        columns[meaning] = table[column]
    meanings = [meaning for meaning in ("time", *AXES) if meaning in columns]
    mapped = [str(columns[meaning].name) for meaning in meanings]
    if len(set(mapped)) < len(mapped):
        raise DataRejected(
            f"{where}: {', '.join(meanings)} are columns {', '.join(map(shown, mapped))}, different ones are needed; "
            "correct --map"
        )
    return columns


def _with_numbers(
    columns: dict[str, pd.Series], mapping: Mapping, where: str, content: Content
) -> tuple[Index, dict[str, pd.Series], tuple[str, ...]]:
    """Rows that are kept (k,), the columns with these rows, and a remark on the others, which lack a number."""
    count = len(next(iter(columns.values())))
    if mapping.gaps == "refuse":
        return np.arange(count), columns, ()
    whole = np.ones(count, dtype=bool)
    for meaning, column in columns.items():
        if (
            meaning in {"unit", "dwell"}
            or column.dtype.kind in "mM"
            or (meaning == "time" and clocks.is_stamps(column))
        ):
            whole &= column.notna().to_numpy()
        else:
            whole &= np.isfinite(values.as_numbers(column, where, flags=meaning not in MEANINGS))
    kept = np.flatnonzero(whole)
    if not kept.size:
        raise DataRejected(f"{where}: no row has a number in every mapped column, one is needed at least; check --map")
    if kept.size == count:
        return kept, columns, ()
    first = content.row(int(np.flatnonzero(~whole)[0]))
    remark = f"{count - kept.size} of {count} rows without a number left out, the first is {first}; dwells end there"
    return kept, {name: one.iloc[kept].reset_index(drop=True) for name, one in columns.items()}, (remark,)


def _twice(time: Array, raw: Array) -> tuple[str, ...]:
    """A remark on rows that repeat the row before, with its time: they count twice in the means and their noise."""
    same = (np.diff(time) == 0.0) & np.all(np.diff(raw, axis=0) == 0.0, axis=1)
    if not same.any():
        return ()
    first = int(np.flatnonzero(same)[0]) + 2
    return (
        f"CHECK THE ROWS: {int(same.sum())} rows repeat the row before them with its time and values, the first is row {first}",
    )


def _serials(columns: dict[str, pd.Series], mapping: Mapping, where: str) -> list[str]:
    if "unit" in columns:
        serials = ["" if pd.isna(value) else values.text(value) for value in columns["unit"].tolist()]
        refuse_unusable_serials(
            dict.fromkeys(serials), f"{where}: column '{columns['unit'].name}'", "correct it in the file"
        )
        return serials
    if not mapping.unit:
        raise WrongUse(f"{where}: no unit is mapped, a serial number is needed; give --unit SN")
    refuse_unusable_serials([mapping.unit], where)
    return [mapping.unit] * len(next(iter(columns.values())))


def _extras(columns: dict[str, pd.Series], mapping: Mapping, where: str, content: Content) -> dict[str, Array]:
    """Temperature, other known columns and covariates by the names of the tables."""
    extras: dict[str, Array] = {}
    for meaning, column in columns.items():
        if meaning in ("time", *AXES, "unit", "dwell", *SPREAD_COLUMNS):
            continue
        name = MEANINGS.get(meaning, meaning)
        numbers = values.finite(column, where, content, flags=meaning not in MEANINGS)
        if meaning in ("temperature", "chamber"):
            numbers = _celsius(numbers, mapping.units.temperature)
        values.refuse_outside(numbers, name, where)
        extras[name] = numbers
    return extras


def _spreads(columns: dict[str, pd.Series], mapping: Mapping, where: str, content: Content) -> dict[str, Array]:
    """Standard deviations, in the unit and the order of axes of the outputs that they belong to."""
    factor, spreads = OUTPUT_UNITS[mapping.units.output][1], {}
    for letter, axis in zip(mapping.letters, mapping.axes, strict=True):
        if f"sd_{axis}" in columns:
            name = f"sd_{letter}"
            spreads[name] = factor * values.finite(columns[f"sd_{axis}"], where, content)
            values.refuse_outside(spreads[name], name, where)
    return spreads


def _celsius(values: Array, unit: str) -> Array:
    if unit == "K":
        return values - 273.15
    return (values - 32.0) / 1.8 if unit == "degF" else values


def _means(
    samples: pd.DataFrame, intervals: Stretches, numbers: Index, extras: tuple[str, ...], mapping: Mapping
) -> pd.DataFrame:
    """Dwells in the exchange format; ``numbers``: of the intervals."""
    letters = mapping.letters
    m = len(letters)
    recorded = samples[[*letters, *extras]].to_numpy(dtype=np.float64)
    time, record = samples["time_s"].to_numpy(dtype=np.float64), samples["record"].to_numpy()
    inside = [
        a + np.flatnonzero(record[a:b] == k + 1)
        for k, (a, b) in enumerate(zip(intervals.first, intervals.last, strict=True))
    ]
    turning = [name == TILT or (name in BY_COLUMN and BY_COLUMN[name].unit == "°") for name in extras]
    angles = m + np.flatnonzero(turning)
    parts = [_of_one_turn(recorded[rows], angles) for rows in inside]
    mean = np.stack([part.mean(axis=0) for part in parts])
    sd = np.stack([part[:, :m].std(axis=0, ddof=1) if len(part) > 1 else np.zeros(m) for part in parts])
    frame = pd.DataFrame(
        {
            "unit": samples["unit"].iloc[0],
            "dwell": numbers,
            "time_s": [float(time[rows].mean()) for rows in inside],
            **{f"out_{axis}": mean[:, k] for k, axis in enumerate(letters)},
            **{f"sd_{axis}": sd[:, k] for k, axis in enumerate(letters)},
            "n": [rows.size for rows in inside],
            "duration_s": [float(time[rows[-1]] - time[rows[0]]) for rows in inside],
            **{name: mean[:, m + k] for k, name in enumerate(extras)},
            "record": np.arange(len(intervals)) + 1,
            "pose": list(intervals.labels),
        }
    )
    return _finished(frame, mapping)


def _of_one_turn(samples: Array, angles: Index) -> Array:
    """Samples (k, c) whose columns of angles, °, are within half a turn of the first sample: the mean of ±180° is not 0°."""
    apart = samples[:, angles] - samples[0, angles]
    samples[:, angles] -= 360.0 * np.rint(apart / 360.0)
    return samples


def _as_dwells(
    columns: dict[str, pd.Series],
    output: Array,
    serials: list[str],
    extras: dict[str, Array],
    mapping: Mapping,
    content: Content,
    where: str,
    remarks: tuple[str, ...],
) -> Imported:
    """A file whose rows are dwells."""
    count = pd.Series(serials).groupby(serials).cumcount().to_numpy()
    time = count.astype(np.float64)
    if "time" in columns:
        time = seconds(columns, mapping, content, where, dwells=True).seconds
        backwards(time, serials, where, together=True)  # units may follow one another, or alternate
        time = time - float(time.min())
    labels = columns["dwell"].astype(str).tolist() if "dwell" in columns else [f"dwell {k}" for k in count]
    numbers, numbered = dwell_numbers(labels, serials)
    frame = pd.DataFrame({"unit": serials, "dwell": numbers, "time_s": time})
    frame[[f"out_{axis}" for axis in mapping.letters]] = output
    sound, still = sample_faults.sound_dwells(extras, labels, mapping, where)
    frame = _finished(frame.assign(record=count, pose=labels, **extras), mapping)
    dwells = exchange.checked(frame[sound].reset_index(drop=True), where=where, foreign=True)
    remarks = (*remarks, *numbered, *still, *pose_check.refuse_or_remark(dwells, mapping, where))
    dwells, held = with_held_out(dwells, mapping.verify, where)
    return Imported(None, dwells, OUTPUT_UNITS[mapping.units.output][0], (*remarks, *held))


def _finished(frame: pd.DataFrame, mapping: Mapping) -> pd.DataFrame:
    """The columns that every dwell has, and the reference if poses are stated."""
    frame = frame if "slot" in frame else frame.assign(slot=0)
    frame = frame.assign(kind="dwell", soak=0, out_unit=OUTPUT_UNITS[mapping.units.output][0])
    if TILT in frame.columns:
        return _tilted(frame, mapping)
    if not (mapping.poses or mapping.face):
        return _turned(frame, mapping)
    if mapping.norm_g is None:
        raise WrongUse("import: poses are stated, local gravity is needed with them; give --local-g M/S2")
    up = [mapping.poses.get(label, mapping.face) for label in frame["pose"]]
    frame[["force_x", "force_y", "force_z"]] = np.array([FACES[face] for face in up]) * mapping.norm_g
    if mapping.headings:
        frame["heading_deg"] = [mapping.headings[label] for label in frame["pose"]]
    return frame


def _turned(frame: pd.DataFrame, mapping: Mapping) -> pd.DataFrame:
    """The force at the angles of a table, as that of a station, where the file has angles and no force."""
    if not set(ANGLE_COLUMNS) <= set(frame.columns) or set(FORCE_COLUMNS) & set(frame.columns):
        return frame
    outer, inner = np.radians(frame[[*ANGLE_COLUMNS]].to_numpy(dtype=np.float64)).T
    return _with_force(frame, frames.force_from_angles(outer, inner), mapping)


def _with_force(frame: pd.DataFrame, force: Array, mapping: Mapping) -> pd.DataFrame:
    """The dwells with a force (n, 3), in units of local gravity; that is the standard value where it is not given."""
    gravity = 1.0 if mapping.norm_g is None else mapping.norm_g
    return frame.assign(**{name: gravity * force[:, k] for k, name in enumerate(FORCE_COLUMNS)})


def _tilted(frame: pd.DataFrame, mapping: Mapping) -> pd.DataFrame:
    """The force of a single axis turned in one plane: g·sin of its angle above the horizontal along it, g·cos of it across."""
    angle = np.radians(frame[TILT].to_numpy(dtype=np.float64))
    force = frames.without_rounding(np.stack([np.sin(angle), np.cos(angle), 0.0 * angle], axis=-1))
    return _with_force(frame.drop(columns=TILT), force, mapping)
