"""Figures of merit of a calibrated unit, each with its standard uncertainty: what limits are applied to."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.special import ndtri

from pipelines.stages.noise import B_BOUND
from schemas.units import AXES

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from numpy.typing import NDArray

    from pipelines.tables.calibration import Calibration
    from pipelines.tables.frames import UnitRows

NORMAL_95 = 1.959964
ALARM = 0.01  # probability that a good unit shows an error beyond what the uncertainty allows
NEEDS_STATIC = ("velocity_random_walk_ug_rtHz", "bias_instability_ug", "rate_random_walk_ug_rts")
NEEDS_VERIFICATION = ("verification_norm_ug", "verification_dwell_ug", "verification_ratio", "bias_error_ug")
NEEDS_EFFECT = {
    "bias_temperature_ug_K": "bias_temperature",
    "scale_temperature_ppm_K": "scale_temperature",
    "misalignment_mrad": "misalignment",
    "zero_g_offset_mg": "bias",
}


class Figure(NamedTuple):
    """Value and standard uncertainty of one figure of one unit, in the figure's unit.

    why_not : why there is no value, where there is none; the value is then infinite and passes no limit
    """

    name: str
    value: float
    uncertainty: float
    why_not: str = ""

    def reach(self, guard: float) -> float:
        """Magnitude with the guard band: what comes nearest to a limit."""
        return abs(self.value) + guard * self.uncertainty


class UnitTables(NamedTuple):
    """The rows of one unit in the tables that figures are made from."""

    residuals: UnitRows
    verification: UnitRows
    verification_poses: UnitRows
    noise: UnitRows


def figures_of(tables: UnitTables, coefficients: Sequence[Figure], guard: float) -> Iterator[Figure]:
    """Every figure that the tables of one unit allow.

    Parameters
    ----------
    coefficients : figures of the unit's coefficients, from :func:`coefficient_figures`.
    guard : width of the guard band in standard uncertainties, zero under simple acceptance; of several axes, poses or
        coefficients the one that comes nearest to a limit with it is judged
    """
    yield _rms("residual_rms_ug", tables.residuals["residual_ug"])
    if len(tables.verification):
        yield _largest("verification_norm_ug", tables.verification_poses, "uncertainty_ug", guard)
        yield from _verification(tables.verification, guard)
    yield from coefficients
    if len(tables.noise):
        yield from _noise(tables.noise, guard)


def _rms(name: str, errors: NDArray[np.float64]) -> Figure:
    """Root mean square, with the standard uncertainty rms/√(2n) of one from n normal values."""
    value = float(np.sqrt(np.mean(errors**2)))
    return Figure(name, value, value / np.sqrt(2.0 * errors.size))


def _largest(name: str, rows: UnitRows, uncertainty: str, guard: float) -> Figure:
    """The error that comes closest to any limit under a guard band, as a magnitude."""
    errors, spread = rows["error_ug"], rows[uncertainty]
    worst = int(np.argmax(np.abs(errors) + guard * spread))
    return Figure(name, abs(float(errors[worst])), float(spread[worst]))


def _verification(rows: UnitRows, guard: float) -> Iterator[Figure]:
    """The largest error of the norm in one dwell, the largest against what is expected, and the RMS error by axis.

    What a single dwell shows includes what the device wandered: that is its value, and the noise of the reading its
    uncertainty. The ratio is to the two-sided quantile of a normal distribution, 1 % shared by all dwells. The uncertainty of the
    RMS error is that of the verification's covariance, :func:`pipelines.stages.rms_error.rms_uncertainty`.
    """
    yield _largest("verification_dwell_ug", rows, "reading_ug", guard)
    quantile = -float(ndtri(0.5 * ALARM / len(rows)))
    allowed = np.max(np.abs(rows["error_ug"]) / (quantile * rows["uncertainty_ug"]))
    yield Figure("verification_ratio", float(allowed), 0.0)
    yield max((_bias_error(rows, axis) for axis in AXES), key=lambda figure: figure.reach(guard))


def _bias_error(rows: UnitRows, axis: str) -> Figure:
    """RMS error of one axis; runs of before have no covariance of it, and their uncertainty is that of white noise."""
    name, plain = f"rms_uncertainty_{axis}_ug", _rms("bias_error_ug", rows[f"error_{axis}_ug"])
    return plain._replace(uncertainty=float(rows[name][0])) if name in rows else plain


def coefficient_figures(calibration: Calibration, zero_g: float, guard: float) -> list[list[Figure]]:
    """The figures of the coefficients of every unit: of each effect the one nearest to a limit, its guard band included.

    Parameters
    ----------
    zero_g : nominal output at 0 g, output unit.
    guard : width of the guard band in standard uncertainties, zero under simple acceptance.
    """
    scale = np.abs(np.diagonal(calibration.response, axis1=-2, axis2=-1))[..., None]
    plans = (
        ("zero_g_offset_mg", "bias", 1e3, zero_g),
        ("misalignment_mrad", "misalignment", 1e3, 0.0),
        ("bias_temperature_ug_K", "bias_temperature", 1e6, 0.0),
        ("scale_temperature_ppm_K", "scale_temperature", 1e6, 0.0),
    )
    found: list[list[Figure]] = [[] for _ in calibration.units]
    for name, effect, factor, nominal in plans:
        units = len(calibration.units)
        values = (factor * (calibration.value(effect) - nominal) / scale).reshape(units, -1)
        if values.size:
            errors = (factor * calibration.standard_error(effect) / scale).reshape(units, -1)
            nearest = np.argmax(np.abs(values) + guard * errors, axis=1)
            for own, place, value, error in zip(found, nearest, values, errors, strict=True):
                own.append(Figure(name, float(value[place]), float(error[place])))
    return found


def _noise(rows: UnitRows, guard: float) -> Iterator[Figure]:
    """Noise figures of the worst axis; a term that is not identified counts with its upper limit.

    A silent axis has no figure, and so the unit has none: what was not measured is not within a limit.
    """
    terms = (("velocity_random_walk_ug_rtHz", "N"), ("bias_instability_ug", "B"), ("rate_random_walk_ug_rts", "K"))
    for name, symbol in terms:
        found = [_noise_term(name, place, rows) for place in np.flatnonzero(rows["term"] == symbol).tolist()]
        yield max(found, key=lambda figure: figure.reach(guard))


def _noise_term(name: str, place: int, rows: UnitRows) -> Figure:
    value, low, high = (float(rows[column][place]) for column in ("value", "low", "high"))
    axis = rows["axis"][place]
    if rows["identified"][place]:
        return Figure(name, value, (high - low) / (2.0 * NORMAL_95))
    if rows["term"][place] == "B":  # two upper bounds: the smaller holds
        bound = rows["high"][(rows["term"] == B_BOUND) & (rows["axis"] == axis)]
        high = float(np.fmin(high, bound[0]))
    if not np.isfinite(high):
        why = str(rows["note"][place]) if "note" in rows else "no upper limit"
        return Figure(name, np.inf, 0.0, f"axis {axis}: {why}")
    return Figure(name, high, 0.0)
