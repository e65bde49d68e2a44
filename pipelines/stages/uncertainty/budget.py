"""The uncertainty budget of every unit: contributions to coefficients, corrected output and verification, and their sum."""

from dataclasses import replace

import numpy as np
import pandas as pd

from inertial.arrays import Array, Flags
from inertial.design import of_axes
from inertial.fits.linear import own_terms
from inertial.fits.wander import wander_kernels
from inertial.frames import angles_from_force
from inertial.state import ALL_AXES
from inertial.uncertainty.influences import MeasurementModel, sensitivity
from inertial.uncertainty.propagation import fit_design, propagated
from pipelines.stages.uncertainty.budget_terms import BudgetTables, BudgetTerms
from pipelines.stages.uncertainty.compared import compared_tables
from pipelines.stages.uncertainty.contributions import DwellConditions, influences, sources
from pipelines.stages.uncertainty.measurands import LotBudget, VarianceParts
from pipelines.stages.uncertainty.tables import empty, tables_of
from pipelines.tables.calibration import Calibration
from pipelines.tables.dwells import LotArrays
from pipelines.tables.frames import joined_parts
from schemas.units import MICRO
from schemas.validity import Stability


def budget(tables: BudgetTables, terms: BudgetTerms) -> dict[str, pd.DataFrame]:
    """Tables ``budget``, ``uncertainties`` and ``budget_covariance``; without rows where no uncertainty is stated.

    ``budget`` has one row per unit, quantity and contribution, ``uncertainties`` one per unit and quantity: value, u of type A
    and B, effective degrees of freedom, k and U, and for verification the part that the station's own verification shows.
    Results by comparison are quantities like the others; those of a frequency have it as ``setting``.
    """
    if terms.stated is None:
        return empty()
    known = sources(terms.stated)
    made = [tables_of(lot_budget(part, terms), known) for part in tables.parts()]
    made = joined_parts(made) if made else empty()
    if tables.results is None or tables.results.empty:
        return made
    compared = {name: rows for name, rows in compared_tables(tables.results, terms).items() if len(rows)}
    return made | {
        name: rows if made[name].empty else pd.concat([made[name], rows], ignore_index=True)
        for name, rows in compared.items()
    }


def lot_budget(tables: BudgetTables, terms: BudgetTerms) -> LotBudget:
    """The dwells of a lot with the angles of the table, its calibration, and the influences through its fit."""
    lot = tables.arrays()
    if lot.state.outer is None:  # faces or forces that are known otherwise: as a table would have turned to them
        outer, inner = angles_from_force(lot.state.force)
        lot = replace(lot, state=replace(lot.state, outer=outer, inner=inner, memory={}))
    if terms.dwells_chosen:
        fitted = tables.dwells.loc[tables.dwells["kind"] == "dwell", "duration_s"]
        terms = replace(terms, dwell_s=float(fitted.mean()))
    calibration = tables.calibrated()
    at = conditions(lot, tables.dwells, calibration.response, terms)
    return LotBudget(lot, calibration, tables, terms, propagate(lot, calibration, tables.wander, terms, at))


def conditions(lot: LotArrays, dwells: pd.DataFrame, response: Array, terms: BudgetTerms) -> DwellConditions:
    """The dwells of a lot on which the influences act."""
    soak = np.zeros(lot.dwells.size, dtype=np.int64)
    if "soak" in dwells:
        rows_of_unit = np.flatnonzero(dwells["unit"].to_numpy(dtype=object) == lot.units[0])
        rows_of_unit = rows_of_unit[np.argsort(dwells["dwell"].to_numpy()[rows_of_unit], kind="stable")]
        rows = rows_of_unit[np.searchsorted(dwells["dwell"].to_numpy()[rows_of_unit], lot.dwells)]
        soak = dwells["soak"].to_numpy()[rows].astype(np.int64)
    read = lot.state.temperature if lot.state.temperature is not None else np.full(lot.dwells.size, terms.room_C)
    mean = np.broadcast_to(read, (len(lot.units), lot.dwells.size)).mean(axis=0)
    target = np.array([mean[soak == number].mean() for number in soak])
    scale = np.abs(_own_scale(response, lot.state.axes)).reshape(-1, len(lot.state.axes)).mean(axis=0)
    return DwellConditions(lot.state, soak, target, terms.soak_min_s, terms.room_C, scale)


def propagate(
    lot: LotArrays, calibration: Calibration, wander: pd.DataFrame, terms: BudgetTerms, at: DwellConditions
) -> VarianceParts:
    """The influences through the fit of a lot."""
    if terms.stated is None:
        raise ValueError("no uncertainty is stated")
    used = lot.of_kind("dwell")
    model = MeasurementModel(calibration.effects, calibration.coefficients, calibration.nonlinear)
    physical = with_device_temperature(model, calibration.response, terms.stability, calibration.axes)
    inputs, scattered = influences(terms.stated, at, terms.stability)
    source = sensitivity(physical, lot.state, inputs, scattered)
    design = fit_design(model, lot.state, dwell_noise(lot, wander, used), used)
    fitted = replace(source, changes=source.changes[..., used, :, :])
    fit = propagated(design, fitted, calibration.response)
    return VarianceParts(
        fit=fit,
        verification=source.changes[..., ~used, :, :],
        visible_share=lambda: design.visible_share(fitted.changes, fit.coefficients),
    )


def _own_scale(response: Array, axes: tuple[int, ...]) -> Array:
    """The response of each axis with an output to the force along itself, (..., m), of responses (..., 3, 3)."""
    return own_terms(of_axes(response, axes, -2), axes)


def with_device_temperature(
    model: MeasurementModel, response: Array, stability: Stability | None, axes: tuple[int, ...] = ALL_AXES
) -> MeasurementModel:
    """The model with the stated temperature coefficients of the device, for those that the model lacks."""
    if stability is None:
        return model
    effects, coefficients = list(model.effects), model.coefficients
    for effect, value in (
        ("bias_temperature", stability.bias_temperature_ug_K),
        ("scale_temperature", stability.scale_temperature_ppm_K),
    ):
        if effect not in effects and value > 0.0:
            columns = value / MICRO * np.abs(_own_scale(response, axes))[..., None]
            coefficients = np.concatenate([coefficients, columns], axis=-1)
            effects.append(effect)
    return MeasurementModel(effects, coefficients, model.nonlinear)


def dwell_noise(lot: LotArrays, wander: pd.DataFrame, used: Flags) -> Array:
    """Covariance (n, n) of the noise of the fit's dwells as the fit weighed them; its scale is arbitrary."""
    error = np.broadcast_to(lot.standard_error, lot.output.shape)[:, used]
    profile = np.sqrt(np.mean(error**2 / np.mean(error**2, axis=1, keepdims=True), axis=(0, 2)))
    white, flicker, walk = (
        float(np.mean(np.asarray(wander[name], dtype=float) ** 2)) for name in ("white_ug", "flicker_ug", "walk_ug")
    )
    time = np.broadcast_to(lot.state.time, (len(lot.units), used.size))[0]
    kernels = [kernel[np.ix_(used, used)] for kernel in wander_kernels(time, used)]
    total = np.diag(profile**2) * (white if white > 0.0 else 1.0) + flicker * kernels[0] + walk * kernels[1]
    return total / np.mean(np.diagonal(total))
