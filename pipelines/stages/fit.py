"""Fit of a model to the dwells of a lot: coefficients, covariance and residuals for every accepted unit."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from inertial.errors import InertialError
from inertial.fits.linear import fit_lot
from pipelines.stages.arrays import AXES, LotArrays, lot_arrays
from pipelines.stages.calibration import coefficient_rows, covariance_rows
from pipelines.stages.empty import empty_table
from schemas.errors import DataRejected

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from inertial.fits.linear import LotFit

MICRO = 1e6


def fit(dwells: pd.DataFrame, effects: Sequence[str]) -> dict[str, pd.DataFrame]:
    """Coefficients, covariance and residuals of the recipe's effects for every unit of a lot.

    The white-noise error sd/√n of a dwell is a lower bound: where the residuals are larger, for wander between dwells
    or for what the model lacks, the covariance is scaled by χ²/ν (Birge ratio squared; GUM type B for lack of fit).
    Tables without rows come back where no unit was accepted.
    """
    measured = dwells[dwells["kind"] == "dwell"]
    if measured.empty:
        return _nothing()
    lot = lot_arrays(measured)
    try:
        found = fit_lot(effects, lot.state, lot.output, lot.standard_error)
    except InertialError as problem:
        raise DataRejected(str(problem)) from None
    stretch = birge_squared(found)
    covariance = found.covariance * stretch[..., None, None]
    return {
        "coefficients": coefficient_rows(lot.units, found, covariance, lot.out_unit),
        "covariance": covariance_rows(lot.units, covariance),
        "residuals": _residual_rows(lot, found, stretch),
    }


def birge_squared(found: LotFit) -> NDArray[np.float64]:
    """χ²/ν of every unit and axis, never below one, (units, 3)."""
    return np.maximum(1.0, found.chi2 / np.maximum(found.dof, 1))


def _residual_rows(lot: LotArrays, found: LotFit, stretch: NDArray[np.float64]) -> pd.DataFrame:
    scale = np.abs(np.diagonal(found.response(), axis1=-2, axis2=-1))[:, None, :]
    shape = lot.output.shape
    u, n, a = np.meshgrid(*(np.arange(size) for size in shape), indexing="ij")
    u, n, a = u.ravel(), n.ravel(), a.ravel()
    error = lot.standard_error * np.sqrt(stretch)[:, None, :]
    temperature = lot.state.temperature
    return pd.DataFrame(
        {
            "unit": np.asarray(lot.units, dtype=object)[u],
            "dwell": lot.dwells[n],
            "axis": np.asarray(AXES, dtype=object)[a],
            "pose": np.asarray(lot.poses, dtype=object)[n],
            "force_g": np.broadcast_to(lot.state.force, shape)[u, n, a],
            "residual_ug": (MICRO * found.residuals / scale).ravel(),
            "standard_error_ug": (MICRO * error / scale).ravel(),
            "unit_C": np.full(u.size, np.nan) if temperature is None else temperature[u, n],
        }
    )


def _nothing() -> dict[str, pd.DataFrame]:
    return {
        "coefficients": empty_table(texts="unit axis effect name unit_text", numbers="value standard_error"),
        "covariance": empty_table(texts="unit axis", numbers="value", whole="row column"),
        "residuals": empty_table(
            texts="unit axis pose", numbers="force_g residual_ug standard_error_ug unit_C", whole="dwell"
        ),
    }
