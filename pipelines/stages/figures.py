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
GUARD = 2.0
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
    """Value and standard uncertainty of one figure of one unit, in the figure's unit."""

    name: str
    value: float
    uncertainty: float


class UnitTables(NamedTuple):
    """The rows of one unit in the tables that figures are made from."""

    residuals: UnitRows
    verification: UnitRows
    verification_poses: UnitRows
    noise: UnitRows


def figures_of(tables: UnitTables, coefficients: Sequence[Figure]) -> Iterator[Figure]:
    """Every figure that the tables of one unit allow.

    Parameters
    ----------
    coefficients : figures of the unit's coefficients, from :func:`coefficient_figures`.
    """
    yield _rms("residual_rms_ug", tables.residuals["residual_ug"])
    if len(tables.verification):
        yield _largest("verification_norm_ug", tables.verification_poses, "uncertainty_ug")
        yield from _verification(tables.verification)
    yield from coefficients
    if len(tables.noise):
        yield from _noise(tables.noise)


def _rms(name: str, errors: NDArray[np.float64]) -> Figure:
    """Root mean square, with the standard uncertainty rms/√(2n) of one from n normal values."""
    value = float(np.sqrt(np.mean(errors**2)))
    return Figure(name, value, value / np.sqrt(2.0 * errors.size))


def _largest(name: str, rows: UnitRows, uncertainty: str) -> Figure:
    """The error that comes closest to any limit under a guard band of twice its uncertainty, as a magnitude."""
    errors, spread = rows["error_ug"], rows[uncertainty]
    worst = int(np.argmax(np.abs(errors) + GUARD * spread))
    return Figure(name, abs(float(errors[worst])), float(spread[worst]))


def _verification(rows: UnitRows) -> Iterator[Figure]:
    """The largest error of the norm in one dwell, the largest against what is expected, and the RMS error by axis.

    What a single dwell shows includes what the device wandered: that is its value, and the noise of the reading its
    uncertainty. The ratio is to the two-sided quantile of a normal distribution, 1 % shared by all dwells.
    """
    yield _largest("verification_dwell_ug", rows, "reading_ug")
    quantile = -float(ndtri(0.5 * ALARM / len(rows)))
    allowed = np.max(np.abs(rows["error_ug"]) / (quantile * rows["uncertainty_ug"]))
    yield Figure("verification_ratio", float(allowed), 0.0)
    by_axis = [_rms("bias_error_ug", rows[f"error_{axis}_ug"]) for axis in AXES]
    yield max(by_axis, key=lambda figure: figure.value)


def coefficient_figures(calibration: Calibration, zero_g: float) -> list[list[Figure]]:
    """The figures of the coefficients of every unit: of each effect the largest.

    Parameters
    ----------
    zero_g : nominal output at 0 g, output unit.
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
            for own, place, value, error in zip(found, np.argmax(np.abs(values), axis=1), values, errors, strict=True):
                own.append(Figure(name, float(value[place]), float(error[place])))
    return found


def _noise(rows: UnitRows) -> Iterator[Figure]:
    """Noise figures of the worst axis; a term that is not identified counts with its upper limit."""
    terms = (("velocity_random_walk_ug_rtHz", "N"), ("bias_instability_ug", "B"), ("rate_random_walk_ug_rts", "K"))
    for name, symbol in terms:
        found = [_noise_term(name, place, rows) for place in np.flatnonzero(rows["term"] == symbol).tolist()]
        yield max(found, key=lambda figure: figure.value)


def _noise_term(name: str, place: int, rows: UnitRows) -> Figure:
    value, low, high = (float(rows[column][place]) for column in ("value", "low", "high"))
    if rows["identified"][place]:
        return Figure(name, value, (high - low) / (2.0 * NORMAL_95))
    if rows["term"][place] == "B":  # two upper bounds: the smaller holds
        bound = rows["high"][(rows["term"] == B_BOUND) & (rows["axis"] == rows["axis"][place])]
        return Figure(name, min(high, float(bound[0])), 0.0)
    return Figure(name, high, 0.0)
