"""One archived lot under the model it was run with and under another: outcomes and errors of every unit, nothing is written."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import pandas as pd

from inertial.correction import correct
from inertial.design import carried_over
from inertial.errors import InertialError
from pipelines.archive import Archive, Run
from pipelines.archive.buffered_run import BufferedRun
from pipelines.chain.in_memory import evaluated
from pipelines.jobs.model_change import ModelChange
from pipelines.rerun.partition import Batch
from pipelines.rerun.selection import SelectedRun, entry_of
from pipelines.rerun.steps import archived_job
from pipelines.stages.grade import grade
from pipelines.tables.calibration import Calibration, read_calibration
from pipelines.tables.dwells import LotArrays, LotTables
from pipelines.tables.frames import ByUnit
from schemas.errors import DataRejected, TumblelineError
from schemas.units import MICRO

Sums = dict[str, tuple[float, int]]  # sum of squared errors, µg², and their number, by unit


OLD_TABLES = {
    **dict.fromkeys(("verdicts", "grades", "coefficients", "covariance", "noise"), ()),
    "residuals": ("unit", "residual_ug"),
    "verification": ("unit", "error_ug"),
}
"""Tables of a run that a comparison reads, with the columns; all where none is named."""


@dataclass(frozen=True)
class Side:
    """A lot under one model.

    outcome, reasons : by unit; fitted, verified : errors of the fit's dwells and of those not fitted
    """

    outcome: dict[str, str]
    reasons: dict[str, str]
    fitted: Sums
    verified: Sums
    calibration: Calibration | None


@dataclass(frozen=True)
class LotComparison:
    """A lot under the old and the new model.

    sides : under the old and the new model; none where the lot could not be judged
    """

    entry: SelectedRun
    sides: tuple[Side, ...] = ()
    error: str = ""


@dataclass(frozen=True)
class FreshTask:
    """A run whose dwells are fresh for calibrations of earlier runs: which units, under which old and new calibration."""

    archive: str
    run: str
    change: ModelChange
    earlier: tuple[tuple[tuple[str, ...], Calibration | None, Calibration | None], ...]


@dataclass(frozen=True)
class Fresh:
    """Errors on fresh dwells with the coefficients of an earlier run, unchanged, under either model."""

    run: str
    old: Sums = field(default_factory=dict[str, tuple[float, int]])
    new: Sums = field(default_factory=dict[str, tuple[float, int]])


def judged(part: Batch) -> list[LotComparison]:
    """Every run of a portion under both models; what cannot be judged says why."""
    archive, lots = Archive(part.archive), list[LotComparison]()
    part.change.use()
    for run in (BufferedRun(archive, run_id) for run_id in part.runs):
        entry = entry_of(run.id, run.about)
        try:
            lots.append(LotComparison(entry, _both(run, part.change)))
        except (TumblelineError, InertialError) as problem:
            lots.append(LotComparison(entry, error=str(problem)))
    return lots


def _both(run: Run, change: ModelChange) -> tuple[Side, Side]:
    if "grades" not in run.tables() or not run.about.get("capture"):
        raise DataRejected(f"run {run.id}: it has no grades to compare with; run it again with limits first")
    job = archived_job(run, change)
    old = {name: run.table(name, columns) for name, columns in OLD_TABLES.items()}
    lot = LotTables(run.table("dwells"), run.table("history"))
    # the noise is in µg already, and the response by which it was made so hardly depends on the model
    new, evidence = evaluated(job, lot, old["verdicts"], old["noise"])
    new |= grade(evidence, job.limits, job.recipe.zero_output, figures=False)
    fitted = len(old["coefficients"])  # no unit may have been
    return _side(old, read_calibration(old["coefficients"], old["covariance"]) if fitted else None), _side(
        new, evidence.calibration
    )


def _side(tables: Mapping[str, pd.DataFrame], calibration: Calibration | None) -> Side:
    units, *columns = (tables["grades"][name].tolist() for name in ("unit", "outcome", "reasons"))
    outcome, reasons = (dict(zip(units, column, strict=True)) for column in columns)
    fitted, verified = _sums(tables["residuals"], "residual_ug"), _sums(tables["verification"], "error_ug")
    return Side(outcome, reasons, fitted, verified, calibration)


def _sums(table: pd.DataFrame, column: str) -> Sums:
    rows = ByUnit(table)
    errors = ((unit, rows.of(unit)[column]) for unit in rows.units)
    return {unit: (float(np.sum(error**2)), len(error)) for unit, error in errors}


def fresh(tasks: Sequence[FreshTask]) -> list[Fresh]:
    """Errors on the fresh dwells of some runs."""
    found = [Fresh(task.run) for task in tasks]
    for task, errors in zip(tasks, found, strict=True):
        task.change.use()
        run = Run(Archive(task.archive), task.run)
        dwells, history = run.table("dwells"), run.table("history")
        for units, *calibrations in task.earlier:
            for calibration, sums in zip(calibrations, (errors.old, errors.new), strict=True):
                if calibration is not None:
                    sums.update(applied(calibration, units, dwells, history))
    return found


def applied(calibration: Calibration, units: Sequence[str], dwells: pd.DataFrame, history: pd.DataFrame) -> Sums:
    """Errors | |a| − g | of some units of a lot under coefficients that were found elsewhere, unchanged.

    The norm needs no angle, so a unit that sits in another slot of another station is judged by it, too.
    """
    chosen = dwells[dwells["unit"].isin(set(units) & set(calibration.units))]
    lots = (part.fitted_kinds for part in LotTables(chosen, history).parts)
    return {unit: sums for lot in lots for unit, sums in _applied(calibration, lot).items()}


def _applied(calibration: Calibration, lot: LotArrays) -> Sums:
    order = [calibration.units.index(unit) for unit in lot.units]
    state = replace(lot.state, memory={})
    force = correct(
        calibration.effects, state, lot.output, calibration.coefficients[order], carried_over(calibration.nonlinear)
    )
    error = MICRO * (np.linalg.norm(force, axis=-1) - np.linalg.norm(lot.state.force, axis=-1))
    return {unit: (float(np.sum(errors**2)), errors.size) for unit, errors in zip(lot.units, error, strict=True)}
