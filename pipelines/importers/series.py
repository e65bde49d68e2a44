"""A record of evenly spaced samples from a file or an import: input of an Allan deviation or a spectrum."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from inertial.arrays import Array
from pipelines.archive import Run
from pipelines.importers import clocks, files, guesses
from pipelines.importers.content import Content
from pipelines.importers.mapping import TIME_UNITS
from pipelines.importers.stated_units import output_unit
from pipelines.importers.values import finite_column
from schemas.errors import DataRejected, WrongUse
from schemas.foreign import shown
from schemas.units import AXES

UNEVEN = 0.5
"""Largest deviation of a time from the even grid, in steps; above it a sample is missing or duplicated."""

EVEN = 1e-3
"""Largest range of the steps of a column, over their mean, with which it rises evenly: a clock, no output with noise."""

FEWEST_STEPS = 16
"""Steps from which on a column that always rises is a time: noise does so in one of 10¹⁴ records."""


@dataclass(frozen=True)
class EvenSeries:
    """Evenly spaced samples.

    names : of the channels; values : (channels, n), in ``unit``; where : the file or run, for messages
    recognised : what was not stated and how it was taken; empty where all was
    """

    names: tuple[str, ...]
    values: Array
    rate_hz: float
    unit: str
    where: str
    recognised: str = ""


def series_of_file(
    path: Path, columns: Sequence[str], *, time: str, time_unit: str, rate_hz: float | None, unit: str
) -> EvenSeries:
    """The channels of a file of samples.

    Parameters
    ----------
    columns : names, or numbers from 1 for a text file without a header; where none is given all columns of numbers but the time,
        and only those that state a unit of an output where some do
    time : column of the time, in ``time_unit``; rate_hz : Hz; without both the columns are recognised, with their units
    unit : of the output, for printed results; that which the columns state if it is not given

    Raises
    ------
    WrongUse
        Both a time and a rate, or neither and no column is recognised as the time.
    DataRejected
        A column is not there or not of numbers, a value is not finite, or the samples are not evenly spaced.
    """
    if time and rate_hz is not None:
        raise WrongUse(f"{path.name}: one of --map time=COLUMN and --rate HZ is needed; give one of the two")
    content, _ = files.read_content(path)
    table, found, known_unit = content.table, "", ""
    if taken := not time and rate_hz is None:
        time, found, columns, known_unit = _recognised(content, path, columns, time_unit)
    time_unit = time_unit or found or "s"
    if time_unit not in TIME_UNITS:
        raise WrongUse(
            f"--unit-of: time: found '{shown(time_unit)}', one of {', '.join(TIME_UNITS)} is needed; correct it"
        )
    chosen = list(columns) or [n for n in table.columns if n != time and pd.api.types.is_numeric_dtype(table[n])]
    if not chosen:
        raise DataRejected(f"{path.name}: no column of numbers, one at least is needed; name one with --map")
    recognised = ""
    if rate_hz is not None and not columns:
        even = [name for name in chosen if _is_clock(finite_column(table, name, path.name))]
        if even and len(even) < len(chosen):
            chosen = [name for name in chosen if name not in even]
            recognised = f"{', '.join(map(shown, even))} rises evenly and is no output"
    stated = {name: output_unit(content.units.get(name, "")) for name in chosen}
    if not columns and any(stated.values()):
        chosen = [name for name in chosen if stated[name]]
    of_chosen = {stated[name] for name in chosen if name in stated}
    unit = unit or known_unit or (of_chosen.pop() if len(of_chosen) == 1 else "")
    if taken:
        listed = ", ".join(map(shown, chosen))
        recognised = (
            f"recognised: time '{shown(time)}' in {time_unit}, {listed} in {unit or 'an unknown unit'}; else --map"
        )
    if rate_hz is not None:
        recognised = "; ".join(filter(None, [recognised, *_lost(table.drop(columns=chosen))]))
    values = np.stack([finite_column(table, name, path.name) for name in chosen])
    _refuse_clock(chosen, values, path.name, named=bool(columns), timed=bool(time))
    rate = rate_hz or _rate(_seconds(table, time, time_unit, path.name), path.name)
    return EvenSeries(tuple(chosen), values, float(rate), unit, path.name, recognised)


def _recognised(
    content: Content, path: Path, columns: Sequence[str], time_unit: str
) -> tuple[str, str, Sequence[str], str]:
    """Column of the time and its unit, those of the outputs where none are named, and their unit, as an import takes them."""
    known = guesses.guesses(content)
    time = known.column("time")
    if not time:
        found = ", ".join(shown(str(name)) for name in content.table.columns)
        raise WrongUse(
            f"{path.name}: none of the columns {found} is recognised as the time; give --map time=COLUMN or --rate HZ"
        )
    if not time_unit and known.time_unit.reason.endswith(guesses.CHECK):  # N would be off by the root of a wrong rate
        raise WrongUse(
            f"{path.name}: time '{shown(time)}': {known.time_unit.reason.removesuffix(guesses.CHECK)}, one of them is needed; "
            f"add --unit-of time={known.time_unit.meaning} if it is that, or --rate HZ"
        )
    axes = [name for axis in AXES if (name := known.column(axis))]
    return time, known.time_unit.meaning or "s", columns or axes, known.output.meaning if axes else ""


def series_of_run(run: Run, record: int | None) -> EvenSeries:
    """The longest stretch at rest of an import's samples, or the stretch with the given number.

    Raises
    ------
    WrongUse
        The run has no samples, or no such stretch.
    """
    if "samples" not in run.tables():
        raise WrongUse(
            f"run {run.id}: it has no samples, they are needed; name a file of samples, or a run with a static record"
        )
    samples = run.table("samples")
    counts = samples.loc[samples["record"] > 0, "record"].value_counts()
    if counts.empty or (record is not None and record not in counts.index):
        known = ", ".join(map(str, sorted(counts.index)[:8])) or "none"
        raise WrongUse(f"run {run.id}: no stretch at rest has the number {record}; there are {known}")
    chosen = int(counts.index[0]) if record is None else record
    stretch = samples[samples["record"] == chosen]
    where = f"run {run.id}, stretch {chosen}"
    rate = _rate(stretch["time_s"].to_numpy(dtype=np.float64), where)
    unit = str(run.table("dwells")["out_unit"].iloc[0]) if "dwells" in run.tables() else ""
    values = np.stack([stretch[axis].to_numpy(dtype=np.float64) for axis in AXES])
    return EvenSeries(AXES, values, rate, unit, where)


def _refuse_clock(names: Sequence[str], values: Array, where: str, *, named: bool, timed: bool) -> None:
    """Refuse a time or a counter among the channels: it rises from row to row and has no noise.

    Parameters
    ----------
    named : whether the channels were named: then only a column that rises evenly is none
    timed : whether the column of the time is known
    """
    for name, column in zip(names, values, strict=True):
        steps = np.diff(column)
        if steps.size < FEWEST_STEPS or not bool(np.all(steps > 0.0)):
            continue
        if not named or _is_clock(column):
            instead = "" if timed else f"give --map time={shown(name)} instead of --rate, or "
            raise DataRejected(
                f"{where}: column '{shown(name)}' rises in every row (from {column[0]:g} to {column[-1]:g}) as a time or a "
                f"counter does, the output of a sensor at rest is needed; {instead}name the channels with --map"
            )


def _lost(table: pd.DataFrame) -> list[str]:
    """What the counters among columns that are no output say of lost samples; their steps back, to zero, are passed over."""
    told: list[str] = []
    for name in table.columns[[pd.api.types.is_numeric_dtype(kind) for kind in table.dtypes]]:
        steps = np.diff(table[name].to_numpy(dtype=np.float64))
        if steps.size < FEWEST_STEPS or np.median(steps) != 1.0 or np.any(steps % 1.0):
            continue
        over = steps[steps >= 0.0] - 1.0  # a stamp that is late is followed by a shorter step, and nothing is lost
        if (lost := int(over.sum())) > 0:
            told.append(
                f"{lost} samples are lost at {np.count_nonzero(over > 0.0)} places by '{shown(str(name))}', and the record is "
                "taken as one without gaps; cut it there if they are many"
            )
    return told


def _seconds(table: pd.DataFrame, name: str, unit: str, where: str) -> Array:
    """Times (n,) of a column, s: of numbers in a unit, or of dates."""
    if name in table.columns and clocks.is_stamps(table[name]):
        return clocks.stamps(table[name], where).seconds
    return TIME_UNITS[unit] * finite_column(table, name, where)


def _is_clock(column: Array) -> bool:
    """Whether a column (n,) rises evenly."""
    steps = np.diff(column)
    return steps.size >= FEWEST_STEPS and steps.min() > 0.0 and float(np.ptp(steps)) < EVEN * float(steps.mean())


def _rate(time: Array, where: str) -> float:
    """Rate of even times (n,), s; refused where samples are missing or doubled."""
    if time.size < 2 or not time[-1] > time[0]:
        raise DataRejected(
            f"{where}: the time does not run forward, two samples at different times are needed; correct it"
        )
    step = float(np.median(np.diff(time)))
    typical = (time[-1] - time[0]) / (time.size - 1)
    off = np.flatnonzero(np.abs(np.diff(time) - step) > UNEVEN * step) if step > 0.0 else np.arange(1)
    if off.size:
        raise DataRejected(
            f"{where}: after row {off[0] + 1} the time steps by {time[off[0] + 1] - time[off[0]]:.6g} s, {step:.6g} s is the "
            f"step elsewhere ({off.size} such places), evenly spaced samples are needed; cut the record there, or give --rate HZ "
            "in place of the time if only its stamps are late"
        )
    return 1.0 / float(typical)
