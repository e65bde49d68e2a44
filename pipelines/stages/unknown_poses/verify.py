"""Verification of a fit by the norm of gravity on dwells that were held out, and its uncertainty."""

import numpy as np
import pandas as pd

from inertial.fits.wander import student
from pipelines.stages.rms_error import rms_columns
from pipelines.stages.unknown_poses.dwells import NormDwells, norm_dwells
from pipelines.stages.verify import nothing_verified, verification_rows
from schemas.units import MICRO


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
    tables = [_verified(one, gravity, student(own)) for one, own in zip(units, dof, strict=True)]
    return {name: pd.concat([own[name] for own in tables], ignore_index=True) for name in tables[0]}


def _verified(one: NormDwells, gravity: float, widened: float) -> dict[str, pd.DataFrame]:
    """The tables of one unit."""
    unseen = ~one.design.used
    force = one.lot.state.force[0, unseen]
    norm = np.linalg.norm(force, axis=1)
    error = MICRO * (norm - gravity)
    expected = MICRO**2 * widened**2 * one.design.prediction(one.noise)
    share = np.abs(force / norm[:, None])
    share = share / np.sqrt(np.mean(share**2, axis=0))
    by_axis = error[:, None] * share
    of_unit = rms_columns(by_axis.T, share.T[:, :, None] * expected * share.T[:, None, :])
    columns = {
        "norm_g": norm,
        "error_ug": error,
        "uncertainty_ug": np.sqrt(np.diagonal(expected)),
        "reading_ug": MICRO * one.reading[unseen],
        **{name: np.full(len(error), value) for name, value in of_unit.items()},
    }
    by_unit = {name: values[None] for name, values in columns.items()}
    return verification_rows(one.lot, unseen, by_unit, by_axis[None], expected[None])
