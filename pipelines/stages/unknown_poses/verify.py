"""Verification of a fit by the norm of gravity on dwells that were held out, and its uncertainty."""

from __future__ import annotations

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from inertial.fits.wander import student
from pipelines.stages.rms_error import rms_columns
from pipelines.stages.unknown_poses.dwells import NormDwells, norm_dwells
from pipelines.stages.verify import nothing_verified
from schemas.units import AXES, MICRO

Array = NDArray[np.float64]


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
    rows = [_rows(one, gravity, student(own)) for one, own in zip(units, dof, strict=True)]
    return {
        "verification": pd.concat([row[0] for row in rows], ignore_index=True),
        "verification_poses": pd.concat([row[1] for row in rows], ignore_index=True),
    }


def _rows(one: NormDwells, gravity: float, widened: float) -> tuple[pd.DataFrame, pd.DataFrame]:
    lot, unseen = one.lot, ~one.design.used
    force = lot.state.force[0, unseen]
    norm = np.linalg.norm(force, axis=1)
    error = MICRO * (norm - gravity)
    expected = MICRO**2 * widened**2 * one.design.prediction(one.noise)
    share = np.abs(force / norm[:, None])
    share = share / np.sqrt(np.mean(share**2, axis=0))
    by_axis = error[:, None] * share
    spread = share.T[:, :, None] * expected * share.T[:, None, :]
    of_unit = rms_columns(by_axis.T, spread)
    poses = [name for name, held in zip(lot.poses, unseen, strict=True) if held]
    temperature = lot.state.temperature
    u = np.sqrt(np.diagonal(expected))
    table = pd.DataFrame(
        {
            "unit": lot.units[0],
            "dwell": lot.dwells[unseen],
            "pose": poses,
            "norm_g": norm,
            "error_ug": error,
            "uncertainty_ug": u,
            "reading_ug": MICRO * one.reading[unseen],
            **{name: np.full(len(error), value) for name, value in of_unit.items()},
            **{f"error_{letter}_ug": by_axis[:, axis] for axis, letter in enumerate(AXES)},
            "unit_C": np.full(len(error), np.nan) if temperature is None else temperature[0, unseen],
        }
    )
    by_pose = [(pose, np.flatnonzero(np.asarray(poses) == pose)) for pose in dict.fromkeys(poses)]
    means = pd.DataFrame(
        {
            "unit": lot.units[0],
            "pose": [pose for pose, _ in by_pose],
            "dwells": [own.size for _, own in by_pose],
            "error_ug": [float(error[own].mean()) for _, own in by_pose],
            "uncertainty_ug": [float(np.sqrt(expected[np.ix_(own, own)].mean())) for _, own in by_pose],
        }
    )
    return table, means
