"""Comparison of a model with measurements: the error on the run it is fitted to, on poses left out, and on a fresh run."""

from collections.abc import Sequence

import numpy as np
import pandas as pd
from threadpoolctl import threadpool_limits

from inertial import effects as catalogue
from inertial.arrays import Array
from inertial.criticism.diagnosis import diagnose
from inertial.criticism.left_out import left_out
from inertial.criticism.verdict import judged
from inertial.data_errors.faults import find_faults
from inertial.data_errors.removed_dwells import BadDwell
from inertial.effects import StationEffect
from inertial.errors import InertialError
from inertial.estimation.alternative import Handling
from inertial.estimation.comparison import Estimate, estimate, fitted_residuals, residuals_of, rms
from inertial.estimation.model import Model, refuse_without_freedom
from inertial.estimation.problem import Lot, Problem
from inertial.estimation.refinement import intervals, settled, terms_of
from inertial.estimation.term import Term
from inertial.planning.reasons import drivers_of
from pipelines.diagnosis.confirmation import progress
from pipelines.diagnosis.documents import ComparisonDocument, PoseComparison, StationParameter
from pipelines.diagnosis.result_rows import BAD_DWELL
from pipelines.tables.dwells import Measured, lot_of, measured
from pipelines.tables.sound_lot import generator
from schemas.errors import DataRejected
from schemas.units import AXES, MICRO


def compare(
    dwells: pd.DataFrame,
    effects: Sequence[str],
    history: pd.DataFrame | None = None,
    fresh: pd.DataFrame | None = None,
    fresh_history: pd.DataFrame | None = None,
    before: Sequence[str] | None = None,
) -> ComparisonDocument:
    """Errors of a model in a lot, and in a fresh run of the same units with the coefficients unchanged.

    Parameters
    ----------
    dwells, fresh : tables in the exchange format; the model is fitted to ``dwells`` only
    history, fresh_history : temperatures against time of the two runs
    before : effects of the model that this one extends; the added effects are then judged

    Raises
    ------
    DataRejected
        A unit of the fresh run was not in the first, or a quantity that the model needs is missing.
    """
    try:
        with threadpool_limits(1):
            return _compared(*both_measured(dwells, history, fresh, fresh_history), effects, before)
    except InertialError as problem:
        raise DataRejected(str(problem)) from None


def both_measured(
    dwells: pd.DataFrame, history: pd.DataFrame | None, fresh: pd.DataFrame | None, fresh_history: pd.DataFrame | None
) -> tuple[Measured, Measured | None]:
    """A run and the fresh run with its units in the same order; refused if they differ or the dwells are the same."""
    first = measured(dwells, history)
    return first, None if fresh is None else _same_units(first, measured(fresh, fresh_history))


def _compared(
    measurement: Measured, again: Measured | None, effects: Sequence[str], before: Sequence[str] | None
) -> ComparisonDocument:
    square = "misalignment" not in effects
    problem = Problem(lot_of(measurement, square=square))
    model = Model(problem, terms_of(catalogue.get_all(effects), problem))
    refuse_without_freedom(model)
    model = settled(model)
    fitted = estimate(model)
    left = fitted_residuals(model)
    out = left_out(model)
    series = ("norm",) if problem.lot.radial else tuple(AXES[axis] for axis in problem.axes)  # the blocks of one unit
    answer: ComparisonDocument = {
        "effects": [t.effect.id for t in model.terms],
        "rms_ug": MICRO * rms(left),
        "floor_ug": MICRO * model.floor(),
        "heldout_rms_ug": MICRO * out.rms(),
        "heldout": {kind: MICRO * rms(out.missed[kind]) for kind in out.density},
        "fresh_rms_ug": None,
        "by_unit": {
            u: {"rms_ug": MICRO * rms(r), "fresh_rms_ug": None}
            for u, r in zip(measurement.units, left.reshape(len(measurement.units), -1), strict=True)
        },
        "by_axis": {name: MICRO * rms(left[i :: problem.per_unit]) for i, name in enumerate(series)},
        "by_pose": _by_pose(measurement, left),
        "nonlinear": {t.effect.id: t.keywords for t in model.terms if t.keywords},
        "nonlinear_interval": intervals(model),
        "station": _station(fitted),
        "warnings": without_history(measurement, model.terms),
        "progress": None,
    }
    if again is not None:
        on_fresh = residuals_of(Problem(lot_of(again, like=measurement, square=square)), fitted)
        answer["fresh_rms_ug"] = MICRO * rms(on_fresh)
        for unit, values in zip(again.units, on_fresh.reshape(len(again.units), -1), strict=True):
            answer["by_unit"][unit]["fresh_rms_ug"] = MICRO * rms(values)
        answer["fresh_by_pose"] = _by_pose(again, on_fresh)
    if before is not None:
        lesser = Model(problem, terms_of(catalogue.get_all(list(before)), problem))
        lot = None if again is None else lot_of(again, like=measurement, square=square)
        judged_by = progress(
            lesser, model, out, lot, lambda: doubt_of_run(measurement, problem.lot, list(before), list(effects))
        )
        if again is not None and _needing_history(again, [t for t in model.terms if t.effect.id not in set(before)]):
            judged_by["confirmed"], judged_by["reason"] = None, "its prediction needs the history of the fresh run"
        answer["progress"] = judged_by
    if again is not None:
        answer["warnings"] += [
            f"{name} depends on the temperature between the dwells, and no history of the fresh run was given: its prediction "
            "there is unreliable; give --fresh-temperatures FILE"
            for name in _needing_history(again, model.terms)
        ]
    return answer


