"""Dwells and temperature histories in the exchange format, from a file or from a run of the archive."""

from collections.abc import Iterable
from pathlib import Path

import numpy as np
import pandas as pd

from inertial.arrays import Array, Index
from inertial.quantities import (
    ANGLE_COLUMNS,
    FORCE_COLUMNS,
    KNOWN_COLUMNS,
    OUTPUT_COLUMNS,
    SLOW_COLUMNS,
    SPREAD_COLUMNS,
)
from pipelines.archive import Archive, Run
from pipelines.importers import files, values
from pipelines.tables.dwell_table import output_axes
from schemas import table_check, tables
from schemas.errors import DataRejected, WrongUse, close_matches, did_you_mean
from schemas.foreign import shown
from schemas.serials import refuse_unusable_serials

REQUIRED = ("unit", "dwell", "time_s")
_TEXTS = ("kind", "pose", "out_unit", "status")
_CORRECT = "correct it in the file"
_LARGEST_FORCE = 1e3
_METRES = (9.7, 9.9)
"""A reference of this size is gravity in m/s², not 9.8 g in a centrifuge."""


def is_exchange(names: Iterable[object]) -> bool:
    """Whether columns are those of a table of dwells in the exchange format."""
    known = {str(name) for name in names}
    return set(REQUIRED) <= known and bool(output_axes(known))


def read_dwells(source: str | Path, *, archive: str | Path | None = None) -> pd.DataFrame:
    """Dwells in the exchange format, checked, in order of unit and dwell.

    Parameters
    ----------
    source : a CSV, TSV or Parquet file (also .gz), or the name of a run in the archive
    archive : the archive's folder where `source` is a run; the default folder otherwise

    Raises
    ------
    DataRejected
        A required column is missing, a value is not finite, a dwell is duplicated, a reference is incomplete.
    WrongUse
        There is no such file and no such run.
    """
    if files.is_file(source):
        frame, _ = files.read(Path(source))
        return checked(frame, where=Path(source).name, foreign=True)
    return dwells_of_run(_run(source, archive))


def read_history(source: str | Path, *, archive: str | Path | None = None) -> pd.DataFrame:
    """The temperatures against time of a file or run: `time_s` with `unit_C`, `chamber_C` or both, in order of unit and time."""
    if files.is_file(source):
        frame, _ = files.read(Path(source))
        return checked_history(frame, Path(source).name, foreign=True)
    return history_of_run(_run(source, archive))


def dwells_of_run(run: Run) -> pd.DataFrame:
    """The dwells of a run, as :func:`read_dwells` reads them by its name.

    Raises
    ------
    WrongUse
        The run has other procedures than the multi-position test, whose records are no dwells.
    """
    refuse_other_procedures(run, "dwells")
    return checked(run.table("dwells"), where=f"run {run.id}")


def history_of_run(run: Run) -> pd.DataFrame:
    """The temperatures of a run against time, as :func:`read_history` reads them by its name."""
    return checked_history(run.table("history"), f"run {run.id}", foreign=False)


def refuse_other_procedures(run: Run, wanted: str) -> None:
    """Refuse a run of other procedures than the multi-position test, of which alone ``wanted`` come; says what it has instead."""
    kinds = [part["kind"] for part in (run.about.get("recipe") or {}).get("procedures", ())]
    imported = not kinds and "procedure_findings" in (tables := run.tables()) and "dwells" not in tables
    if not imported and (not kinds or "multi_position" in kinds):
        return
    found = "a dynamic test was imported" if imported else f"it measured {', '.join(dict.fromkeys(kinds))}"
    shown = "points" if imported and "procedure_figures" not in run.tables() else "figures"
    remedy = "import one" if imported else "list it in a recipe's procedures and measure"
    raise WrongUse(
        f"run {run.id} has no {wanted}: {found}, and they come from the multi-position test; {remedy}. What this run found, "
        "and whether the models of its procedures are adequate: "
        f"'tumbleline show {run.id} procedure_findings'; its {shown}: 'tumbleline show {run.id} procedure_{shown}'"
    )


