"""Conversion of a table of dwells to arrays, used by all readers: one row for each unit, every column read once."""

from collections.abc import Collection
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from inertial import frames
from inertial.quantities import (
    ANGLE_COLUMNS,
    BY_ATTRIBUTE,
    FORCE_COLUMNS,
    OUTPUT_COLUMNS,
    RECORDED,
    SLOW_COLUMNS,
    SPREAD_COLUMNS,
    is_covariate,
)
from inertial.state import History, State

Array = NDArray[np.float64]

HISTORY_POINTS = 4000
FEWEST_POINTS = 2


def covariates(frame: pd.DataFrame) -> list[str]:
    """Names of the numeric columns without a fixed meaning: covariates that a missing effect may depend on."""
    kinds = zip(frame.columns, frame.dtypes, strict=True)
    numbers = (str(name) for name, kind in kinds if kind != np.bool_ and pd.api.types.is_numeric_dtype(kind))
    return [name for name in numbers if is_covariate(name)]


def output_axes(columns: Collection[str]) -> tuple[int, ...]:
    """The sensor axes whose output a table of dwells has, in order."""
    return tuple(axis for axis, name in enumerate(OUTPUT_COLUMNS) if name in columns)


class DwellTable:
    """Rows of a table of dwells in order of unit and number.

    units : serials in order; numbers : (n,), of all dwells; whole : whether every unit has every dwell

    Parameters
    ----------
    frame : in the exchange format
    kinds : of the selected dwells; None: all; all as well where the table has no kinds
    """

    def __init__(self, frame: pd.DataFrame, kinds: Collection[str] | None = None) -> None:
        codes, found_names = frame["unit"].factorize()
        names = [str(name) for name in found_names]
        rank = np.argsort(np.argsort(np.asarray(names, dtype=object), kind="stable"))
        unit_rank, dwell = rank[codes], frame["dwell"].to_numpy()
        order = np.lexsort((dwell, unit_rank))
        if kinds is not None and "kind" in frame.columns:
            order = order[frame["kind"].isin(list(kinds)).to_numpy()[order]]
        self.frame = frame
        self._order = None if np.array_equal(order, np.arange(len(frame))) else order
        ranks, unit = np.unique(unit_rank[order], return_inverse=True)
        by_rank = dict(zip(rank.tolist(), names, strict=True))
        self.units = tuple(str(by_rank[rank]) for rank in ranks.tolist())
        self.numbers, number = np.unique(dwell[order], return_inverse=True)
        self._rows = (unit, number)
        self.shape = (len(self.units), len(self.numbers))
        self.rows = len(order)
        self.whole = self.rows == self.shape[0] * self.shape[1]
        self._full_columns: dict[str, bool] = {}
        self.axes = output_axes(frame.columns)
        self.outputs = tuple(OUTPUT_COLUMNS[axis] for axis in self.axes)
        self.spreads = tuple(SPREAD_COLUMNS[axis] for axis in self.axes)
        self.slow = tuple(SLOW_COLUMNS[axis] for axis in self.axes)

    def common(self) -> list[int]:
        """Numbers of the dwells that every unit has."""
        return [int(number) for number in self.numbers[np.bincount(self._rows[1]) == self.shape[0]]]

    def has(self, *names: str) -> bool:
        """Whether the table has these columns, and a value in each of their rows."""
        return all(name in self.frame.columns and self._full(name) for name in names)

    def _full(self, name: str) -> bool:
        if name not in self._full_columns:
            self._full_columns[name] = not pd.isna(self._in_order(self.frame[name].to_numpy())).any()
        return self._full_columns[name]

    def _in_order(self, values: NDArray[Any]) -> NDArray[Any]:
        return values if self._order is None else values[self._order]

    def grid(self, name: str) -> Array:
        """A column of numbers, (units, n); NaN where a unit lacks a dwell."""
        # a copy: sums over it must not depend on the table
        values = self._in_order(np.array(self.frame[name], dtype=np.float64))
        if self.whole:
            return values.reshape(self.shape)
        out = np.full(self.shape, np.nan)
        out[self._rows] = values
        return out

    def filled(self, name: str) -> Array:
        """A column of numbers, (units, n); where a unit lacks a dwell, the median of the other units' values."""
        values = self.grid(name)
        if self.whole or not np.isnan(values).any():
            return values
        return np.where(np.isnan(values), np.nanmedian(values, axis=0, keepdims=True), values)

    def by_axis(self, names: Collection[str], *, filled: bool = False) -> Array:
        """Columns of numbers side by side, (units, n, columns)."""
        return np.stack([self.filled(name) if filled else self.grid(name) for name in names], axis=-1)

    def optional(self, name: str, *, filled: bool = False) -> Array | None:
        """A column of numbers, (units, n), where the table has it without gaps."""
        if not self.has(name):
            return None
        return self.filled(name) if filled else self.grid(name)

    def texts(self, name: str) -> list[str]:
        """A column of texts, one for each row."""
        return [str(text) for text in self._in_order(self.frame[name].to_numpy(dtype=object))]

    def per_dwell(self, name: str) -> tuple[str, ...]:
        """A text of every dwell, (n,): that of the first unit that has it; empty where the table has no such column."""
        if name not in self.frame.columns:
            return ("",) * self.shape[1]
        first = np.unique(self._rows[1], return_index=True)[1]
        texts = self.texts(name)
        return tuple(texts[row] for row in first.tolist())


