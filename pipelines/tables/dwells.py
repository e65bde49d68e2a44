"""A table of dwells as the arrays that criticism works on; units may lack dwells, and the reference may be angles or nothing."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from inertial import frames
from inertial.criticism.problem import Lot
from inertial.criticism.readings import Readings
from inertial.state import History, State
from schemas.dwell_columns import covariates
from schemas.errors import DataRejected
from schemas.units import AXES

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]
    from collections.abc import Collection

    import pandas as pd

OUT = ("out_x", "out_y", "out_z")
SPREAD = ("sd_x", "sd_y", "sd_z")
FORCE = ("force_x", "force_y", "force_z")
_HISTORY_POINTS = 4000


@dataclass(frozen=True)
class Measured:
    """Dwells of a lot, (units, n): readings as they came, and all that effects may look at.

    dwells : (n,), numbers of the dwells
    reference : "force", "angles" or "norm"
    """

    units: tuple[str, ...]
    dwells: NDArray[np.int64]
    readings: Readings
    state: State
    reference: str

    def pick(self, units: list[int]) -> Measured:
        """The same for some units."""
        index = np.asarray(units, dtype=np.intp)
        picked: dict[str, Any] = {}
        for name in Readings.__dataclass_fields__:
            value = getattr(self.readings, name)
            picked[name] = value[index] if isinstance(value, np.ndarray) else value
        names = tuple(self.units[i] for i in units)
        return Measured(names, self.dwells, Readings(**picked), self.state.pick(index), self.reference)


def measured(dwells: pd.DataFrame, history: pd.DataFrame | None = None) -> Measured:
    """The arrays of a table of dwells in the exchange format.

    Raises
    ------
    DataRejected
        There are no rows, or too few dwells to judge anything.
    """
    if dwells.empty:
        raise DataRejected("dwells: no rows; at least one unit with its dwells is needed")
    if "kind" in dwells.columns:
        dwells = dwells[dwells["kind"].isin(["dwell", "verification"])]
    ordered = dwells.sort_values(["unit", "dwell"], kind="stable")
    units = tuple(dict.fromkeys(ordered["unit"].astype(str)))
    numbers = np.unique(ordered["dwell"].to_numpy())
    place = {u: i for i, u in enumerate(units)}
    rows = (
        np.array([place[u] for u in ordered["unit"].astype(str)], dtype=np.intp),
        np.searchsorted(numbers, ordered["dwell"].to_numpy()),
    )
    table = _Table(ordered, rows, (len(units), len(numbers)))
    reference, force = _force(table)
    readings = Readings(
        force=force,
        output=table.raw(OUT),
        time=table.raw(("time_s",))[..., 0],
        spread=table.raw(SPREAD) if table.has(*SPREAD) else None,
        count=table.one("n", filled=False),
        duration=table.one("duration_s", filled=False),
        temperature=table.one("unit_C", filled=False),
        chamber=table.one("chamber_C", filled=False),
        vibration=table.one("vibration_g", filled=False),
        unit_name=_stated_unit(dwells),
        history_end=None if history is None or history.empty else float(history["time_s"].max()),
    )
    return Measured(units, numbers, readings, _state(table, force, units, history), reference)


class _Table:
    """Columns of a long table as (units, n, k) arrays; a missing dwell takes the other units' middle value where asked."""

    def __init__(
        self, frame: pd.DataFrame, rows: tuple[NDArray[np.intp], NDArray[np.intp]], shape: tuple[int, int]
    ) -> None:
        self.frame, self.rows, self.shape = frame, rows, shape

    def has(self, *names: str) -> bool:
        return all(n in self.frame.columns and self.frame[n].notna().all() for n in names)

    def raw(self, names: tuple[str, ...]) -> Array:
        out = np.full((*self.shape, len(names)), np.nan)
        out[self.rows] = self.frame[list(names)].to_numpy(dtype=float)
        return out

    def one(self, name: str, *, filled: bool = True) -> Array | None:
        if not self.has(name):
            return None
        values = self.raw((name,))
        return (_filled(values) if filled else values)[..., 0]


