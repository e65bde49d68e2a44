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
    parts = [
        tables_of(_of_unit(dwell, tables, replace(terms, stated=stated), stated), sources(stated), ROTATIONS)
        for dwell in norm_dwells(tables.dwells, tables.history, tables.coefficients, tables.covariance, tables.wander)
    ]
    return {name: pd.concat([part[name] for part in parts], ignore_index=True) for name in parts[0]}


def _of_unit(dwells: NormDwells, tables: BudgetTables, terms: BudgetTerms, stated: Uncertainty) -> LotBudget:
    unit = dwells.lot.units[0]
    state = dwells.lot.state
    outer, inner = angles_from_force(state.force)
    if state.temperature is None:
        state = replace(state, temperature=np.full(state.force.shape[:-1], terms.room_C), memory={})
    lot = replace(dwells.lot, state=replace(state, outer=outer, inner=inner, memory={}))
    at = conditions(
        lot, tables.dwells.assign(unit=tables.dwells["unit"].astype(str)), dwells.calibration.response, terms
    )
    physical = with_device_temperature(dwells.model, dwells.calibration.response, terms.stability)
    inputs, scattered = influences(stated, at, terms.stability)
    source = sensitivity(physical, lot.state, inputs, scattered)
    fitted = propagated_by_norm(dwells.design, source, dwells.calibration.response)
    variances = VarianceParts(
        fit=replace(fitted, source=replace(source, changes=source.changes[:, dwells.design.used])),
        verification=source.changes[:, ~dwells.design.used],
        visible_share=lambda: dwells.design.visible_share(source.changes[0]),
    )
    wander = _of(tables.wander, unit)
    part = replace(
        tables,
        wander=wander.assign(dof=wander["dof"] / 3.0),  # the three axes have the degrees of freedom of one series
        verification=_of(tables.verification, unit),
        verification_poses=_of(tables.verification_poses, unit),
        noise=_of(tables.noise, unit),
    )
    return LotBudget(lot, dwells.calibration, part, terms, variances)


def _of(table: pd.DataFrame, unit: str) -> pd.DataFrame:
    return table[table["unit"].astype(str) == unit]
