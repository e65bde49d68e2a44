"""Dwells as the arrays that the science works on: all units of a lot side by side."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from inertial.state import State
from schemas.errors import DataRejected

if TYPE_CHECKING:
    import pandas as pd
    from numpy.typing import NDArray

AXES = ("x", "y", "z")


@dataclass(frozen=True)
class LotArrays:
    """Dwells of a lot.

    units : serials, in order; dwells : (n,) numbers; poses : (n,) names
    output, standard_error : (units, n, 3), output unit; the error is that of white noise, sd/√n
    """

    units: tuple[str, ...]
    dwells: NDArray[np.int64]
    poses: tuple[str, ...]
    state: State
    output: NDArray[np.float64]
    standard_error: NDArray[np.float64]
    out_unit: str


def lot_arrays(dwells: pd.DataFrame) -> LotArrays:
    """The dwells of a lot as arrays, for units that were all measured in the same dwells.

    Raises
    ------
    DataRejected
        A unit lacks a dwell that others have, or units differ in the unit of their output.
    """
    ordered = dwells.sort_values(["unit", "dwell"])
    units = tuple(dict.fromkeys(ordered["unit"].astype(str)))
    numbers = np.unique(ordered["dwell"].to_numpy())
    if not units or len(ordered) != len(units) * len(numbers):
        message = (
            f"dwells: {len(ordered)} rows for {len(units)} units and {len(numbers)} dwells, every unit needs every dwell; "
            "remove the units that lack some, or measure them again"
        )
        raise DataRejected(message)
    out_units = sorted(set(ordered["out_unit"]))
    if len(out_units) != 1:
        message = f"dwells: outputs in {' and '.join(out_units)}, one lot has one unit; split the lot by device"
        raise DataRejected(message)
    first = ordered.iloc[: len(numbers)]
    return LotArrays(
        units=units,
        dwells=numbers,
        poses=tuple(first["pose"].astype(str)),
        state=_state(ordered, len(units)),
        output=_grid(ordered, [f"out_{axis}" for axis in AXES], len(units)),
        standard_error=_standard_error(ordered, len(units)),
        out_unit=out_units[0],
    )


def _grid(ordered: pd.DataFrame, columns: list[str], units: int) -> NDArray[np.float64]:
    return ordered[columns].to_numpy(dtype=float).reshape(units, -1, len(columns))


def _standard_error(ordered: pd.DataFrame, units: int) -> NDArray[np.float64]:
    spread = _grid(ordered, [f"sd_{axis}" for axis in AXES], units)
    return spread / np.sqrt(_grid(ordered, ["n"], units))


def _state(ordered: pd.DataFrame, units: int) -> State:
    def optional(column: str) -> NDArray[np.float64] | None:
        if column not in ordered.columns or ordered[column].isna().any():
            return None
        return _grid(ordered, [column], units)[..., 0]

    outer, inner = optional("outer_deg"), optional("inner_deg")
    slot = optional("slot")
    return State(
        force=_grid(ordered, [f"force_{axis}" for axis in AXES], units),
        time=_grid(ordered, ["time_s"], units)[..., 0],
        outer=None if outer is None else np.radians(outer),
        inner=None if inner is None else np.radians(inner),
        slot=None if slot is None else slot[:, 0],
        temperature=optional("unit_C"),
        chamber=optional("chamber_C"),
        since_power=optional("since_power_s"),
        since_move=optional("since_move_s"),
        supply=optional("supply_V"),
        vibration=optional("vibration_g"),
    )
