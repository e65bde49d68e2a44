"""Dwells of unknown orientation under a calibration: the force of each, its noise, the fit as a linear map, and verification."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

from inertial.arrays import Array
from inertial.correction import correct
from inertial.fits.linear import force_along_axes, response_matrix
from inertial.fits.norm_noise import runs_left_out
from inertial.fits.wander import student
from inertial.noise.flicker import flicker_kernel
from inertial.noise.measurands import walk_kernel
from inertial.uncertainty.influences import MeasurementModel
from inertial.uncertainty.norm_design import NormDesign, norm_design
from pipelines.stages.rms_error import rms_columns
from pipelines.stages.verify import nothing_verified, verification_rows
from pipelines.tables.calibration import Calibration, read_calibration
from pipelines.tables.dwells import KINDS, LotArrays, measured
from schemas.units import MICRO

FITTED = "dwell"


@dataclass(frozen=True)
class NormDwells:
    """The dwells of one unit under its calibration.

    lot : with the force that explains the outputs; calibration : of this unit
    reading : (n,), white noise of each dwell's norm, g; noise : (n, n), covariance of the norms, white and wander, g²
    """

    lot: LotArrays
    calibration: Calibration
    design: NormDesign
    reading: Array
    noise: Array

    @property
    def model(self) -> MeasurementModel:
        """The calibrated model."""
        return MeasurementModel(self.calibration.effects, self.calibration.coefficients, self.calibration.nonlinear)


def norm_dwells(
    dwells: pd.DataFrame,
    history: pd.DataFrame | None,
    coefficients: pd.DataFrame,
    covariance: pd.DataFrame,
    wander: pd.DataFrame,
) -> Iterator[NormDwells]:
    """Every unit of a lot that has coefficients; the dwells of the fit and those that are held out together."""
    calibration = read_calibration(coefficients, covariance)
    for index, unit in enumerate(calibration.units):
        rows = dwells[(dwells["unit"].astype(str) == unit) & dwells["kind"].isin(list(KINDS))]
        past = history if history is None or "unit" not in history.columns else history[history["unit"] == unit]
        of_unit = replace(
            calibration,
            units=(unit,),
            coefficients=calibration.coefficients[[index]],
            covariance=calibration.covariance[[index]],
        )
        yield _norm_dwells(rows.sort_values("dwell"), past, of_unit, wander[wander["unit"].astype(str) == unit])


def _norm_dwells(
    dwells: pd.DataFrame, history: pd.DataFrame | None, calibration: Calibration, wander: pd.DataFrame
) -> NormDwells:
    measurement = measured(dwells, history)
    readings, state = measurement.readings, measurement.state
    force = correct(calibration.effects, state, readings.output, calibration.coefficients, calibration.nonlinear)
    response = response_matrix(calibration.coefficients, calibration.names)
    scale = np.abs(np.diagonal(response, axis1=-2, axis2=-1))
    felt = force_along_axes(response, force)
    state = replace(state, force=force, felt=felt, memory={})
    white, flicker, walk = (float(wander[name].iloc[0]) / MICRO for name in ("white_ug", "flicker_ug", "walk_ug"))
    direction = force[0] / np.linalg.norm(force[0], axis=-1, keepdims=True)
    n = len(direction)
    reading = np.full(n, white)
    error = np.full((n, 3), white) * scale[0]
    if readings.mean_error is not None:
        error = readings.mean_error[0]
        reading = np.sqrt(np.sum((direction * error / scale[0]) ** 2, axis=1))
    kinds = dwells["kind"].to_numpy().astype(np.str_)
    used = np.asarray(kinds == FITTED)
    profile = np.where(reading > 0.0, reading, np.median(reading))
    profile = profile / np.sqrt(np.mean(profile[used] ** 2))
    time = readings.time[0]
    kernel = flicker**2 * flicker_kernel(time) + walk**2 * walk_kernel(time)
    runs = runs_left_out(calibration.effects, state.temperature, direction[None], used[None])[0]
    noise = np.diag((white * profile) ** 2) + kernel * (direction @ direction.T) + runs @ runs.T
    model = MeasurementModel(calibration.effects, calibration.coefficients, calibration.nonlinear)
    lot = LotArrays(
        units=calibration.units,
        dwells=measurement.dwells,
        poses=tuple(dwells["pose"].astype(str))
        if "pose" in dwells.columns
        else tuple(f"dwell {k}" for k in measurement.dwells),
        kinds=kinds,
        state=state,
        output=readings.output,
        standard_error=error[None],
        out_unit=str(dwells["out_unit"].iloc[0]),
    )
    return NormDwells(lot, calibration, norm_design(model, state, noise, used), reading, noise)


def verify_norms(
    dwells: pd.DataFrame,
    history: pd.DataFrame | None,
    coefficients: pd.DataFrame,
    covariance: pd.DataFrame,
    wander: pd.DataFrame,
    gravity: float,
) -> dict[str, pd.DataFrame]:
    """The tables of :func:`pipelines.stages.verify.verify` for dwells of unknown orientation; no rows where none is held out.

    Only the component of an error along the force shows in |f| − g. ``error_x_ug`` … are |f| − g times |uₓ| over the RMS of
    |uₓ|, u the direction of the force: their RMS is that of |f| − g where the force points along the axis, and that of the error
    of an axis where the errors of the axes are independent and alike.

    Parameters
    ----------
    gravity : where it was measured, g
    """
    if not np.any(dwells["kind"] == "verification") or coefficients.empty:
        return nothing_verified()
    units = list(norm_dwells(dwells, history, coefficients, covariance, wander))
    dof = wander.drop_duplicates("unit")["dof"].astype(int).tolist()
    tables = [_verified(unit, gravity, student(freedom)) for unit, freedom in zip(units, dof, strict=True)]
    return {name: pd.concat([by_name[name] for by_name in tables], ignore_index=True) for name in tables[0]}


def _verified(unit: NormDwells, gravity: float, widened: float) -> dict[str, pd.DataFrame]:
    unseen = ~unit.design.used
    force = unit.lot.state.force[0, unseen]
    norm = np.linalg.norm(force, axis=1)
    error = MICRO * (norm - gravity)
    expected = MICRO**2 * widened**2 * unit.design.prediction(unit.noise)
    share = np.abs(force / norm[:, None])
    share = share / np.sqrt(np.mean(share**2, axis=0))
    by_axis = error[:, None] * share
    of_unit = rms_columns(by_axis.T, share.T[:, :, None] * expected * share.T[:, None, :])
    columns = {
        "norm_g": norm,
        "error_ug": error,
        "uncertainty_ug": np.sqrt(np.diagonal(expected)),
        "reading_ug": MICRO * unit.reading[unseen],
        **{name: np.full(len(error), value) for name, value in of_unit.items()},
    }
    by_unit = {name: values[None] for name, values in columns.items()}
    return verification_rows(unit.lot, unseen, by_unit, by_axis[None], expected[None])