def checked(frame: pd.DataFrame, *, where: str, foreign: bool = False) -> pd.DataFrame:
    """The dwells with their types made right, or `DataRejected` with row, value and what is needed.

    Parameters
    ----------
    foreign : whether they come from elsewhere; an archive keeps the serial numbers that older versions accepted.
    """
    _require(frame, REQUIRED, where)
    _refuse_half_an_axis(frame, where)
    empty = [name for name in ("unit_C", "chamber_C") if name in frame.columns and frame[name].isna().all()]
    frame = frame.drop(columns=empty)  # not recorded, which a diagnosis tells
    frame["unit"] = _units(frame, where, foreign=foreign)
    for column in frame.columns:
        if column == "unit" or column in _TEXTS:
            continue
        if column in KNOWN_COLUMNS or pd.api.types.is_numeric_dtype(frame[column]):
            frame[column] = _numbers(frame, column, where)
    frame["dwell"] = _dwell_numbers(frame, where)
    complete_references(frame, where)
    for names in (SPREAD_COLUMNS, SLOW_COLUMNS):
        _all_or_none(frame, tuple(names[axis] for axis in output_axes(frame.columns)), where)
    _plausible(frame, where)
    frame = table_check.check("dwells", frame, where=where)
    return frame.sort_values(["unit", "dwell"], kind="stable").reset_index(drop=True)


def _refuse_half_an_axis(frame: pd.DataFrame, where: str) -> None:
    """Refuse a table without an output, and a table whose output of an axis has another name."""
    axes = output_axes(frame.columns)
    if not axes:
        _require(frame, OUTPUT_COLUMNS, where)
    for axis in set(range(len(OUTPUT_COLUMNS))) - set(axes):
        name, others = OUTPUT_COLUMNS[axis], [str(c) for c in frame.columns if c not in KNOWN_COLUMNS]
        if SPREAD_COLUMNS[axis] in frame.columns or close_matches(name, others):
            _require(frame, (name,), where)


def complete_references(frame: pd.DataFrame, where: str) -> None:
    """Add the forces across the axes of a device with one or two, 0 g, where those along them are stated.

    Raises DataRejected: some components of the force, or one of two angles, are missing.
    """
    axes = output_axes(frame.columns)
    if len(axes) < len(OUTPUT_COLUMNS) and all(FORCE_COLUMNS[axis] in frame.columns for axis in axes):
        for name in FORCE_COLUMNS:
            if name not in frame.columns:
                frame[name] = 0.0
    _all_or_none(frame, FORCE_COLUMNS, where)
    _all_or_none(frame, ANGLE_COLUMNS, where)


def _run(source: str | Path, archive: str | Path | None) -> Run:
    store = Archive(archive)
    if not store.runs():
        raise WrongUse(
            f"'{shown(str(source))}': neither a file nor a run (the archive {store.root} is empty); name a file of dwells, "
            "or give the archive with --archive"
        )
    return store.run(str(source))


def _require(frame: pd.DataFrame, names: Iterable[str], where: str) -> None:
    missing = [name for name in names if name not in frame.columns]
    if missing:
        columns = list(map(str, frame.columns))
        close = [f"{name}: {did_you_mean(name, columns)}" for name in missing[:3] if close_matches(name, columns)]
        hints = "; ".join(close) or f"known: {', '.join(columns)}"
        what, are, it = ("columns", "are", "them") if len(missing) > 1 else ("column", "is", "it")
        raise DataRejected(
            f"{where}: {what} {', '.join(missing)} {are} missing; {hints}; rename {it}, or use 'tumbleline import --map'"
        )


def _units(frame: pd.DataFrame, where: str, *, foreign: bool) -> list[str]:
    names = ["" if pd.isna(value) else values.text(value) for value in frame["unit"].tolist()]
    if "" in names:
        raise DataRejected(f"{where}: row {names.index('') + 1}, column unit: empty, a name is needed; fill it in")
    if foreign:
        refuse_unusable_serials(dict.fromkeys(names), f"{where}: column unit", _CORRECT)
    return names


def _numbers(frame: pd.DataFrame, column: str, where: str) -> Array:
    if column == "time_s" and values.is_moment(frame[column]):
        return values.seconds(frame[column], where)
    numbers = values.as_numbers(frame[column], where, flags=column not in KNOWN_COLUMNS)
    bad = np.flatnonzero(~np.isfinite(numbers))
    needed = (*REQUIRED, *OUTPUT_COLUMNS, *FORCE_COLUMNS, *ANGLE_COLUMNS)
    if bad.size and not (column not in needed and bool(np.all(pd.isna(frame[column])))):
        row = int(bad[0])
        cell = f"row {row + 1} (unit {frame['unit'].iloc[row]}), column {shown(column)}"
        raise DataRejected(
            f"{where}: {cell}: found {shown(frame[column].iloc[row])}, a finite number is needed ({bad.size} such rows); "
            "measure again, or leave the row or the column out"
        )
    return numbers


