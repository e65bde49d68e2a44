"""The uncertainty budget of a fit by the norm of gravity: references that act on the magnitude, through the fit's own design."""

from dataclasses import replace

import numpy as np
import pandas as pd

from inertial.frames import angles_from_force
from inertial.uncertainty.influences import sensitivity
from inertial.uncertainty.norm_design import propagated_by_norm
from pipelines.stages.uncertainty.budget import conditions, with_device_temperature
from pipelines.stages.uncertainty.budget_terms import BudgetTables, BudgetTerms
from pipelines.stages.uncertainty.contributions import influences, sources
from pipelines.stages.uncertainty.measurands import LotBudget, VarianceParts
from pipelines.stages.uncertainty.tables import empty, tables_of
from pipelines.stages.unknown_poses.verify import NormDwells, norm_dwells
from schemas.uncertainty import Uncertainty

OF_POSES = ("level", "orthogonality", "outer_offset", "inner_offset", "harmonics", "pose", "seat")
"""Entries that change the direction of the force only: the norm does not depend on them."""
ROTATIONS = {("misalignment", axis) for axis in ("yx", "zx", "zy")}
"""A coefficient of K below the diagonal is a rotation of the whole unit, zero by definition."""


def norm_budget(tables: BudgetTables, terms: BudgetTerms) -> dict[str, pd.DataFrame]:
    """The tables of the stage budget for dwells of unknown orientation; empty where nothing is stated."""
    if terms.stated is None or tables.coefficients.empty:
        return empty()
    stated = terms.stated.model_copy(update=dict.fromkeys(OF_POSES))
    own = [
        tables_of(_of_unit(dwell, tables, replace(terms, stated=stated), stated), sources(stated), ROTATIONS)
        for dwell in norm_dwells(tables.dwells, tables.history, tables.coefficients, tables.covariance, tables.wander)
    ]
    return {name: pd.concat([part[name] for part in own], ignore_index=True) for name in own[0]}


def _of_unit(one: NormDwells, tables: BudgetTables, terms: BudgetTerms, stated: Uncertainty) -> LotBudget:
    unit = one.lot.units[0]
    state = one.lot.state
    outer, inner = angles_from_force(state.force)
    if state.temperature is None:
        state = replace(state, temperature=np.full(state.force.shape[:-1], terms.room_C), memory={})
    lot = replace(one.lot, state=replace(state, outer=outer, inner=inner, memory={}))
    at = conditions(lot, tables.dwells.assign(unit=tables.dwells["unit"].astype(str)), one.calibration.response, terms)
    physical = with_device_temperature(one.model, one.calibration.response, terms.stability)
    own, scattered = influences(stated, at, terms.stability)
    whole = sensitivity(physical, lot.state, own, scattered)
    fitted = propagated_by_norm(one.design, whole, one.calibration.response)
    variances = VarianceParts(
        fit=replace(fitted, source=replace(whole, changes=whole.changes[:, one.design.used])),
        verification=whole.changes[:, ~one.design.used],
        visible_share=lambda: one.design.visible_share(whole.changes[0]),
    )
    wander = _of(tables.wander, unit)
    part = replace(
        tables,
        wander=wander.assign(dof=wander["dof"] / 3.0),  # the three axes have the degrees of freedom of one series
        verification=_of(tables.verification, unit),
        verification_poses=_of(tables.verification_poses, unit),
        noise=_of(tables.noise, unit),
    )
    return LotBudget(lot, one.calibration, part, terms, variances)


def _of(table: pd.DataFrame, unit: str) -> pd.DataFrame:
    return table[table["unit"].astype(str) == unit]
