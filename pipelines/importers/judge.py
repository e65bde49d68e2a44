"""Fits that need no station: gravity's norm, six faces, a temperature ramp; each with a verdict on its own adequacy."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from scipy.stats import chi2

from inertial.fits.ellipsoid import EllipsoidFit, fit_ellipsoid
from inertial.fits.ferraris import Faces, faces, ferraris
from inertial.fits.polynomial import fit_temperature_curve
from inertial.state import T_REFERENCE
from pipelines.importers.mapping import FACES, Mapping
from schemas.errors import DataRejected, WrongUse
from schemas.units import AXES, MICRO, STANDARD_GRAVITY_M_S2

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from pipelines.importers.record import Imported

NORM_LIMIT = 1e-3
"""| |f| - g | over g at every dwell: the validation limit of the method."""
_UNLIKELY = 0.01


@dataclass(frozen=True)
class Judged:
    """A fit's answer: a document for JSON, lines for people, and coefficients for the archive."""

    method: str
    adequate: bool
    document: dict[str, Any]
    lines: tuple[str, ...]
    coefficients: list[dict[str, Any]] = field(default_factory=list[dict[str, Any]])


def judge(method: str, data: Imported, mapping: Mapping) -> Judged:
    """The fit called `method`, one of `METHODS`, of one unit's import."""
    return METHODS[method](data, mapping)


def norm(data: Imported, mapping: Mapping) -> Judged:
    """Nine parameters from the norm of gravity alone, with an offset per °C where a temperature is mapped.

    Adequate when the norm of every dwell is within 0.1 % of gravity; beside it stand what white noise alone would leave
    and how likely the rest is.
    """
    dwells = _dwells(data)
    gravity = _gravity(mapping)
    output = dwells[["out_x", "out_y", "out_z"]].to_numpy(dtype=np.float64)
    heat = dwells["unit_C"].to_numpy(dtype=np.float64) if "unit_C" in dwells.columns else None
    fit = fit_ellipsoid(output, norm=gravity, temperature=heat)
    six = fit_ellipsoid(output, norm=gravity, temperature=heat, shape="six")
    worst = float(np.max(np.abs(fit.norm_residuals)))
    floor, p_value = _white(dwells, fit)
    adequate = worst <= NORM_LIMIT * gravity
    error = {
        "rms_ug": MICRO * float(fit.rms),
        "mean_abs_ug": MICRO * float(np.mean(np.abs(fit.norm_residuals))),
        "worst_ug": MICRO * worst,
        "six_parameters_rms_ug": MICRO * float(six.rms),
        "floor_ug": None if floor is None else MICRO * floor,
        "p_value": p_value,
    }
    document = {
        "adequate": adequate,
        "error": error,
        "bias": fit.bias.tolist(),
        "response_per_g": fit.response.tolist(),
        "scale_per_m_s2": (fit.scale / STANDARD_GRAVITY_M_S2).tolist(),
        "temperature_offset_per_C": None if heat is None else fit.temperature_offset.tolist(),
        "reference_C": None if heat is None else float(fit.reference_temperature),
    }
    found = f"norm residual {error['rms_ug']:.1f} µg rms, worst {error['worst_ug']:.1f} µg"
    without = f"bias and scale alone leave {error['six_parameters_rms_ug']:.1f}"
    lines = (
        f"nine parameters, {len(dwells)} dwells: {found} (limit {MICRO * NORM_LIMIT * gravity:.0f}); {without}",
        _floor_line(floor, p_value),
        *(_axis_line(k, fit, data.out_unit) for k in range(3)),
    )
    return Judged(
        "norm",
        adequate,
        document,
        tuple(filter(None, lines)),
        _norm_coefficients(str(dwells["unit"].iloc[0]), fit, data),
    )


def six_faces(data: Imported, mapping: Mapping) -> Judged:
    """Six labelled faces: the published method, and least squares of all eighteen means with its lack of fit."""
    dwells = _dwells(data)
    gravity = _gravity(mapping)
    up, down, error = _by_face(dwells, mapping)
    published, found = ferraris(up, down, gravity), faces(up, down, gravity, error)
    adequate = not bool(np.any(found.p_value < _UNLIKELY))
    per_g = np.linalg.norm(found.response, axis=1)
    document = {
        "adequate": adequate,
        "error": {
            "rms_ug": (MICRO * found.rms / per_g).tolist(),
            "floor_ug": (MICRO * found.pure_error / per_g).tolist(),
            "p_value": found.p_value.tolist(),
        },
        "published": {
            "scale_per_m_s2": (np.diagonal(published.scale) / STANDARD_GRAVITY_M_S2).tolist(),
            "rotation": published.rotation.tolist(),
            "bias": published.bias.tolist(),
        },
        "least_squares": {
            "bias": found.bias.tolist(),
            "bias_error": found.bias_error.tolist(),
            "response_per_g": found.response.tolist(),
            "response_error": found.response_error.tolist(),
            "residuals": found.residuals.tolist(),
        },
    }
    lines = tuple(_face_line(k, found, float(published.bias[k]), data.out_unit) for k in range(3))
    return Judged("faces", adequate, document, lines, _face_coefficients(str(dwells["unit"].iloc[0]), found, data))


