"""Columns of foreign tables as numbers: other values, flags, dates and impossible values are refused."""

from typing import Any

import numpy as np
import pandas as pd

from inertial.arrays import Array
from inertial.quantities import (
    BY_COLUMN,
    FORCE_COLUMNS,
    LARGEST,
    LARGEST_TIME_S,
    RECORDED,
    SLOW_COLUMNS,
    SPREAD_COLUMNS,
)
from pipelines.importers.content import Content
from schemas.errors import DataRejected, did_you_mean
from schemas.foreign import foreign, shown

_FORCE_G = 1e4
_ANGLES = {name: BY_COLUMN[f"{name}_deg"] for name in ("outer", "inner")}
BOUNDS: dict[str, tuple[float, float]] = {
    **{row.column: (row.lowest, row.highest) for row in RECORDED},
    **{f"{name}_command_deg": (row.lowest, row.highest) for name, row in _ANGLES.items()},
    "duration_s": (0.0, LARGEST_TIME_S),
    **dict.fromkeys(FORCE_COLUMNS, (-_FORCE_G, _FORCE_G)),
    **dict.fromkeys((*SPREAD_COLUMNS, *SLOW_COLUMNS, "full_scale"), (0.0, LARGEST)),
    "rate_hz": (1e-9, 1e9),
    "n": (1.0, 2.0**53),
    **dict.fromkeys(("dwell", "soak", "record"), (0.0, 2.0**53)),
}
"""Possible values of a column with a meaning, in its unit; other columns lie within ± ``LARGEST``."""

_UNITS = {"s": "s", "C": "°C", "g": "g", "deg": "°", "hz": "Hz", "V": "V"}


def is_moment(values: pd.Series) -> bool:
    """Whether a column holds points in time, or spans of it, in a type for times."""
    return values.dtype.kind in "mM" or isinstance(values.dtype, pd.DatetimeTZDtype)


def seconds(values: pd.Series, where: str) -> Array:
    """Seconds since the first of points in time, or of spans of it, whatever unit the column has them in."""
    missing = np.flatnonzero(values.isna())
    if missing.size:
        raise DataRejected(
            f"{where}: row {int(missing[0]) + 1}, column '{shown(str(values.name))}': no time, one is needed in every row "
            f"({missing.size} such rows); repair the file or leave those rows out"
        )
    found = f"{where}: column '{shown(str(values.name))}': times that cannot be subtracted"
    with foreign(found, "give the time in seconds"):
        steps = (values - values.iloc[0]) / pd.Timedelta(seconds=1)
    return np.asarray(steps, dtype=np.float64)


def as_numbers(values: pd.Series, where: str, *, flags: bool = False) -> Array:
    """The values of a column, NaN for others.

    Parameters
    ----------
    flags : whether true and false count as 1 and 0.
    """
    if values.ndim > 1:
        raise DataRejected(f"{where}: column '{shown(str(values.columns[0]))}' is there twice; rename one of the two")
    name = shown(str(values.name))
    if is_moment(values):
        raise DataRejected(
            f"{where}: column '{name}' holds dates or times, numbers are needed; map it as time, or leave it out"
        )
    if not flags and _has_flags(values):
        raise DataRejected(
            f"{where}: column '{name}' holds true and false, numbers are needed; map another column, or leave it out"
        )
    with foreign(f"{where}: column '{name}' does not turn into numbers", "repair the column"):
        return np.asarray(pd.to_numeric(values, errors="coerce"), dtype=np.float64)


def finite(
    values: pd.Series, where: str, content: Content, *, flags: bool = False, needed: str = "a finite number"
) -> Array:
    """The numbers of a column; others are refused with row, and line if ``content`` knows it."""
    numbers = as_numbers(values, where, flags=flags)
    bad = np.flatnonzero(~np.isfinite(numbers))
    if bad.size:
        row = int(bad[0])
        raise DataRejected(
            f"{where}: {content.row(row)}, column '{shown(str(values.name))}': found {shown(str(values.iloc[row]))}, "
            f"{needed} is needed ({bad.size} such {'row' if bad.size == 1 else 'rows'}); repair the file, or add "
            "--set gaps=split to use what lies between"
        )
    refuse_outside(numbers, "", where, label=str(values.name))
    return numbers


def finite_column(
    table: pd.DataFrame, name: str, where: str, remedy: str = "remove the gap, or cut the recording there"
) -> Array:
    """The numbers of a column of samples or points; a missing column and a value that is no finite number are refused."""
    if name not in table.columns:
        raise DataRejected(f"{where}: column '{shown(name)}' is not there; {did_you_mean(name, list(table.columns))}")
    numbers = as_numbers(table[name], where)
    bad = np.flatnonzero(~(np.abs(numbers) < LARGEST))
    if bad.size:
        found = shown(str(table[name].iloc[bad[0]]))
        raise DataRejected(
            f"{where}: row {bad[0] + 1}, column '{shown(name)}': found {found}, a finite number is needed; {remedy}"
        )
    return numbers


def _has_flags(values: pd.Series) -> bool:
    if pd.api.types.is_bool_dtype(values):
        return True
    return values.dtype == object and any(isinstance(value, bool | np.bool_) for value in values)


def refuse_outside(values: Array, column: str, where: str, *, label: str = "") -> None:
    """Refuse impossible values, with row, value and bounds; gaps count as possible.

    Parameters
    ----------
    column : whose bounds hold; those of any number for one without a meaning.
    label : its name in the message; the column's name by default.
    """
    low, high = BOUNDS.get(column, (-LARGEST, LARGEST))
    bad = np.flatnonzero((values < low) | (values > high))
    if not bad.size:
        return
    row = int(bad[0])
    unit = f" {_UNITS[kind]}" if column in BOUNDS and (kind := column.rsplit("_", 1)[-1]) in _UNITS else ""
    needed = f"{low:g}{unit} or more" if values[row] < low and high >= LARGEST_TIME_S else f"{low:g} to {high:g}{unit}"
    raise DataRejected(
        f"{where}: row {row + 1}, column {shown(label or column)}: found {values[row]:g}, {needed} is needed; "
        "correct it, or its unit"
    )


def text(value: Any) -> str:
    """A name as text; a column of whole numbers with a gap somewhere comes as floats."""
    return str(int(value)) if isinstance(value, float) and value.is_integer() else str(value).strip()