def without_history(measurement: Measured, terms: Sequence[Term]) -> list[str]:
    """A warning for every effect that depends on the temperature between the dwells if its history is missing."""
    return [
        f"{name} depends on the temperature between the dwells, and no history was given: its size is unreliable; give "
        "--temperatures FILE"
        for name in _needing_history(measurement, terms)
    ]


def _needing_history(measurement: Measured, terms: Sequence[Term]) -> list[str]:
    """Ids of effects that depend on the temperature between the dwells; empty if its history is given."""
    if measurement.state.temperature is None or measurement.state.history is not None:
        return []
    effects = [t.effect for t in terms if not isinstance(t.effect, Handling)]
    return [e.id for e in effects if e.memory and "temperature" in drivers_of(measurement.state, e)]


def _station(fitted: Estimate) -> list[StationParameter]:
    """Parameters of the station with their standard errors."""
    names = [(t.effect.id, n) for t in fitted.terms if isinstance(t.effect, StationEffect) for n in t.effect.names()]
    return [
        {"effect": effect, "name": name, "value": float(value), "standard_error": float(error)}
        for (effect, name), value, error in zip(
            names, fitted.shared[: len(names)], fitted.shared_error[: len(names)], strict=True
        )
    ]


def _same_units(first: Measured, fresh: Measured) -> Measured:
    """The fresh run with its units in the order of the first; the dwells of the first themselves are refused."""
    strange = sorted(set(fresh.units) ^ set(first.units))
    if strange:
        raise DataRejected(
            f"compare: {', '.join(strange[:5])} not in both runs, every unit is needed in both; "
            "give a fresh run of the same units, or leave the others out of both files"
        )
    known, rows = (np.nan_to_num(run.readings.output).reshape(-1, 3).tolist() for run in (first, fresh))
    if 2 * (same := len({*map(tuple, rows)} & {*map(tuple, known)})) > len(rows):
        raise DataRejected(
            f"compare: {same} of {len(rows)} dwells of the fresh run have exactly the outputs of dwells of the fit, another "
            "measurement is needed; give that one, or outputs with more digits where these are rounded"
        )
    return fresh.pick([fresh.units.index(u) for u in first.units])


def _by_pose(measurement: Measured, left: Array) -> list[PoseComparison]:
    """RMS residual of each pose over all units and axes, worst first."""
    if measurement.reference == "norm":
        return []
    force = np.round(measurement.state.force[0], 2) + 0.0
    poses, pose_of = np.unique(force, axis=0, return_inverse=True)
    pose_of = pose_of.reshape(-1)
    rows: list[PoseComparison] = [
        {"force": poses[k].tolist(), "dwells": int(np.sum(pose_of == k)), "rms_ug": MICRO * rms(left[:, pose_of == k])}
        for k in range(len(poses))
    ]
    return sorted(rows, key=lambda row: -row["rms_ug"])


def doubt_of_run(measurement: Measured, lot: Lot, before: Sequence[str], after: Sequence[str]) -> str | None:
    """The reason why one run cannot distinguish the added effects from a fault of the run; None if there is no sign of a fault.

    A fault (a table that slipped, exchanged units, a thermometer offset) affects the dwells left out like the others, so that an
    effect that imitates it predicts them. The run is therefore searched for faults without and with the effects, and the model
    with the effects must be adequate.

    Parameters
    ----------
    measurement, lot : the run; before, after : ids of the models without and with the effects
    """
    faults = find_faults(measurement.readings) if measurement.reference != "norm" else []
    if faults:
        return f"the run has a data fault: {_listed([fault.name for fault in faults])}"
    try:
        return _with_effects(lot, after) or _without_effects(lot, before)
    except InertialError as problem:
        return f"the run cannot be searched for faults: {problem}"


def _with_effects(lot: Lot, after: Sequence[str]) -> str | None:
    verdict = judged(lot, after, generator())
    named = [name for finding in verdict.handled for name in finding.effects.ids] + _bad(verdict.removed)
    if named:
        return f"with it the diagnosis of the run names {_listed(named)}"
    if verdict.adequate is True:
        return None
    return f"the model with it is not adequate for the run{f': {verdict.unjudged}' if verdict.unjudged else ''}"


def _without_effects(lot: Lot, before: Sequence[str]) -> str | None:
    first = diagnose(lot, before, generator())
    # a handling error in the class of an effect explains the run as well as the effect
    groups = [finding.effects for finding in (*first.handled, *first.named) if finding.effects.of_data]
    named = [name for group in groups for name in group.ids] + _bad(first.removed)
    return f"without it the diagnosis of the run names {_listed(named)}" if named else None


def _bad(removed: Sequence[BadDwell]) -> list[str]:
    return [BAD_DWELL for dwell in removed if not dwell.tail]


def _listed(names: Sequence[str]) -> str:
    return ", ".join(dict.fromkeys(names))
