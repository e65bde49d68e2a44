"""Foreign columns turned into a raw record and its dwells; contradictions to the mapping are refused."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import pandas as pd

from inertial.arrays import Array, Index
from inertial.quantities import SPREAD_COLUMNS
from pipelines.importers import clocks, exchange, pose_check, sample_faults, unit_check, values
from pipelines.importers.content import Content
from pipelines.importers.documents import SampleFaultDocument
from pipelines.importers.mapping import MEANINGS, OUTPUT_UNITS, Mapping
from pipelines.importers.record_dwells import dwell_numbers, dwells_of_stretches, finished, with_held_out
from pipelines.importers.record_time import backwards, gaps_of, seconds, time_doubts
from pipelines.importers.stated_units import column_name
from pipelines.importers.stretches import stretches
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
    columns = _columns(content, mapping, where)
    rows, columns, dropped = _with_numbers(columns, mapping, where, content)
    left_out_before = {int(k) + 1 for k in np.flatnonzero(np.diff(rows) > 1)}
    breaks = sorted({int(np.searchsorted(rows, k)) for k in breaks} | left_out_before)
    raw = np.column_stack([values.finite(columns[axis], where, content) for axis in mapping.axes])
    raw = raw * [1.0 if sign == "+" else -1.0 for sign in mapping.signs[: len(mapping.axes)]]
    remarks = (*content.remarks, *dropped)
    if len(mapping.axes) == len(AXES):  # the norm is that of three
        remarks += unit_check.refuse_other_unit(raw, mapping.units.output, where, means=mapping.rows == "dwells")
    out_unit, factor = OUTPUT_UNITS[mapping.units.output]
    serials = _serials(columns, mapping, where)
    extras = _extras(columns, mapping, where, content) | _spreads(columns, mapping, where, content)
    if mapping.rows == "dwells":
        return _as_dwells(columns, raw * factor, serials, extras, mapping, content, where, remarks)
    clock = seconds(columns, mapping, content, where)
    breaks, wide = gaps_of(clock, columns.get("dwell"), breaks, mapping, where)
    if len(set(serials)) > 1:
        raise DataRejected(
            f"{where}: samples of {len(set(serials))} units in one file, one unit is needed; divide the file"
        )
    time = clock.seconds - clock.seconds[0]
    faults = sample_faults.look(raw)
    faulty = sample_faults.refuse_or_remark(faults, raw, time, mapping, where)
    remarks = (*remarks, *clock.remarks, *_twice(time, raw), *wide, *faulty)
    bad = faults.bad if mapping.faulty == "leave-out" else np.zeros(len(raw), dtype=bool)
    samples = pd.DataFrame({"unit": serials, "slot": 0, "record": 0, "kind": "dwell", "time_s": time})
    samples[list(AXES)] = np.nan  # of the axes that the device does not have
    samples[list(mapping.letters)] = raw * factor
    samples = samples.assign(**extras)
    labels = columns["dwell"].astype(str).tolist() if "dwell" in columns else None
    intervals = stretches(labels, sample_faults.mended(raw, faults, bad), time, breaks, mapping, where)
    record = np.zeros(len(samples), dtype=np.int64)
    for number, (a, b) in enumerate(intervals.spans, start=1):
        record[a:b] = number
    record[bad] = 0
    intervals, record, short = sample_faults.without_short(intervals, record)
    samples["record"] = record
    dwells = None
    if len(intervals):
        numbers, numbered = dwell_numbers(intervals.labels, [serials[0]] * len(intervals))
        dwells = dwells_of_stretches(samples, intervals, numbers, tuple(extras), mapping)
        remarks = (*remarks, *numbered, *pose_check.refuse_or_remark(dwells, mapping, where))
        dwells, held = with_held_out(dwells, mapping.verify, where)
        remarks += held
    doubts = time_doubts(time, extras.get("unit_C"), intervals, mapping, searched=labels is None)
    remarks = (*remarks, *intervals.remarks, *short, *doubts)
    return Imported(samples, dwells, out_unit, remarks, tuple(faults.rows(time)))


def _columns(content: Content, mapping: Mapping, where: str) -> dict[str, pd.Series]:
    names = list(content.table.columns)
    columns: dict[str, pd.Series] = {}
    for meaning, source_column in mapping.columns.items():
        column = column_name(names, source_column)
        if not column:
            raise DataRejected(
                f"{where}: column '{shown(source_column)}' (for {meaning}) is not there; {did_you_mean(source_column, names)}"
            )
        columns[meaning] = content.named(column) if meaning == "unit" else content.table[column]
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
    """Indices (k,) of the rows that have every number, the columns with these rows, and a remark on the others."""
    count = len(next(iter(columns.values())))
    if mapping.gaps == "refuse":
        return np.arange(count), columns, ()
    complete = np.ones(count, dtype=bool)
    for meaning, column in columns.items():
        stamps = column.dtype.kind in "mM" or (meaning == "time" and clocks.is_stamps(column))
        if meaning in {"unit", "dwell"} or stamps:
            complete &= column.notna().to_numpy()
        else:
            complete &= np.isfinite(values.as_numbers(column, where, flags=meaning not in MEANINGS))
    rows = np.flatnonzero(complete)
    if not rows.size:
        raise DataRejected(f"{where}: no row has a number in every mapped column, one is needed at least; check --map")
    if rows.size == count:
        return rows, columns, ()
    first = content.row(int(np.flatnonzero(~complete)[0]))
    remark = f"{count - rows.size} of {count} rows without a number left out, the first is {first}; dwells end there"
    return rows, {name: column.iloc[rows].reset_index(drop=True) for name, column in columns.items()}, (remark,)


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
        subject = f"{where}: column '{columns['unit'].name}'"
        refuse_unusable_serials(dict.fromkeys(serials), subject, "correct it in the file")
        return serials
    if not mapping.unit:
        raise WrongUse(f"{where}: no unit is mapped, a serial number is needed; give --units SN")
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
    count = pd.Series(serials).groupby(serials).cumcount().to_numpy()
    time = count.astype(np.float64)
    if "time" in columns:
        clock = seconds(columns, mapping, content, where, dwells=True)
        time, remarks = clock.seconds, (*remarks, *clock.remarks)
        backwards(time, serials, where, together=True)  # units may follow one another, or alternate
        time = time - float(time.min())
    labels = columns["dwell"].astype(str).tolist() if "dwell" in columns else [f"dwell {k}" for k in count]
    numbers, numbered = dwell_numbers(labels, serials)
    frame = pd.DataFrame({"unit": serials, "dwell": numbers, "time_s": time})
    frame[[f"out_{axis}" for axis in mapping.letters]] = output
    sound, still = sample_faults.sound_dwells(extras, labels, mapping, where)
    frame = finished(frame.assign(record=count, pose=labels, **extras), mapping)
    dwells = exchange.checked(frame[sound].reset_index(drop=True), where=where, foreign=True)
    remarks = (*remarks, *numbered, *still, *pose_check.refuse_or_remark(dwells, mapping, where))
    dwells, held = with_held_out(dwells, mapping.verify, where)
    return Imported(None, dwells, OUTPUT_UNITS[mapping.units.output][0], (*remarks, *held))