def _dwell_numbers(frame: pd.DataFrame, where: str) -> Index:
    numbers = np.asarray(frame["dwell"], dtype=np.float64)
    bad = np.flatnonzero((numbers != np.rint(numbers)) | (numbers < 0) | (numbers > values.BOUNDS["dwell"][1]))
    if bad.size:
        found = f"row {bad[0] + 1}, column dwell: found {numbers[bad[0]]}"
        raise DataRejected(f"{where}: {found}, a whole number from 0 on is needed; correct it")
    return numbers.astype(np.int64)


def _all_or_none(frame: pd.DataFrame, names: tuple[str, ...], where: str) -> None:
    there = [name for name in names if name in frame.columns]
    missing = [name for name in names if name not in there]
    if there and missing:
        raise DataRejected(
            f"{where}: {', '.join(there)} without {', '.join(missing)}; give all of {', '.join(names)} or none"
        )


def _plausible(frame: pd.DataFrame, where: str) -> None:
    if frame.empty:
        return  # a run whose units were all refused: who judges it says that nothing is left
    _inside(frame, where)
    if FORCE_COLUMNS[0] in frame.columns:
        size = float(np.median(np.linalg.norm(frame[list(FORCE_COLUMNS)].to_numpy(dtype=np.float64), axis=1)))
        if not 0.0 < size < _LARGEST_FORCE or _METRES[0] < size < _METRES[1]:
            remedy = (
                "give force_x, force_y, force_z in g, not m/s² or counts"
                if size > 0.0
                else "of an axis across gravity give the force across it, such as force_z = 1"
            )
            raise DataRejected(f"{where}: the reference force has a norm of {size:.4g}, about 1 is needed; {remedy}")
    _countable(frame, where)


def _inside(frame: pd.DataFrame, where: str) -> None:
    """Refuse impossible numbers in any column."""
    for column in frame.columns:
        if pd.api.types.is_numeric_dtype(frame[column]):
            values.refuse_outside(np.asarray(frame[column], dtype=np.float64), str(column), where)


def _countable(frame: pd.DataFrame, where: str) -> None:
    """Refuse outputs in an unknown unit, and dwells that all have the same time."""
    if "out_unit" in frame.columns:
        unknown = sorted({str(value) for value in frame["out_unit"].dropna()} - {*tables.OUTPUT_UNITS})
        if unknown:
            known = ", ".join(tables.OUTPUT_UNITS)
            raise DataRejected(
                f"{where}: column out_unit: found '{shown(unknown[0])}', one of {known} is needed; correct it"
            )
    for unit, rows in frame.groupby("unit", sort=False):
        if len(rows) > 1 and float(np.ptp(rows["time_s"])) == 0.0:
            raise DataRejected(
                f"{where}: column time_s: all {len(rows)} dwells of unit {unit} at {rows['time_s'].iloc[0]:g} s, the time of "
                "each is needed, in s; record it"
            )


def checked_history(frame: pd.DataFrame, where: str, *, foreign: bool) -> pd.DataFrame:
    """Temperatures against time with their types made right, or `DataRejected` with what is needed; see :func:`checked`."""
    _require(frame, ("time_s",), where)
    heats = [name for name in ("unit_C", "chamber_C") if name in frame.columns]
    if not heats:
        hint = did_you_mean("unit_C", map(str, frame.columns))
        raise DataRejected(f"{where}: neither unit_C nor chamber_C, a temperature is needed; {hint}")
    frame = frame.copy()
    if "unit" in frame.columns:
        frame["unit"] = _units(frame, where, foreign=foreign)
    named = frame if "unit" in frame.columns else frame.assign(unit="history")
    for column in ("time_s", *heats):
        frame[column] = _numbers(named, column, where)
    _inside(frame, where)
    order = [name for name in ("unit", "time_s") if name in frame.columns]
    frame = frame.sort_values(order, kind="stable").reset_index(drop=True)
    twice = frame.duplicated(order)
    if twice.any():
        row = int(np.flatnonzero(twice.to_numpy())[0])
        raise DataRejected(
            f"{where}: time {frame['time_s'].iloc[row]} s is there twice, once is needed; remove one of the two"
        )
    return frame