def state_of_table(table: DwellTable, history: pd.DataFrame | None = None) -> tuple[str, State]:
    """The state for the effects, the same for every reader of dwells, preceded by the kind of knowledge of the force.

    ``force``: from its columns; ``angles``: computed from the angles of the table; ``norm``: only its norm is known, it is zero.
    A quantity with any missing value is omitted; for a dwell that a unit lacks it has the median of the other units.
    """
    known: dict[str, Any] = {}
    for row in RECORDED:
        if row.attribute and (values := table.optional(row.column, filled=True)) is not None:
            values = values if row.factor == 1.0 else row.factor * values
            known[row.attribute] = values[:, 0] if row.once else values
    if not table.has(*ANGLE_COLUMNS):
        known |= {"outer": None, "inner": None}
    if known.get("temperature") is None:
        known["temperature"] = known.get("chamber")
    known["power_off"] = _power_off(table)
    reference, force = _force(table, known)
    full = [name for name in covariates(table.frame) if table.has(name)]
    columns = {name: table.filled(name) for name in full}
    past = None
    if history is not None and known["temperature"] is not None:
        past = history_on_grid(history, table.units, known["time"])
    return reference, State(force=force, **known, covariates=columns, history=past, axes=table.axes)


def _force(table: DwellTable, known: dict[str, Any]) -> tuple[str, Array]:
    if table.has(*FORCE_COLUMNS):
        return "force", frames.without_rounding(table.by_axis(FORCE_COLUMNS, filled=True))
    if known["outer"] is not None:
        return "angles", frames.force_from_angles(known["outer"], known["inner"])
    return "norm", np.zeros((*table.shape, 3))


def _power_off(table: DwellTable) -> Array | None:
    """Seconds without power before each dwell; None where no run switched its devices, or where the time of power-on is unknown.

    Runs without switching have no such column; together with a run with switching, their devices stayed on.
    """
    off, since = BY_ATTRIBUTE["power_off"].column, BY_ATTRIBUTE["since_power"].column
    if off not in table.frame.columns or not table.has(since):
        return None
    known = np.nan_to_num(table.grid(off), nan=0.0)
    return np.broadcast_to(known.max(axis=0), known.shape).copy()  # one relay for all


def history_on_grid(history: pd.DataFrame, units: tuple[str, ...], time: Array) -> History | None:
    """Temperatures of every unit on one time grid; None where a unit has none, or the history does not cover the dwells.

    Parameters
    ----------
    history : ``time_s`` and ``unit_C``, or ``chamber_C`` without it; a history without units applies to all of them
    time : (units, n), s, of the dwells
    """
    column = "unit_C" if "unit_C" in history.columns else "chamber_C"
    times, values = (np.array(history[name], dtype=np.float64) for name in ("time_s", column))
    known = np.flatnonzero(~np.isnan(values))
    if "unit" not in history.columns:
        parts = [known[np.argsort(times[known], kind="stable")]] * len(units)
    else:
        codes, names = history["unit"].factorize()
        rank = {unit: index for index, unit in enumerate(units)}
        unit_index = np.array([rank.get(str(name), -1) for name in names], dtype=np.int64)[codes]
        known = known[unit_index[known] >= 0]
        counts = np.bincount(unit_index[known], minlength=len(units))
        parts = np.split(known[np.lexsort((times[known], unit_index[known]))], np.cumsum(counts)[:-1])
    if any(len(rows) < FEWEST_POINTS for rows in parts):
        return None
    every = times[known]
    if every.min() > np.max(time) or every.max() < np.min(time):
        return None
    grid = np.linspace(every.min(), every.max(), max(FEWEST_POINTS, min(HISTORY_POINTS, np.unique(every).size)))
    return History(grid, np.stack([_at(grid, times[rows], values[rows]) for rows in parts]))


def _at(grid: Array, time: Array, values: Array) -> Array:
    """Values on a grid; the mean of several values at one time."""
    if np.any(time[1:] == time[:-1]):
        time, which, count = np.unique(time, return_inverse=True, return_counts=True)
        values = np.bincount(which, weights=values) / count
    return np.interp(grid, time, values)
