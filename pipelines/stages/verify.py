"""Verification in poses that are not fitted: | |a_corr| − g | of every unit, by dwell and by pose, and its uncertainty."""

import numpy as np
import pandas as pd
from scipy.special import chdtrc

from inertial.arrays import Array, Flags
from inertial.correction import correct, station_change
from inertial.design import of_axes
from inertial.estimation.alternative import soaks
from pipelines.stages.rms_error import OF_UNITS, rms_columns
from pipelines.tables.calibration import Calibration, read_calibration
from pipelines.tables.dwells import LotArrays, LotTables
from pipelines.tables.frames import empty_table, joined_parts, own_rows, picked
from schemas.units import AXES, MICRO

SOAKS_ALARM = 0.01
"""Probability that any pose of a good unit is taken to have another error at each soak.

Found in 40 lots: 1 of 160 units, with flicker 2; an error that is odd in the temperature in 31 and 34 of 40 where it is twice the
uncertainty of a dwell, in all where it is three times that. The means of single soaks alone would show the device's wander:
671 to 888 µg in the units of the main job, whose poses are 201 to 471 µg off.
"""


def verify(
    dwells: pd.DataFrame,
    history: pd.DataFrame | None,
    coefficients: pd.DataFrame,
    covariance: pd.DataFrame,
    predictions: pd.DataFrame,
) -> dict[str, pd.DataFrame]:
    """The remaining error of every verification dwell, and of every verification pose over its dwells, in µg.

    ``error_ug`` is |a_corr| − g, independent of angles; ``error_x_ug`` … are differences from the force by the table angles.
    ``uncertainty_ug`` (k = 1) is the standard deviation of the error of a correct model: white noise, wander since the fitted
    dwells, and the effect of both on the coefficients. ``reading_ug`` (k = 1) is the white noise of the dwell alone.
    ``rms_uncertainty_x_ug`` … (k = 1), equal in all rows of a unit, is the uncertainty of the RMS of ``error_x_ug`` … over its
    dwells; ``rms_expected_x_ug`` … is the RMS of a correct model, and ``rms_dof_x`` … the degrees of freedom of its square.

    In ``verification_poses`` the error is the mean over the dwells of a pose: the error left by the calibration, while wander,
    which no calibration removes, is partly averaged out. Where the means at its soaks differ by more than their uncertainties
    allow, it is that of the soak with the largest error: errors of opposite sign at two temperatures must not cancel. Its
    uncertainty accounts for the correlation of the dwells.
    """
    return verify_tables(LotTables(dwells, history), coefficients, covariance, predictions)


def verify_tables(
    tables: LotTables,
    coefficients: pd.DataFrame,
    covariance: pd.DataFrame,
    predictions: pd.DataFrame | Array,
    calibration: Calibration | None = None,
) -> dict[str, pd.DataFrame]:
    """:func:`verify` of tables that are shared with other stages.

    Parameters
    ----------
    predictions : the table, or its covariances (units, 3, m, m), µg²
    calibration : the calibration of the tables, if other stages have read it already
    """
    if not np.any(tables.dwells["kind"] == "verification") or coefficients.empty:
        return nothing_verified()
    if len(tables.parts) > 1 and isinstance(predictions, pd.DataFrame):
        made: list[dict[str, pd.DataFrame]] = []
        for part in tables.parts:
            tables_of_part = [own_rows(table, part.dwells) for table in (coefficients, covariance, predictions)]
            made.append(verify_tables(part, tables_of_part[0], tables_of_part[1], tables_of_part[2]))
        return joined_parts(made)
    lot, calibration = tables.all_kinds, calibration or read_calibration(coefficients, covariance)
    model, unseen = calibration.effects, lot.of_kind("verification")
    corrected = correct(model, lot.state, lot.output, calibration.coefficients, calibration.nonlinear)
    truth = lot.state.force + station_change(model, lot.state, calibration.shared, calibration.nonlinear)
    axes = lot.state.axes
    corrected, truth = of_axes(corrected, axes, -1), of_axes(truth, axes, -1)
    norm, expected_norm = sizes(corrected), sizes(of_axes(lot.state.force, axes, -1))
    toward = (corrected / norm[..., None])[:, unseen]
    scale = np.abs(calibration.scale)[:, None, :]
    reading = (lot.standard_error / scale)[:, unseen]
    by_axis = MICRO * (corrected - truth)[:, unseen]
    spread = predictions if isinstance(predictions, np.ndarray) else _expected(predictions, lot.units)
    expected = np.einsum("uja,uajk,uka->ujk", toward, spread, toward)
    of_units = rms_columns(np.swapaxes(by_axis, 1, 2), spread, lot.letters)
    columns = {
        "norm_g": norm[:, unseen],
        "error_ug": MICRO * (norm - expected_norm)[:, unseen],
        "uncertainty_ug": np.sqrt(np.diagonal(expected, axis1=-2, axis2=-1)),
        "reading_ug": MICRO * np.sqrt(np.sum((toward * reading) ** 2, axis=-1)),
        **{name: values[:, None] + np.zeros_like(by_axis[..., 0]) for name, values in of_units.items()},
    }
    return verification_rows(lot, unseen, columns, by_axis, expected)