def ramp(data: Imported, mapping: Mapping) -> Judged:
    """A cubic in temperature of a record in one pose; adequate only if what is left is sample noise."""
    if data.samples is None or "unit_C" not in data.samples.columns:
        message = (
            "import: --fit temperature works on samples with a temperature; map temperature=…, without --rows dwells"
        )
        raise WrongUse(message)
    output = data.samples[list(AXES)].to_numpy(dtype=np.float64)
    fit = fit_temperature_curve(output, data.samples["unit_C"].to_numpy(dtype=np.float64))
    gravity = mapping.norm_g or 1.0
    per_g = {"g": 1.0, "m/s^2": STANDARD_GRAVITY_M_S2}.get(
        data.out_unit, float(np.mean(np.linalg.norm(output, axis=1))) / gravity
    )
    ratio = fit.rms / fit.noise
    document = {
        "adequate": fit.adequate,
        "error": {
            "rms_ug": (MICRO * fit.rms / per_g).tolist(),
            "floor_ug": (MICRO * fit.noise / per_g).tolist(),
            "ratio": ratio.tolist(),
            "p_value": fit.p_value.tolist(),
        },
        "coefficients": fit.coefficients.tolist(),
        "reference_C": fit.reference_temperature,
        "residual_rms": fit.rms.tolist(),
        "noise": fit.noise.tolist(),
    }
    lines = tuple(
        f"{AXES[k]}: a cubic in temperature leaves {fit.rms[k]:.3g} {data.out_unit}, {ratio[k]:.1f} times the noise of a sample "
        f"({fit.noise[k]:.3g}, from first differences)"
        for k in range(3)
    )
    advice = "something other than temperature itself drives this output; look at its rate and lag with 'tumbleline diagnose'"
    return Judged("temperature", fit.adequate, document, lines if fit.adequate else (*lines, advice))


METHODS: dict[str, Callable[[Imported, Mapping], Judged]] = {"norm": norm, "faces": six_faces, "temperature": ramp}


def _dwells(data: Imported) -> pd.DataFrame:
    if data.dwells is None:
        message = "import: nothing stands still in this record, dwells are needed for a fit; record static positions"
        raise DataRejected(message)
    units = len(set(data.dwells["unit"]))
    if units > 1:
        message = f"import: {units} units, a fit at import takes one; use 'tumbleline fit'"
        raise WrongUse(message)
    return data.dwells


def _gravity(mapping: Mapping) -> float:
    if mapping.norm_g is None:
        message = (
            "import: gravity at the place of measurement is needed for this fit and has no default; give --local-g M/S2"
        )
        raise WrongUse(message)
    return mapping.norm_g


def _white(dwells: pd.DataFrame, fit: EllipsoidFit) -> tuple[float | None, float | None]:
    """Root mean square that white noise alone would leave in the norm (g), and the probability of what is left."""
    names = ("sd_x", "sd_y", "sd_z", "n")
    if not all(name in dwells.columns for name in names):
        return None, None
    sd = dwells[list(names[:3])].to_numpy(dtype=np.float64) / np.sqrt(dwells["n"].to_numpy(dtype=np.float64))[:, None]
    force = fit.apply(dwells[["out_x", "out_y", "out_z"]].to_numpy(dtype=np.float64), _heat(dwells))
    direction = force / np.linalg.norm(force, axis=1, keepdims=True)
    error = np.sqrt(np.sum((direction @ fit.correction * sd) ** 2, axis=1))
    statistic = float(np.sum((fit.norm_residuals / error) ** 2))
    return float(np.sqrt(np.mean(error**2))), float(chi2.sf(statistic, fit.dof))


def _heat(dwells: pd.DataFrame) -> NDArray[np.float64] | None:
    return dwells["unit_C"].to_numpy(dtype=np.float64) if "unit_C" in dwells.columns else None


