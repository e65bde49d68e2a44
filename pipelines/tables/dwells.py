"""Dwells as the arrays that the science works on: the one reader for fit, verification, diagnosis, comparison and rerun.

:func:`measured` takes dwells as they are: units may lack some, and the reference may be angles or nothing. :func:`lot_arrays`
needs every dwell of every unit and a reference force, as a fit in the output's own unit does: a lot that lacks some is
fitted in :attr:`LotTables.parts`, or, for values that all units share, as :attr:`LotTables.with_gaps`. All have the same state.
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from inertial.data_errors.readings import Readings, design, robust_fits
from inertial.effects.base import others
from inertial.estimation.problem import Lot
from inertial.fits.linear import force_along_axes, of_every_axis, own_terms
from inertial.frames import shown_force, unseen_directions
from inertial.state import State
from pipelines.tables.dwell_table import DwellTable, output_axes, state_of_table
from pipelines.tables.norms import lot_of_norms
from schemas.errors import DataRejected
from schemas.units import AXES

Array = NDArray[np.float64]

KINDS = ("dwell", "verification")
_SHOWN = 5  # dwells that a message names
_LEAST_G = 1e-9  # scatter of dwells that are alike to the last digit
UNTOLD = 0.001
"""Share of the scatter about a plain fit that stands for the noise of the samples where none is recorded. It must be below the
noise also where the plain fit leaves the model's own curves; then its size does not matter. All noise is estimated
from the residuals; scatter beyond it counts as wander, which does not average out, unless the dwells refute that."""


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

    def pick(self, units: list[int]) -> "Measured":
        """The dwells of the units with these indices."""
        index = np.asarray(units, dtype=np.intp)
        values = {field.name: getattr(self.readings, field.name) for field in fields(self.readings)}
        arrays = {name: value[index] for name, value in values.items() if isinstance(value, np.ndarray)}
        names = tuple(self.units[i] for i in units)
        return replace(self, units=names, readings=replace(self.readings, **arrays), state=self.state.pick(index))


@dataclass(frozen=True)
class LotArrays:
    """Dwells of a lot, measured at the same times by all units.

    units : serials, in order; dwells : (n,) numbers; poses, kinds : (n,) names
    output, standard_error : (units, n, 3), output unit; the error is that of white noise, sd/√n; where no samples tell it,
        :data:`UNTOLD` of the scatter of the dwells: less than the noise, so that the residuals decide
    """

    units: tuple[str, ...]
    dwells: NDArray[np.int64]
    poses: tuple[str, ...]
    kinds: NDArray[np.str_]
    state: State
    output: NDArray[np.float64]
    standard_error: NDArray[np.float64]
    out_unit: str
    missing: NDArray[np.bool_] | None = None
    """(units, n), dwells that a unit lacks: all that stands there is a median of the other units; None where all have all."""

    @property
    def letters(self) -> tuple[str, ...]:
        """Letters of the axes with an output, in order."""
        return tuple(AXES[axis] for axis in self.state.axes)

    def of_kind(self, kind: str) -> NDArray[np.bool_]:
        """Which dwells are of a kind, (n,)."""
        return np.asarray(self.kinds == kind)


@dataclass(frozen=True)
class LotTables:
    """The tables of a lot's dwells, converted once for fit, verification and budget.

    history : temperatures between the dwells
    """

    dwells: pd.DataFrame
    history: pd.DataFrame | None

    @cached_property
    def parts(self) -> "tuple[LotTables, ...]":
        """The lot in parts whose units have the same dwells: the whole lot where no unit lacks a dwell that another has."""
        sets = dwells_of_units(self.dwells)
        if len(set(sets.values())) <= 1:
            return (self,)
        alike: dict[frozenset[int], list[str]] = {}
        for unit, numbers in sets.items():
            alike.setdefault(numbers, []).append(unit)
        units = self.dwells["unit"].astype(str)
        return tuple(LotTables(self.dwells[units.isin(names)], self.history) for names in alike.values())

    @cached_property
    def fitted_kinds(self) -> LotArrays:
        """The dwells of :data:`KINDS`."""
        return lot_arrays(self.dwells, self.history, KINDS)

    @cached_property
    def with_gaps(self) -> LotArrays:
        """The dwells of the fit of all units together, with gaps where a unit lacks a dwell that another has."""
        return lot_arrays(self.dwells, self.history, KINDS, gaps=True)

    @cached_property
    def all_kinds(self) -> LotArrays:
        """The dwells of every kind, since an effect with memory depends on the dwell before."""
        if self.dwells["kind"].isin(list(KINDS)).all():
            return self.fitted_kinds
        return lot_arrays(self.dwells, self.history)


def dwells_of_units(dwells: pd.DataFrame) -> dict[str, frozenset[int]]:
    """The numbers of the dwells of every unit."""
    return {str(unit): frozenset(numbers.tolist()) for unit, numbers in dwells.groupby("unit", sort=False)["dwell"]}


def lacking(dwells: pd.DataFrame) -> str:
    """A sentence on the dwells that units lack and others have; empty where there are none."""
    sets = dwells_of_units(dwells)
    every = frozenset[int]().union(*sets.values())
    named = {unit: sorted(every - numbers) for unit, numbers in sets.items() if numbers != every}
    told = (
        f"{unit} lacks {', '.join(map(str, missing[:_SHOWN]))}{' …' if len(missing) > _SHOWN else ''}"
        for unit, missing in named.items()
    )
    return f"dwells that others have: {'; '.join(told)}; units are fitted on the dwells that they have" if named else ""


def measured(dwells: pd.DataFrame, history: pd.DataFrame | None = None) -> Measured:
    """The arrays of a table of dwells in the exchange format.

    Raises
    ------
    DataRejected
        There are no rows, or too few dwells to judge anything.
    """
    if dwells.empty:
        raise DataRejected("dwells: no rows; at least one unit with its dwells is needed")
    table = DwellTable(dwells, KINDS)
    reference, state = state_of_table(table, history)
    readings = Readings(
        force=state.force,
        output=table.by_axis(table.outputs),
        axes=table.axes,
        time=table.grid("time_s"),
        spread=table.by_axis(table.spreads) if table.has(*table.spreads) else None,
        slow=table.by_axis(table.slow) if table.has(*table.slow) else None,
        count=table.optional("n"),
        duration=table.optional("duration_s"),
        temperature=table.optional("unit_C"),
        chamber=table.optional("chamber_C"),
        vibration=table.optional("vibration_g"),
        unit_name=_stated_unit(dwells),
        history_end=None if history is None or history.empty else float(history["time_s"].max()),
    )
    return Measured(table.units, table.numbers, readings, state, reference)


def lot_arrays(
    dwells: pd.DataFrame,
    history: pd.DataFrame | None = None,
    kinds: Collection[str] | None = None,
    *,
    gaps: bool = False,
) -> LotArrays:
    """The dwells of a lot as arrays, for units that were all measured in the same dwells.

    Parameters
    ----------
    dwells : of all kinds, so that what an effect remembers of the dwell before is there
    history : temperatures between the dwells
    kinds : of the dwells that are wanted; all where None
    gaps : whether units may lack dwells that others have

    Raises
    ------
    DataRejected
        A unit lacks a dwell that others have and may not, units differ in the unit of their output, or there is no reference.
    """
    table = DwellTable(dwells, kinds)
    if not table.units or not (table.whole or gaps):
        raise DataRejected(
            f"dwells: {table.rows} rows for {table.shape[0]} units and {table.shape[1]} dwells, every unit needs every dwell"
            f"{_lacking(table)}; fit without these dwells (of an import with --leave-out), remove the units, or measure again"
        )
    out_units = sorted(set(table.texts("out_unit")))
    if len(out_units) != 1:
        raise DataRejected(
            f"dwells: outputs in {' and '.join(out_units)}, one lot has one unit; split the lot by device"
        )
    reference, state = state_of_table(table, history)
    if reference == "norm":
        raise DataRejected(
            "dwells: no force_x, force_y, force_z and no angles, a reference is needed; add one of the two, or use a diagnosis, "
            "which needs the norm of gravity only"
        )
    return LotArrays(
        units=table.units,
        dwells=table.numbers,
        poses=table.per_dwell("pose"),
        kinds=np.asarray(table.per_dwell("kind"), dtype=np.str_),
        state=state,
        output=table.by_axis(table.outputs, filled=True),
        standard_error=table.by_axis(table.spreads, filled=True) / np.sqrt(table.filled("n"))[..., None]
        if {*table.spreads, "n"} <= set(dwells.columns)
        else _untold_error(dwells, table.shape),
        out_unit=out_units[0],
        missing=None if table.whole else np.asarray(np.isnan(table.by_axis(table.outputs)).any(axis=-1)),
    )


def _lacking(table: DwellTable) -> str:
    """Which dwells some unit lacks, for a message."""
    missing = sorted({int(number) for number in table.numbers} - set(table.common()))
    more = " …" if len(missing) > _SHOWN else ""
    return f" (not all have dwell {', '.join(map(str, missing[:_SHOWN]))}{more})" if missing else ""


def _untold_error(dwells: pd.DataFrame, shape: tuple[int, int]) -> Array:
    """:data:`UNTOLD` of the scatter of all dwells about a robust plain fit, (units, n, axes), output unit."""
    readings = measured(dwells).readings
    scatter = float(np.sqrt(np.nanmean(readings.misfit_when_warm**2)))
    error = UNTOLD * max(scatter, _LEAST_G) * readings.scale
    return np.broadcast_to(error[:, None, None], (*shape, len(readings.axes)))


def _stated_unit(dwells: pd.DataFrame) -> str | None:
    stated = dwells["out_unit"].dropna().astype(str).unique() if "out_unit" in dwells.columns else ()
    return str(stated[0]) if len(stated) == 1 else None


def lot_of(measurement: Measured, like: Measured | None = None, *, square: bool = False) -> Lot:
    """The lot in g: outputs over a nominal scale, white standard errors, normalised response.

    Where only the norm of gravity is known, a nine-parameter fit gives the directions, and the lot is radial.

    Parameters
    ----------
    square : whether the model takes the axes as square, so that six parameters, not nine, give the directions
    like : the run whose nominal scale and response are used: coefficients of one run apply to another only so

    Raises
    ------
    DataRejected
        Only the norm of gravity is known, of a device with fewer than three axes.
    """
    readings = measurement.readings
    if measurement.reference == "norm":
        _refuse_few_axes(readings.axes)
        return lot_of_norms(readings, measurement.state, (like or measurement).readings, square=square)
    coefficients = (like or measurement).readings.fits
    axes = readings.axes
    scale = np.abs(own_terms(coefficients[:, :, 1:], axes))
    scale = np.where(scale > 0.0, scale, 1.0)
    response = of_every_axis(coefficients[:, :, 1:] / scale[:, :, None], axes)
    output = readings.output / scale[:, None, :]
    there = readings.there
    error = np.where(there[..., None], _white_error(readings, scale, output), np.inf)
    felt, run = _felt_with_temperature(measurement, response, scale)
    state = replace(measurement.state, felt=felt, output_run=run, memory={})
    recorded = readings.spread is not None and readings.count is not None
    return Lot(state, np.where(there[..., None], output, 0.0), error, response, recorded=recorded, scale=scale)


def _refuse_few_axes(axes: Sequence[int]) -> None:
    """Refuse a device of one axis or two whose poses are unknown."""
    if len(axes) < 3:
        given = ", ".join("xyz"[axis] for axis in axes)
        raise DataRejected(
            f"dwells of axis {given} alone without an angle or a force: the magnitude of gravity is seen by three axes only, "
            "a reference is needed; import the file again with the column of its angle or force (--map tilt=… or force_x=…)"
        )


_WARM = 5.0
"""Range of temperature, K, from which on its linear terms are worth to be taken out of the force that a sensor answers to."""


def _felt_with_temperature(measurement: Measured, response: Array, scale: Array) -> tuple[Array, Array | None]:
    """The force along the sensors' own axes, and what bias and scale add to the output by their run with temperature.

    Both (units, n, 3), g. The axes are those at the reference temperature, by a fit that no wrong pose or bad dwell turns; no run
    where the temperature hardly changes.
    """
    state, readings = measurement.state, measurement.readings
    felt = force_along_axes(response, state.force)
    if state.theta is None or float(np.ptp(state.theta)) < _WARM or not readings.turned:
        return felt, None
    axes = readings.axes
    run = np.zeros((*readings.output.shape[:2], 3))
    force = np.broadcast_to(state.force, run.shape)
    shown, theta = shown_force(force, axes), np.broadcast_to(state.theta, run.shape[:2])
    rows = np.where(readings.there[..., None], design(shown, theta), 0.0)
    # elsewhere the poses of the soaks do not determine the axes and their gain's run
    needed = 2 + 2 * int(np.count_nonzero(np.any(shown != 0.0, axis=(0, 1))))  # bias, response, slopes over temperature
    told = np.flatnonzero(np.linalg.matrix_rank(rows) >= needed)
    coefficients = robust_fits(shown[told], readings.output[told], theta[told])
    for unit, of_unit in zip(told, coefficients, strict=True):
        felt[unit] = force_along_axes(of_every_axis(of_unit[:, 1:4], axes), force[unit])
        at_reference = own_terms(of_unit[:, 1:4], axes)
        gain = own_terms(of_unit[:, 5:], axes) / np.where(at_reference == 0.0, 1.0, at_reference)
        along = of_unit[:, 4] / scale[unit] + gain * felt[unit][:, axes]
        run[unit][:, axes] = theta[unit][:, None] * along
    return felt, run


def _white_error(readings: Readings, scale: Array, output: Array) -> Array:
    """White standard errors (units, n, 3) in g: sd/√n where recorded, else from the scatter about a plain fit."""
    if readings.spread is not None and readings.count is not None:
        error = readings.spread / np.sqrt(np.maximum(readings.count, 1.0)[..., None]) / scale[:, None, :]
        some = (error > 0.0).any(axis=1, keepdims=True)
        typical = np.nanmedian(np.where(error > 0.0, error, np.where(some, np.nan, 0.0)), axis=1, keepdims=True)
        typical = np.where(some, typical, typical.max() or 1e-6)
        return np.where(np.isfinite(error) & (error > 0.2 * typical), error, typical)
    spread = np.sqrt(np.nanmean(readings.misfit**2, axis=1, keepdims=True))
    pooled = np.sqrt(np.mean(spread**2, axis=0, keepdims=True))
    return np.broadcast_to(np.maximum(pooled, 1e-12), readings.output.shape)


def undetermined(state: State) -> list[str]:
    """Names of the responses across an axis that no pose shows, as Kxy; none for a device with three axes."""
    if len(state.axes) == len(AXES):
        return []
    unseen = unseen_directions(state.force)
    return [f"K{AXES[axis]}{AXES[k]}" for axis in state.axes for k in others(axis) if k in unseen]


def shows_misalignment(dwells: pd.DataFrame) -> bool:
    """Whether a pose shows the response across an axis; those of a device with three axes are asked to."""
    if len(output_axes(dwells.columns)) == len(AXES):
        return True
    state = state_of_table(DwellTable(dwells))[1]
    return len(undetermined(state)) < 2 * len(state.axes)


def undetermined_responses(state: State) -> list[str]:
    """Sentences on the responses that the poses do not determine, and on what to measure for them."""
    names = undetermined(state)
    if not names:
        return []
    text = f"cannot be determined from these poses: {', '.join(names)} (held at zero: the force across does not change in that "
    return [f"{text}direction); turn the device about its own axis by 90° and tilt it again"]
