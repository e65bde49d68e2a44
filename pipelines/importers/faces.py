"""Six labelled faces: the published method, and least squares of all eighteen means."""

from __future__ import annotations

from itertools import combinations
from typing import Any

import numpy as np
import pandas as pd

from inertial.arrays import Array
from inertial.fits.faces import Faces, faces, ferraris
from inertial.probability import passes
from inertial.quantities import OUTPUT_COLUMNS, SPREAD_COLUMNS
from inertial.uncertainty.rounding import equal
from pipelines.importers.judged import FitAnswer, bias_row, gravity_of, imported_dwells, response_row
from pipelines.importers.mapping import FACES, Mapping
from pipelines.importers.record import Imported
from schemas.errors import DataRejected
from schemas.units import AXES, MICRO, STANDARD_GRAVITY_M_S2

MODEL = ("bias", "scale", "misalignment")
GROSS = 0.05
"""Smallest part of gravity along a face placed by hand: cos 18° is 0.95."""
_OWN = 0.9
"""Share of its own axis in the response of an output: 25° of a hand."""
UNLIKELY = 0.01
"""Probability of a lack of fit below which six faces are not adequate."""


def six_faces(data: Imported, mapping: Mapping) -> FitAnswer:
    """Six labelled faces: the published method, and least squares of all eighteen means with its lack of fit."""
    dwells = imported_dwells(data)
    gravity = gravity_of(mapping)
    up, down, error = _by_face(dwells, mapping)
    published, fit = ferraris(up, down, gravity), faces(up, down, gravity, error)
    per_g = np.linalg.norm(fit.response, axis=1)
    adequate, why = _verdict(fit, per_g * gravity)
    if float(np.max(fit.rms / (per_g * gravity), initial=0.0)) > GROSS or not np.isfinite(fit.rms).all():
        why += _exchanged(up, down, gravity)
    document = {
        "adequate": adequate,
        "reason": why or None,
        "error": {
            "rms_ug": (MICRO * fit.rms / per_g).tolist(),
            "floor_ug": (MICRO * fit.pure_error / per_g).tolist(),
            "p_value": fit.p_value.tolist(),
        },
        "published": {
            "scale_per_m_s2": (np.diagonal(published.scale) / STANDARD_GRAVITY_M_S2).tolist(),
            "rotation": published.rotation.tolist(),
            "bias": published.bias.tolist(),
        },
        "least_squares": {
            "bias": fit.bias.tolist(),
            "bias_error": fit.bias_error.tolist(),
            "response_per_g": fit.response.tolist(),
            "response_error": fit.response_error.tolist(),
            "residuals": fit.residuals.tolist(),
        },
    }
    lines = tuple(_face_line(k, fit, float(published.bias[k]), data.out_unit) for k in range(3))
    lines = (*lines, why) if why else lines
    rows = _face_coefficients(str(dwells["unit"].iloc[0]), fit, data)
    return FitAnswer("faces", adequate, document, lines, rows, MODEL, {"covariance": _covariance(rows)})


def _covariance(rows: list[dict[str, Any]]) -> pd.DataFrame:
    """The covariance of the coefficients as the archive's long table: six opposite faces make them independent of each other."""
    entries: list[dict[str, Any]] = []
    for axis in AXES:
        own = [row for row in rows if row["axis"] == axis]
        for row in range(len(own)):
            for column in range(row + 1):
                square = float(np.nan_to_num(own[row]["standard_error"])) ** 2 if row == column else 0.0
                entries.append({"unit": own[row]["unit"], "axis": axis, "row": row, "column": column, "value": square})
    return pd.DataFrame(entries)


def _verdict(fit: Faces, size: Array) -> tuple[bool | None, str]:
    """Whether the fit describes six faces, and the reason if that cannot be judged or needs no probability.

    Parameters
    ----------
    size : (3,), response of each output to gravity, output unit.
    """
    share = fit.rms / size
    if not bool(np.all(share <= GROSS)):
        worst = float(np.max(share)) if np.isfinite(share).all() else float("nan")
        percent = f"{100.0 * worst:.3g} %"
        return False, f"the faces disagree by {percent} of gravity, far beyond noise; check the labels of the faces"
    passed = passes(fit.p_value, UNLIKELY)
    if passed is not None:
        return passed, ""
    return (
        None,
        "cannot be judged: the noise of the means is unknown; map n, sd_x, sd_y and sd_z, or import the samples",
    )


def _exchanged(up: Array, down: Array, gravity: float) -> str:
    """The two labels whose exchange makes the faces agree; empty where there are none.

    The response has to be that of axes that read themselves, or an exchange of a whole axis would fit as well.
    """
    means = np.concatenate([up, down])
    names = [f"{sign}{axis}" for sign in "+-" for axis in AXES]
    agreeing: list[str] = []
    for one, other in combinations(range(len(names)), 2):
        order = np.arange(len(names))
        order[[one, other]] = order[[other, one]]
        fit = faces(means[order[:3]], means[order[3:]], gravity)
        size = np.linalg.norm(fit.response, axis=1)
        own = np.diagonal(fit.response) / size
        if float(np.max(fit.rms / (size * gravity))) < GROSS and float(np.min(own)) > _OWN:
            agreeing.append(f"{names[one]} and {names[other]}")
    return f"; with {agreeing[0]} exchanged they agree" if len(agreeing) == 1 else ""


def _by_face(dwells: pd.DataFrame, mapping: Mapping) -> tuple[Array, Array, Array]:
    """Means (3, 3) with each axis up and down, and the standard error of a mean by output."""
    faces_there = {mapping.poses.get(str(label), ""): k for k, label in enumerate(dwells["pose"])}
    missing = [face for face in FACES if face not in faces_there]
    if missing or len(dwells) != len(FACES):
        raise DataRejected(
            f"import: {len(dwells)} dwells, faces {', '.join(missing) or 'none'} missing; each of {', '.join(FACES)} is needed "
            "once; name them with --poses LABEL=+x,…"
        )
    means = dwells[list(OUTPUT_COLUMNS)].to_numpy(dtype=np.float64)
    up, down = (means[[faces_there[f"{sign}{axis}"] for axis in AXES]] for sign in "+-")
    if not {*SPREAD_COLUMNS, "n"} <= set(dwells.columns):
        return up, down, np.full(3, np.nan)
    variance = dwells[list(SPREAD_COLUMNS)].to_numpy(dtype=np.float64) ** 2
    return up, down, np.sqrt(np.mean(variance / dwells["n"].to_numpy(dtype=np.float64)[:, None], axis=0))


def _face_line(k: int, fit: Faces, published: float, unit: str) -> str:
    bias = f"{AXES[k]}: bias {fit.bias[k]:.5g} ± {fit.bias_error[k]:.2g} {unit} (published method {published:.5g})"
    misfit = f"lack of fit {fit.rms[k]:.3g}"
    if not np.isfinite(fit.p_value[k]):
        return f"{bias}; {misfit} {unit}"
    return f"{bias}; {misfit}, the samples allow {fit.pure_error[k]:.2g} {unit} (p {equal(fit.p_value[k])})"


def _face_coefficients(unit: str, fit: Faces, data: Imported) -> list[dict[str, Any]]:
    rows: list[dict[str, Any]] = []
    for i in range(3):
        rows.append(bias_row(unit, i, fit.bias[i], fit.bias_error[i], data.out_unit))
        rows += [
            response_row(unit, i, j, fit.response[i, j], fit.response_error[i, j], data.out_unit)
            for j in (i, (i + 1) % 3, (i + 2) % 3)
        ]
    return rows
