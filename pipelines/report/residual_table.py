"""Residuals of a lot with all quantities recorded with its dwells, as plain arrays for charts and other processes."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pandas as pd

from inertial import effects as catalogue
from inertial.arrays import Array, Index
from inertial.criticism.diagnosis import Diagnosis
from inertial.errors import InertialError
from inertial.estimation.model import Model
from inertial.estimation.problem import Problem
from inertial.estimation.refinement import terms_of
from inertial.quantities import shown_factor
from pipelines.report import residuals
from pipelines.report.residuals import FORCE_LABEL, LABELS, axes_of, direction, residuals_of_model
from pipelines.tables.dwells import Measured, lot_of, measured
from schemas.errors import DataRejected

LEAST_LOG10_P = -1e6 / np.log(10.0)


@dataclass(frozen=True)
class ResidualTable:
    """Residuals of units × axes × dwells, µg, NaN where a dwell is missing, and the quantities recorded with each dwell.

    force : (units, n, 3), g · turning : (units, n), 1 reached heating, −1 cooling, 0 neither
    drivers : label, and values (units, n) or (units, n, 3), by name · first : of the effect that is missing; empty for none
    """

    units: tuple[str, ...]
    dwells: Index
    axes: tuple[str, ...]
    residual: Array
    force: Array
    turning: Index
    drivers: dict[str, tuple[str, Array]] = field(default_factory=dict[str, tuple[str, Array]])
    first: str = ""

    def pick(self, unit: int, dwell: int) -> str:
        """The selection by a click on a point."""
        return f"{self.units[unit]}:{int(self.dwells[dwell])}"

    def index_of(self, unit: str) -> int:
        """Index of a unit; that of the unit with the largest residuals for a name that is not in the table."""
        if unit in self.units:
            return self.units.index(unit)
        return int(np.nanargmax(np.nanmean(self.residual**2, axis=(1, 2))))


def residual_table(measurement: Measured, diagnosis: Diagnosis, units: tuple[str, ...]) -> ResidualTable:
    """The residuals of the model that a diagnosis judged.

    Parameters
    ----------
    units : those without a data fault, in the order of the diagnosis
    """
    problem = diagnosis.base.problem
    state = problem.lot.state
    drivers = {quantity.name: (quantity.label, quantity.values) for quantity in residuals.recorded_quantities(problem)}  # noqa: PD011 - no table of pandas
    shape = (len(units), problem.n)
    drivers["force"] = (FORCE_LABEL, np.asarray(state.force, dtype=float))
    drivers.setdefault("time_s", (LABELS["time_s"], state.time * shown_factor("time_s")))
    drivers["dwell"] = ("number of the dwell", np.broadcast_to(measurement.dwells.astype(float), shape).copy())
    if state.slot is not None:
        slot = np.asarray(state.slot, dtype=float)
        drivers["slot"] = ("slot", np.broadcast_to(slot.reshape(len(units), -1)[:, :1], shape).copy())
    of_effect, named = residuals.quantities_of_added(diagnosis)
    drivers = {row.name: (row.label, row.values) for row in of_effect if row.name != "force"} | drivers  # noqa: PD011
    first = next((name for name in (*(row.name for row in of_effect), *named) if name in drivers), "")
    turning = np.zeros(shape, dtype=np.int64)
    if state.temperature is not None:
        turning = np.stack([direction(row) for row in state.temperature])
    return ResidualTable(
        units, measurement.dwells, axes_of(problem), residuals_of_model(diagnosis.base, len(units)),
        np.asarray(state.force, dtype=float), turning, drivers, first,
    )  # fmt: skip


def residuals_with(
    dwells: pd.DataFrame, history: pd.DataFrame | None, effects: Sequence[str], units: Sequence[str]
) -> Array:
    """The residuals of another model on the same dwells, µg, (units, axes, n).

    Raises
    ------
    DataRejected
        The dwells do not determine the model, or lack a quantity that it needs.
    """
    try:
        measurement = measured(dwells, history)
        measurement = measurement.pick([measurement.units.index(unit) for unit in units])
        problem = Problem(lot_of(measurement, square="misalignment" not in effects))
        model = Model(problem, terms_of(catalogue.get_all(list(effects)), problem))
        return residuals_of_model(model, len(measurement.units))
    except InertialError as problem_:
        raise DataRejected(str(problem_)) from None


def ladder_of(diagnosis: Diagnosis) -> list[dict[str, Any]]:
    """The candidates of the first step, best first.

    Rows have ``effect``, ``symbol``, ``coefficients``, ``chi2`` that it takes off, ``behind`` the best after the penalty for
    coefficients, and ``log10_p``.
    """
    ladder = diagnosis.result.ladder
    if not ladder:
        return []
    variance, best = diagnosis.final.space.variance, ladder[0].cost
    return [
        {
            "effect": rival.term.effect.id,
            "symbol": rival.term.effect.symbol,
            "coefficients": int(rival.rank),
            "chi2": float(rival.drop / variance),
            "behind": float(rival.cost - best),
            "log10_p": float(max(rival.log_p / np.log(10.0), LEAST_LOG10_P)),
        }
        for rival in ladder
    ]