def _by_face(
    dwells: pd.DataFrame, mapping: Mapping
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Means (3, 3) with each axis up and down, and the standard error of a mean by output."""
    faces_there = {mapping.poses.get(str(label), ""): k for k, label in enumerate(dwells["pose"])}
    missing = [face for face in FACES if face not in faces_there]
    if missing or len(dwells) != len(FACES):
        message = (
            f"import: {len(dwells)} dwells, faces {', '.join(missing) or 'none'} missing; each of {', '.join(FACES)} is needed "
            "once; name them with --poses LABEL=+x,…"
        )
        raise DataRejected(message)
    means = dwells[["out_x", "out_y", "out_z"]].to_numpy(dtype=np.float64)
    up, down = (means[[faces_there[f"{sign}{axis}"] for axis in AXES]] for sign in "+-")
    if not {"sd_x", "sd_y", "sd_z", "n"} <= set(dwells.columns):
        return up, down, np.full(3, np.nan)
    variance = dwells[["sd_x", "sd_y", "sd_z"]].to_numpy(dtype=np.float64) ** 2
    return up, down, np.sqrt(np.mean(variance / dwells["n"].to_numpy(dtype=np.float64)[:, None], axis=0))


def _floor_line(floor: float | None, p_value: float | None) -> str:
    if floor is None or p_value is None:
        return ""
    return (
        f"white noise alone would leave {MICRO * floor:.1f} µg (p = {p_value:.1g}); real outputs wander between dwells"
    )


def _axis_line(k: int, fit: EllipsoidFit, unit: str) -> str:
    error = float(np.sqrt(fit.covariance[k, k]))
    scale = fit.scale[k] / STANDARD_GRAVITY_M_S2
    return f"{AXES[k]}: bias {fit.bias[k]:.7g} ± {error:.2g} {unit}, scale {scale:.6g} {unit} per m/s²"


def _face_line(k: int, found: Faces, published: float, unit: str) -> str:
    bias = f"{AXES[k]}: bias {found.bias[k]:.5g} ± {found.bias_error[k]:.2g} {unit} (published method {published:.5g})"
    misfit = f"lack of fit {found.rms[k]:.3g}, the samples allow {found.pure_error[k]:.2g} {unit}"
    return f"{bias}; {misfit} (p = {found.p_value[k]:.1g})"


def _row(unit: str, axis: int, effect: str, name: str, value: float, error: float, text: str) -> dict[str, Any]:
    row = {"unit": unit, "axis": AXES[axis], "effect": effect, "name": name}
    return {**row, "value": float(value), "standard_error": float(error), "unit_text": text}


def _norm_coefficients(unit: str, fit: EllipsoidFit, data: Imported) -> list[dict[str, Any]]:
    """The fit as effects of the catalogue, the bias carried to 25 °C."""
    per_g, rows = f"{data.out_unit}/g", []
    warm = fit.covariance.shape[-1] > 9
    step = T_REFERENCE - float(fit.reference_temperature) if warm else 0.0
    response_error = _response_error(fit)
    for i in range(3):
        var = fit.covariance[i, i]
        if warm:
            var = var + step**2 * fit.covariance[9 + i, 9 + i] + 2.0 * step * fit.covariance[i, 9 + i]
        rows.append(
            _row(unit, i, "bias", "K0", fit.bias[i] + step * fit.temperature_offset[i], np.sqrt(var), data.out_unit)
        )
        rows.append(_row(unit, i, "scale", "K1", fit.response[i, i], response_error[i, i], per_g))
        for j in ((i + 1) % 3, (i + 2) % 3):
            name = f"K{AXES[i]}{AXES[j]}"
            rows.append(_row(unit, i, "misalignment", name, fit.response[i, j], response_error[i, j], per_g))
        if warm:
            error = np.sqrt(fit.covariance[9 + i, 9 + i])
            rows.append(_row(unit, i, "bias_temperature", "kT", fit.temperature_offset[i], error, f"{data.out_unit}/K"))
    return rows


def _response_error(fit: EllipsoidFit) -> NDArray[np.float64]:
    """Standard errors (3, 3) of K from those of C: dK = -K dC K."""
    upper = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
    k = fit.response
    rows = np.stack([-np.outer(k[:, i], k[j, :]).ravel() for i, j in upper], axis=1)
    return np.sqrt(np.einsum("ap,pq,aq->a", rows, fit.covariance[3:9, 3:9], rows)).reshape(3, 3)


def _face_coefficients(unit: str, found: Faces, data: Imported) -> list[dict[str, Any]]:
    per_g, rows = f"{data.out_unit}/g", []
    for i in range(3):
        rows.append(_row(unit, i, "bias", "K0", found.bias[i], found.bias_error[i], data.out_unit))
        rows.append(_row(unit, i, "scale", "K1", found.response[i, i], found.response_error[i, i], per_g))
        for j in ((i + 1) % 3, (i + 2) % 3):
            name = f"K{AXES[i]}{AXES[j]}"
            rows.append(_row(unit, i, "misalignment", name, found.response[i, j], found.response_error[i, j], per_g))
    return rows
