"""Gravity's norm: nine parameters of an ellipsoid, poses unknown."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.stats import chi2

from inertial.fits.ellipsoid import EllipsoidFit, fit_ellipsoid
from inertial.fits.wander import student
from inertial.noise.measurands import of_a_day
from inertial.state import T_REFERENCE
from pipelines.importers.judged import FitAnswer, coefficient, dwells_of, gravity_of
from schemas.units import AXES, MICRO, STANDARD_GRAVITY_M_S2

if TYPE_CHECKING:
    import pandas as pd
    from numpy.typing import NDArray

    from pipelines.importers.mapping import Mapping
    from pipelines.importers.record import Imported

NORM_LIMIT = 1e-3
"""| |f| - g | over g at every dwell: the validation limit of the method."""

COVERAGE = 2.0
SLOWEST = 4.0  # of the flicker's time constants, over the record, in :func:`inertial.criticism.noise.flicker_kernel`

OUT = ["out_x", "out_y", "out_z"]


def norm(data: Imported, mapping: Mapping) -> FitAnswer:
    """Nine parameters from the norm of gravity alone, with an offset per °C where a temperature is mapped.

    Adequate when the norm of every dwell is within 0.1 % of gravity; beside it stand what white noise alone would leave
    and how likely the rest is.
    """
    dwells = dwells_of(data)
    gravity = gravity_of(mapping)
    output = dwells[OUT].to_numpy(dtype=np.float64)
    heat = _heat(dwells)
    plain = fit_ellipsoid(output, norm=gravity, temperature=heat)
    time = dwells["time_s"].to_numpy(dtype=np.float64)
    fit = fit_ellipsoid(output, norm=gravity, temperature=heat, time=time, error=_norm_error(dwells, plain))
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
        "dof": fit.dof,
        "coverage_factor": COVERAGE,
    }
    document = {
        "adequate": adequate,
        "error": error,
        "bias": fit.bias.tolist(),
        "bias_u_record": _bias_error(fit).tolist(),
        "bias_u_day": None if fit.flicker is None else _of_a_day(fit, time).tolist(),
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
        *(_axis_line(k, fit, _of_a_day(fit, time), data.out_unit) for k in range(3)),
    )
    return FitAnswer(
        "norm",
        adequate,
        document,
        tuple(filter(None, lines)),
        _norm_coefficients(str(dwells["unit"].iloc[0]), fit, data),
    )


def _norm_error(dwells: pd.DataFrame, fit: EllipsoidFit) -> NDArray[np.float64] | None:
    """White standard error of the norm of every dwell (n,), g; None where the samples' scatter is not known."""
    names = ("sd_x", "sd_y", "sd_z", "n")
    if not all(name in dwells.columns for name in names):
        return None
    sd = dwells[list(names[:3])].to_numpy(dtype=np.float64) / np.sqrt(dwells["n"].to_numpy(dtype=np.float64))[:, None]
    force = fit.apply(dwells[OUT].to_numpy(dtype=np.float64), _heat(dwells))
    direction = force / np.linalg.norm(force, axis=1, keepdims=True)
    error = np.sqrt(np.sum((direction @ fit.correction * sd) ** 2, axis=1))
    return error if np.all(np.isfinite(error) & (error > 0.0)) else None


def _white(dwells: pd.DataFrame, fit: EllipsoidFit) -> tuple[float | None, float | None]:
    """Root mean square that white noise alone would leave in the norm (g), and the probability of what is left."""
    error = _norm_error(dwells, fit)
    if error is None:
        return None, None
    statistic = float(np.sum((fit.norm_residuals / error) ** 2))
    return float(np.sqrt(np.mean(error**2))), float(chi2.sf(statistic, fit.dof))


def _heat(dwells: pd.DataFrame) -> NDArray[np.float64] | None:
    return dwells["unit_C"].to_numpy(dtype=np.float64) if "unit_C" in dwells.columns else None


def _floor_line(floor: float | None, p_value: float | None) -> str:
    if floor is None or p_value is None:
        return ""
    return (
        f"white noise alone would leave {MICRO * floor:.1f} µg (p = {p_value:.1g}); real outputs wander between dwells"
    )


def _bias_error(fit: EllipsoidFit) -> NDArray[np.float64]:
    """Standard uncertainty (3,) of the bias as the mean of the record, output unit."""
    return np.sqrt(np.diagonal(fit.covariance)[:3])


def _of_a_day(fit: EllipsoidFit, time: NDArray[np.float64]) -> NDArray[np.float64]:
    """Standard uncertainty (3,) of the bias as the mean of the day after the record, output unit."""
    wander = float(fit.flicker) * np.abs(fit.scale) if fit.flicker is not None else np.full(3, np.nan)
    return of_a_day(_bias_error(fit), wander, time, slowest=SLOWEST, widened=student(fit.dof))


def _axis_line(k: int, fit: EllipsoidFit, day: NDArray[np.float64], unit: str) -> str:
    record, long = (COVERAGE * float(one[k]) for one in (_bias_error(fit), day))
    later = (
        "white noise only: too many dwells to estimate wander"
        if fit.flicker is None
        else f"± {long:.2g} over the next day"
    )
    return (
        f"{AXES[k]}: bias {fit.bias[k]:.7g} ± {record:.2g} {unit} over the record ({later}; k = {COVERAGE:g}), "
        f"scale {fit.scale[k] / STANDARD_GRAVITY_M_S2:.6g} {unit} per m/s²"
    )


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
            coefficient(
                unit, i, "bias", "K0", fit.bias[i] + step * fit.temperature_offset[i], np.sqrt(var), data.out_unit
            )
        )
        rows.append(coefficient(unit, i, "scale", "K1", fit.response[i, i], response_error[i, i], per_g))
        for j in ((i + 1) % 3, (i + 2) % 3):
            name = f"K{AXES[i]}{AXES[j]}"
            rows.append(coefficient(unit, i, "misalignment", name, fit.response[i, j], response_error[i, j], per_g))
        if warm:
            error = np.sqrt(fit.covariance[9 + i, 9 + i])
            rows.append(
                coefficient(unit, i, "bias_temperature", "kT", fit.temperature_offset[i], error, f"{data.out_unit}/K")
            )
    return rows


def _response_error(fit: EllipsoidFit) -> NDArray[np.float64]:
    """Standard errors (3, 3) of K from those of C: dK = -K dC K."""
    upper = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
    k = fit.response
    rows = np.stack([-np.outer(k[:, i], k[j, :]).ravel() for i, j in upper], axis=1)
    return np.sqrt(np.einsum("ap,pq,aq->a", rows, fit.covariance[3:9, 3:9], rows)).reshape(3, 3)
