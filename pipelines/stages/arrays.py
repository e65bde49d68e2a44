"""Dwells as the arrays that the science works on: all units of a lot side by side."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from inertial.state import History, State
from schemas.errors import DataRejected
from schemas.units import AXES

if TYPE_CHECKING:
    from collections.abc import Collection

    import pandas as pd
    from numpy.typing import NDArray

HISTORY_POINTS = 4000
FEWEST_POINTS = 2


@dataclass(frozen=True)
class LotArrays:
    """Dwells of a lot.

    units : serials, in order; dwells : (n,) numbers; poses, kinds : (n,) names
    output, standard_error : (units, n, 3), output unit; the error is that of white noise, sd/√n
    """

    units: tuple[str, ...]
    dwells: NDArray[np.int64]
    poses: tuple[str, ...]
    kinds: NDArray[np.str_]
    state: State
    output: NDArray[np.float64]
    standard_error: NDArray[np.float64]
    out_unit: str

    def of_kind(self, kind: str) -> NDArray[np.bool_]:
        """Which dwells are of a kind, (n,)."""
        return np.asarray(self.kinds == kind)


def lot_arrays(
    dwells: pd.DataFrame, history: pd.DataFrame | None = None, kinds: Collection[str] | None = None
) -> LotArrays:
    """The dwells of a lot as arrays, for units that were all measured in the same dwells.

    Parameters
    ----------
    dwells : of all kinds, so that what an effect remembers of the dwell before is there
    history : temperatures between the dwells
    kinds : of the dwells that are wanted; all where None

    Raises
    ------
    DataRejected
        A unit lacks a dwell that others have, or units differ in the unit of their output.
    """
    rows = _Rows(dwells, kinds)
    units, numbers = rows.units, np.unique(rows.dwell)
    if not units or len(rows.dwell) != len(units) * len(numbers):
        message = (
            f"dwells: {len(rows.dwell)} rows for {len(units)} units and {len(numbers)} dwells, every unit needs every dwell; "
            "remove the units that lack some, or measure them again"
        )
        raise DataRejected(message)
    out_units = sorted(set(rows.texts("out_unit")))
    if len(out_units) != 1:
        message = f"dwells: outputs in {' and '.join(out_units)}, one lot has one unit; split the lot by device"
        raise DataRejected(message)
    return LotArrays(
        units=units,
        dwells=numbers,
        poses=tuple(rows.texts("pose", len(numbers))),
        kinds=np.asarray(rows.texts("kind", len(numbers)), dtype=np.str_),
        state=_state(rows, history),
        output=rows.by_axis("out"),
        standard_error=rows.by_axis("sd") / np.sqrt(rows.grid("n"))[..., None],
        out_unit=out_units[0],
    )


class _Rows:
    """The rows of a table of dwells in order of unit and dwell; every column is taken out of the table once.

    units : serials in order; dwell : (rows,), numbers
    """

    def __init__(self, dwells: pd.DataFrame, kinds: Collection[str] | None) -> None:
        self._table = dwells
        codes, names = dwells["unit"].factorize()
        rank = np.argsort(np.argsort(np.asarray(names, dtype=object)))
        place, dwell = rank[codes], dwells["dwell"].to_numpy()
        order = np.lexsort((dwell, place))
        if kinds is not None:
            order = order[dwells["kind"].isin(list(kinds)).to_numpy()[order]]
        self.dwell = dwell[order]
        self._order = None if np.array_equal(order, np.arange(len(dwells))) else order
        found = np.unique(place[order])
        by_rank = dict(zip(rank.tolist(), names, strict=True))
        self.units = tuple(str(by_rank[one]) for one in found.tolist())

    def grid(self, column: str) -> NDArray[np.float64]:
        """A column of numbers, (units, n)."""
        values = np.array(self._table[column], dtype=np.float64)  # a copy: sums over it must not depend on the table
        return (values if self._order is None else values[self._order]).reshape(len(self.units), -1)

    def by_axis(self, name: str) -> NDArray[np.float64]:
        """Three columns of numbers, (units, n, 3)."""
        return np.stack([self.grid(f"{name}_{axis}") for axis in AXES], axis=-1)

    def optional(self, column: str) -> NDArray[np.float64] | None:
        """A column of numbers, (units, n), where the table has it without gaps."""
        if column not in self._table.columns:
            return None
        values = self.grid(column)
        return None if np.isnan(values).any() else values

    def texts(self, column: str, count: int | None = None) -> list[str]:
        """A column of texts, of the first rows or of all."""
        values = self._table[column].to_numpy(dtype=object)
        return [str(one) for one in (values if self._order is None else values[self._order])[:count]]


def _state(rows: _Rows, history: pd.DataFrame | None) -> State:
    outer, inner, slot = (rows.optional(name) for name in ("outer_deg", "inner_deg", "slot"))
    return State(
        force=rows.by_axis("force"),
        time=rows.grid("time_s"),
        outer=None if outer is None else np.radians(outer),
        inner=None if inner is None else np.radians(inner),
        slot=None if slot is None else slot[:, 0],
        temperature=rows.optional("unit_C"),
        chamber=rows.optional("chamber_C"),
        since_power=rows.optional("since_power_s"),
        since_move=rows.optional("since_move_s"),
        supply=rows.optional("supply_V"),
        vibration=rows.optional("vibration_g"),
        history=None if history is None else _history(history, rows.units),
    )


def _history(history: pd.DataFrame, units: tuple[str, ...]) -> History | None:
    """Temperatures of every unit on one time grid; None where a unit has none."""
    time, temperature = (np.array(history[name], dtype=np.float64) for name in ("time_s", "unit_C"))
    codes, names = history["unit"].factorize()
    rank = {unit: place for place, unit in enumerate(units)}
    place = np.array([rank.get(str(name), -1) for name in names], dtype=np.int64)[codes]
    known = np.flatnonzero(~np.isnan(temperature))
    counts = np.bincount(place[known] + 1, minlength=len(units) + 1)[1:]
    if np.any(counts < FEWEST_POINTS):
        return None
    times = time[known]
    grid = np.linspace(times.min(), times.max(), min(HISTORY_POINTS, np.unique(times).size))
    order = known[np.lexsort((times, place[known]))][-int(counts.sum()) :]  # rows of no unit of the lot come first
    parts = np.split(order, np.cumsum(counts)[:-1])
    return History(grid, np.stack([np.interp(grid, time[own], temperature[own]) for own in parts]))