def _filled(values: Array) -> Array:
    if not np.isnan(values).any():
        return values
    middle = np.nanmedian(values, axis=0, keepdims=True)
    return np.where(np.isnan(values), middle, values)


def _stated_unit(dwells: pd.DataFrame) -> str | None:
    if "out_unit" not in dwells.columns:
        return None
    stated = dwells["out_unit"].dropna().astype(str).unique()
    return str(stated[0]) if len(stated) == 1 else None


def _force(table: _Table) -> tuple[str, Array]:
    if table.has(*FORCE):
        return "force", frames.without_rounding(_filled(table.raw(FORCE)))
    if table.has("outer_deg", "inner_deg"):
        angles = np.radians(_filled(table.raw(("outer_deg", "inner_deg"))))
        return "angles", frames.force_from_angles(angles[..., 0], angles[..., 1])
    return "norm", np.zeros((*table.shape, 3))


def _state(table: _Table, force: Array, units: tuple[str, ...], history: pd.DataFrame | None) -> State:
    angles = table.has("outer_deg", "inner_deg")
    time = _filled(table.raw(("time_s",)))[..., 0]
    temperature = table.one("unit_C")
    if temperature is None:
        temperature = table.one("chamber_C")
    outer, inner = (table.one(n) if angles else None for n in ("outer_deg", "inner_deg"))
    slot = table.one("slot")
    return State(
        force=force,
        time=time,
        temperature=temperature,
        chamber=table.one("chamber_C"),
        since_power=table.one("since_power_s"),
        since_move=table.one("since_move_s"),
        power_off=_power_off(table),
        supply=table.one("supply_V"),
        vibration=table.one("vibration_g"),
        outer=None if outer is None else np.radians(outer),
        inner=None if inner is None else np.radians(inner),
        slot=None if slot is None else slot[:, 0],
        covariates={n: v for n in covariates(table.frame) if (v := table.one(n)) is not None and np.ptp(v) > 0.0},
        history=_history(history, units, time) if history is not None and temperature is not None else None,
    )


def _power_off(table: _Table) -> Array | None:
    """Seconds without power before each dwell; None where no run switched its devices, or since when they have it is not known.

    Runs that did not switch have no such column: beside one that did, their devices stayed on.
    """
    if "power_off_s" not in table.frame.columns or not table.has("since_power_s"):
        return None
    known = np.nan_to_num(table.raw(("power_off_s",))[..., 0], nan=0.0)
    return np.broadcast_to(known.max(axis=0), known.shape).copy()  # one relay for all


def _history(history: pd.DataFrame, units: tuple[str, ...], time: Array) -> History | None:
    """Temperatures of every unit on one time grid; a history without units serves all of them."""
    column = "unit_C" if "unit_C" in history.columns else "chamber_C"
    low, high = float(history["time_s"].min()), float(history["time_s"].max())
    if low > float(np.max(time)) or high < float(np.min(time)):
        return None
    count = min(_HISTORY_POINTS, max(2, history["time_s"].nunique()))
    grid = np.linspace(low, high, count)
    series: list[Array] = []
    for unit in units:
        own = history[history["unit"].astype(str) == unit] if "unit" in history.columns else history
        if own.empty:
            return None
        own = own.groupby("time_s", as_index=False)[column].mean()
        series.append(np.interp(grid, own["time_s"].to_numpy(dtype=float), own[column].to_numpy(dtype=float)))
    return History(grid, np.stack(series))