def sizes(force: Array) -> Array:
    """Norm of forces (..., m), g; for a single axis the signed force along it."""
    return force[..., 0] if force.shape[-1] == 1 else np.linalg.norm(force, axis=-1)


def verification_rows(
    lot: LotArrays, unseen: Flags, columns: dict[str, Array], by_axis: Array, expected: Array
) -> dict[str, pd.DataFrame]:
    """The tables of a verification.

    Parameters
    ----------
    unseen : (n,), the m dwells for verification; columns : (units, m) each, by name; by_axis : (units, m, 3), errors, µg
    expected : (units, m, m), covariance of ``error_ug`` of a correct model, µg²
    """
    return {
        "verification": _rows(lot, unseen, columns, by_axis),
        "verification_poses": _pose_rows(lot, unseen, columns["error_ug"], expected),
    }


def _expected(predictions: pd.DataFrame, units: tuple[str, ...]) -> Array:
    """Covariance of the errors of the dwells under a correct model, (units, 3, m, m), µg²."""
    unit, axis = (predictions[name].factorize(sort=True)[0] for name in ("unit", "axis"))
    dwell, other = (predictions[name].to_numpy() for name in ("dwell", "other"))
    m = np.unique(dwell).size
    row, column = np.tril_indices(m)
    out = np.zeros((len(units), axis.max() + 1, m, m))
    values = (
        predictions["covariance_ug2"].to_numpy()[np.lexsort((other, dwell, axis, unit))].reshape(*out.shape[:2], -1)
    )
    out[..., row, column] = values
    out[..., column, row] = values
    return out


def _pose_rows(lot: LotArrays, unseen: Flags, error: Array, expected: Array) -> pd.DataFrame:
    """The mean of every pose; of one whose soaks differ by more than :data:`SOAKS_ALARM` allows, that of its worst soak."""
    poses, soak = np.asarray(lot.poses, dtype=object)[unseen], soaks(lot.state)[unseen]
    names = list(dict.fromkeys(poses.tolist()))
    rows: list[tuple[str, str, int, float, float]] = []
    for pose in names:
        dwells = np.flatnonzero(poses == pose)
        means = np.array([(soak == k) & (poses == pose) for k in np.unique(soak[dwells])], dtype=np.float64)
        means /= means.sum(axis=1, keepdims=True)
        of_pose = (poses == pose) / dwells.size
        for unit, errors, covariance in zip(lot.units, error, expected, strict=True):
            chosen = of_pose
            if len(means) > 1:
                apart = means[1:] - means[0]
                differences = apart @ errors
                chi2 = float(differences @ np.linalg.pinv(apart @ covariance @ apart.T) @ differences)
                if chdtrc(len(apart), chi2) < SOAKS_ALARM / len(names):
                    chosen = means[int(np.argmax(np.abs(means @ errors)))]
            # standard deviation of the mean, with the correlation of its dwells
            u = float(np.sqrt(chosen @ covariance @ chosen))
            rows.append((unit, pose, int(np.count_nonzero(chosen)), float(chosen @ errors), u))
    return pd.DataFrame(rows, columns=["unit", "pose", "dwells", "error_ug", "uncertainty_ug"])


def _rows(lot: LotArrays, unseen: Flags, columns: dict[str, Array], by_axis: Array) -> pd.DataFrame:
    u, n = np.indices(by_axis.shape[:2]).reshape(2, -1)
    temperature = lot.state.temperature
    return pd.DataFrame(
        {
            "unit": picked(lot.units, u),
            "dwell": lot.dwells[unseen][n],
            "pose": picked(lot.poses, np.flatnonzero(unseen)[n]),
            **{name: values.ravel() for name, values in columns.items()},
            **{f"error_{letter}_ug": by_axis[..., axis].ravel() for axis, letter in enumerate(lot.letters)},
            "unit_C": np.full(u.size, np.nan) if temperature is None else temperature[:, unseen][u, n],
        }
    )


def nothing_verified() -> dict[str, pd.DataFrame]:
    """The tables of a verification without a row."""
    numbers = "norm_g error_ug uncertainty_ug reading_ug error_x_ug error_y_ug error_z_ug unit_C"
    numbers += "".join(f" {name.format(letter)}" for name in OF_UNITS for letter in AXES)
    return {
        "verification": empty_table(texts="unit pose", integers="dwell", numbers=numbers),
        "verification_poses": empty_table(texts="unit pose", integers="dwells", numbers="error_ug uncertainty_ug"),
    }
