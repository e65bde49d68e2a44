"""Verification on poses that the fit has not seen: | |a_corr| − g | for every unit and dwell, with its uncertainty."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from inertial import design
from inertial.correction import correct, station_change
from pipelines.stages.arrays import AXES, LotArrays, lot_arrays
from pipelines.stages.calibration import Calibration, read_calibration
from pipelines.stages.empty import empty_table

if TYPE_CHECKING:
    from numpy.typing import NDArray

MICRO = 1e6


def verify(
    dwells: pd.DataFrame, coefficients: pd.DataFrame, covariance: pd.DataFrame, residuals: pd.DataFrame
) -> pd.DataFrame:
    """The error that is left in every verification dwell, in µg.

    ``error_ug`` is |a_corr| − g, which needs no angle; ``error_x_ug`` … compare with the table's angles too.
    ``uncertainty_ug`` (k = 1) is what may be expected there: the coefficients' covariance and the wander of a single
    dwell, both from the fit. ``reading_ug`` (k = 1) is the white noise of the reading alone.
    """
    unseen = dwells[dwells["kind"] == "verification"]
    if unseen.empty or coefficients.empty:
        numbers = "norm_g error_ug uncertainty_ug reading_ug error_x_ug error_y_ug error_z_ug unit_C"
        return empty_table(texts="unit pose", whole="dwell", numbers=numbers)
    lot, calibration = lot_arrays(unseen), read_calibration(coefficients, covariance)
    model = calibration.effects
    corrected = correct(model, lot.state, lot.output, calibration.coefficients, calibration.nonlinear)
    truth = lot.state.force + station_change(model, lot.state, calibration.shared, calibration.nonlinear)
    norm = np.linalg.norm(corrected, axis=-1)
    axis_error = _axis_uncertainty(lot, calibration, residuals)
    toward = corrected / norm[..., None]
    scale = np.abs(np.diagonal(calibration.response, axis1=-2, axis2=-1))[:, None, :]
    columns = {
        "norm_g": norm,
        "error_ug": MICRO * (norm - np.linalg.norm(lot.state.force, axis=-1)),
        "uncertainty_ug": MICRO * np.sqrt(np.sum((toward * axis_error) ** 2, axis=-1)),
        "reading_ug": MICRO * np.sqrt(np.sum((toward * lot.standard_error / scale) ** 2, axis=-1)),
    }
    return _rows(lot, columns, MICRO * (corrected - truth))


def _axis_uncertainty(lot: LotArrays, calibration: Calibration, residuals: pd.DataFrame) -> NDArray[np.float64]:
    """Standard uncertainty of each corrected axis, (units, n, 3), g."""
    sensor, _ = design.split(calibration.effects)
    scale = np.abs(np.diagonal(calibration.response, axis1=-2, axis2=-1))
    columns = design.local_columns(sensor, replace(lot.state, memory={}), calibration.nonlinear)
    model = np.einsum("uanp,uapq,uanq->una", np.broadcast_to(columns, (len(lot.units), *columns.shape[-3:])),
                      calibration.covariance, columns)  # fmt: skip
    squares = residuals.assign(square=residuals["standard_error_ug"] ** 2)
    table = squares.pivot_table(index="unit", columns="axis", values="square", aggfunc="mean")
    single = table.loc[list(lot.units), list(AXES)].to_numpy() / MICRO**2
    return np.sqrt(model / scale[:, None, :] ** 2 + single[:, None, :])


def _rows(lot: LotArrays, columns: dict[str, NDArray[np.float64]], by_axis: NDArray[np.float64]) -> pd.DataFrame:
    u, n = (index.ravel() for index in np.meshgrid(*(np.arange(s) for s in by_axis.shape[:2]), indexing="ij"))
    temperature = lot.state.temperature
    return pd.DataFrame(
        {
            "unit": np.asarray(lot.units, dtype=object)[u],
            "dwell": lot.dwells[n],
            "pose": np.asarray(lot.poses, dtype=object)[n],
            **{name: values.ravel() for name, values in columns.items()},
            **{f"error_{letter}_ug": by_axis[..., axis].ravel() for axis, letter in enumerate(AXES)},
            "unit_C": np.full(u.size, np.nan) if temperature is None else temperature[u, n],
        }
    )
