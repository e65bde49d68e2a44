"""Dwells as the arrays that the science works on: all units of a lot side by side."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from inertial.state import History, State
from schemas.errors import DataRejected

if TYPE_CHECKING:
    import pandas as pd
    from numpy.typing import NDArray

AXES = ("x", "y", "z")
HISTORY_POINTS = 4000


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


def lot_arrays(dwells: pd.DataFrame, history: pd.DataFrame | None = None) -> LotArrays:
    """The dwells of a lot as arrays, for units that were all measured in the same dwells.

    Parameters
    ----------
    dwells : of all kinds, so that what an effect remembers of the dwell before is there
    history : temperatures between the dwells

    Raises
    ------
    DataRejected
        A unit lacks a dwell that others have, or units differ in the unit of their output.
    """
    ordered = dwells.sort_values(["unit", "dwell"])
    units = tuple(str(unit) for unit in ordered["unit"].unique())
    numbers = np.unique(ordered["dwell"].to_numpy())
    if not units or len(ordered) != len(units) * len(numbers):
        message = (
            f"dwells: {len(ordered)} rows for {len(units)} units and {len(numbers)} dwells, every unit needs every dwell; "
            "remove the units that lack some, or measure them again"
        )
        raise DataRejected(message)
    out_units = sorted(ordered["out_unit"].unique())
    if len(out_units) != 1:
        message = f"dwells: outputs in {' and '.join(out_units)}, one lot has one unit; split the lot by device"
        raise DataRejected(message)
    first = ordered.iloc[: len(numbers)]
    return LotArrays(
        units=units,
        dwells=numbers,
        poses=tuple(first["pose"].astype(str)),
        kinds=first["kind"].to_numpy(dtype=np.str_),
        state=_state(ordered, units, history),
        output=_grid(ordered, [f"out_{axis}" for axis in AXES], len(units)),
        standard_error=_standard_error(ordered, len(units)),
        out_unit=out_units[0],
    )


def _grid(ordered: pd.DataFrame, columns: list[str], units: int) -> NDArray[np.float64]:
    return ordered[columns].to_numpy(dtype=float).reshape(units, -1, len(columns))


def _standard_error(ordered: pd.DataFrame, units: int) -> NDArray[np.float64]:
    spread = _grid(ordered, [f"sd_{axis}" for axis in AXES], units)
    return spread / np.sqrt(_grid(ordered, ["n"], units))


def _state(ordered: pd.DataFrame, units: tuple[str, ...], history: pd.DataFrame | None) -> State:
    def optional(column: str) -> NDArray[np.float64] | None:
        if column not in ordered.columns:
            return None
        values = ordered[column].to_numpy(dtype=float).reshape(len(units), -1)
        return None if np.isnan(values).any() else values

    outer, inner = optional("outer_deg"), optional("inner_deg")
    slot = optional("slot")
    return State(
        force=_grid(ordered, [f"force_{axis}" for axis in AXES], len(units)),
        time=_grid(ordered, ["time_s"], len(units))[..., 0],
        outer=None if outer is None else np.radians(outer),
        inner=None if inner is None else np.radians(inner),
        slot=None if slot is None else slot[:, 0],
        temperature=optional("unit_C"),
        chamber=optional("chamber_C"),
        since_power=optional("since_power_s"),
        since_move=optional("since_move_s"),
        supply=optional("supply_V"),
        vibration=optional("vibration_g"),
        history=None if history is None else _history(history, units),
    )


def _history(history: pd.DataFrame, units: tuple[str, ...]) -> History | None:
    """Temperatures of every unit on one time grid; None where a unit has none."""
    own = history[history["unit_C"].notna()]
    by_unit = {str(unit): rows for unit, rows in own.groupby("unit") if len(rows) > 1}
    if not set(units) <= set(by_unit):
        return None
    times = own["time_s"].to_numpy(dtype=float)
    grid = np.linspace(times.min(), times.max(), min(HISTORY_POINTS, np.unique(times).size))
    series = [
        np.interp(grid, rows["time_s"].to_numpy(dtype=float), rows["unit_C"].to_numpy(dtype=float))
        for rows in (by_unit[unit].sort_values("time_s") for unit in units)
    ]
    return History(grid, np.stack(series))