def lot_of(found: Measured, like: Measured | None = None, *, square: bool = False) -> Lot:
    """The lot in g: outputs over a nominal scale, white standard errors, normalised response.

    Where only the norm of gravity is known, a nine-parameter fit gives the directions, and the lot is radial.

    Parameters
    ----------
    square : whether the model takes the axes as square, so that six parameters, not nine, give the directions
    like : the run whose nominal scale and response are used: coefficients of one run apply to another only so
    """
    readings = found.readings
    if found.reference == "norm":
        return _radial(found, like or found, square=square)
    coefficients = (like or found).readings.fits
    scale = np.abs(np.diagonal(coefficients[:, :, 1:], axis1=1, axis2=2))
    scale = np.where(scale > 0.0, scale, 1.0)
    response = coefficients[:, :, 1:] / scale[:, :, None]
    output = readings.output / scale[:, None, :]
    there = readings.there
    error = np.where(there[..., None], _white_error(readings, scale, output), np.inf)
    felt = np.einsum("uij,unj->uni", response, found.state.force)
    state = replace(found.state, felt=felt, memory={})
    return Lot(state, np.where(there[..., None], output, 0.0), error, response)


def _white_error(readings: Readings, scale: Array, output: Array) -> Array:
    """White standard errors (units, n, 3) in g: sd/√n where recorded, else from the scatter about a plain fit."""
    if readings.spread is not None and readings.count is not None:
        error = readings.spread / np.sqrt(np.maximum(readings.count, 1.0)[..., None]) / scale[:, None, :]
        typical = np.nanmedian(np.where(error > 0.0, error, np.nan), axis=1, keepdims=True)
        typical = np.where(np.isfinite(typical), typical, np.nanmax(typical) if np.isfinite(typical).any() else 1e-6)
        return np.where(np.isfinite(error) & (error > 0.2 * typical), error, typical)
    del output
    spread = np.sqrt(np.nanmean(readings.misfit**2, axis=1, keepdims=True))
    pooled = np.sqrt(np.mean(spread**2, axis=0, keepdims=True))
    return np.broadcast_to(np.maximum(pooled, 1e-12), readings.output.shape)


def _radial(found: Measured, like: Measured, *, square: bool) -> Lot:
    from inertial.fits.ellipsoid import fit_ellipsoid

    readings = found.readings
    forces, outputs, errors = [], [], []
    for unit in range(len(found.units)):
        there = readings.there[unit]
        shape = "six" if square else "nine"
        fit = fit_ellipsoid(like.readings.output[unit, like.readings.there[unit]], shape=shape)
        corrected = np.zeros((there.size, 3))
        corrected[there] = fit.apply(readings.output[unit, there])
        size = np.linalg.norm(corrected, axis=1, keepdims=True)
        forces.append(np.where(size > 0.0, corrected / np.where(size > 0.0, size, 1.0), (0.0, 0.0, 1.0)))
        outputs.append(corrected)
        errors.append(np.where(there, np.sqrt(np.mean((size[there] - 1.0) ** 2)), np.inf)[:, None] * np.ones(3))
    state = replace(found.state, force=np.stack(forces), memory={})
    eye = np.broadcast_to(np.eye(3), (len(found.units), 3, 3))
    return Lot(state, np.stack(outputs), np.stack(errors), eye, radial=True)


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
        raise DataRejected(
            f"dwells: {len(rows.dwell)} rows for {len(units)} units and {len(numbers)} dwells, every unit needs every dwell; "
            "remove the units that lack some, or measure them again"
        )
    out_units = sorted(set(rows.texts("out_unit")))
    if len(out_units) != 1:
        raise DataRejected(
            f"dwells: outputs in {' and '.join(out_units)}, one lot has one unit; split the lot by device"
        )
    return LotArrays(
        units=units,
        dwells=numbers,
        poses=tuple(rows.texts("pose", len(numbers))),
        kinds=np.asarray(rows.texts("kind", len(numbers)), dtype=np.str_),
        state=_lot_state(rows, history),
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


def _lot_state(rows: _Rows, history: pd.DataFrame | None) -> State:
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
        history=None if history is None else _lot_history(history, rows.units),
    )


def _lot_history(history: pd.DataFrame, units: tuple[str, ...]) -> History | None:
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
