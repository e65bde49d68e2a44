"""Figures of merit of a calibrated unit, each with its standard uncertainty: what limits are applied to."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.stats import norm

from pipelines.rows import rows_of
from pipelines.stages.noise import B_BOUND

if TYPE_CHECKING:
    from collections.abc import Iterator

    import pandas as pd
    from numpy.typing import NDArray

    from pipelines.stages.calibration import Calibration

AXES = ("x", "y", "z")
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

    residuals: pd.DataFrame
    verification: pd.DataFrame
    verification_poses: pd.DataFrame
    noise: pd.DataFrame


def figures_of(unit: str, calibration: Calibration, tables: UnitTables, zero_g: float) -> Iterator[Figure]:
    """Every figure that the tables of one unit allow.

    Parameters
    ----------
    zero_g : nominal output at 0 g, output unit.
    """
    yield _rms("residual_rms_ug", tables.residuals["residual_ug"].to_numpy())
    if len(tables.verification):
        yield _largest("verification_norm_ug", tables.verification_poses, "uncertainty_ug")
        yield from _verification(tables.verification)
    yield from _coefficients(calibration, calibration.units.index(unit), zero_g)
    if len(tables.noise):
        yield from _noise(tables.noise)


def _rms(name: str, errors: NDArray[np.float64]) -> Figure:
    """Root mean square, with the standard uncertainty rms/√(2n) of one from n normal values."""
    value = float(np.sqrt(np.mean(errors**2)))
    return Figure(name, value, value / np.sqrt(2.0 * errors.size))


def _largest(name: str, rows: pd.DataFrame, uncertainty: str) -> Figure:
    """The error that comes closest to any limit under a guard band of twice its uncertainty, as a magnitude."""
    errors, spread = rows["error_ug"].to_numpy(), rows[uncertainty].to_numpy()
    worst = int(np.argmax(np.abs(errors) + GUARD * spread))
    return Figure(name, abs(float(errors[worst])), float(spread[worst]))


def _verification(rows: pd.DataFrame) -> Iterator[Figure]:
    """The largest error of the norm in one dwell, the largest against what is expected, and the RMS error by axis.

    What a single dwell shows includes what the device wandered: that is its value, and the noise of the reading its
    uncertainty. The ratio is to the two-sided quantile of a normal distribution, 1 % shared by all dwells.
    """
    yield _largest("verification_dwell_ug", rows, "reading_ug")
    quantile = float(norm.isf(0.5 * ALARM / len(rows)))
    allowed = np.max(np.abs(rows["error_ug"].to_numpy()) / (quantile * rows["uncertainty_ug"].to_numpy()))
    yield Figure("verification_ratio", float(allowed), 0.0)
    by_axis = [_rms("bias_error_ug", rows[f"error_{axis}_ug"].to_numpy()) for axis in AXES]
    yield max(by_axis, key=lambda figure: figure.value)


def _coefficients(calibration: Calibration, u: int, zero_g: float) -> Iterator[Figure]:
    scale = np.abs(np.diagonal(calibration.response[u]))[:, None]
    plans = (
        ("zero_g_offset_mg", "bias", 1e3, zero_g),
        ("misalignment_mrad", "misalignment", 1e3, 0.0),
        ("bias_temperature_ug_K", "bias_temperature", 1e6, 0.0),
        ("scale_temperature_ppm_K", "scale_temperature", 1e6, 0.0),
    )
    for name, effect, factor, nominal in plans:
        values = factor * (calibration.value(effect)[u] - nominal) / scale
        if values.size:
            errors = factor * calibration.standard_error(effect)[u] / scale
            place = np.unravel_index(int(np.argmax(np.abs(values))), values.shape)
            yield Figure(name, float(values[place]), float(errors[place]))


def _noise(rows: pd.DataFrame) -> Iterator[Figure]:
    """Noise figures of the worst axis; a term that is not identified counts with its upper limit."""
    terms = (("velocity_random_walk_ug_rtHz", "N"), ("bias_instability_ug", "B"), ("rate_random_walk_ug_rts", "K"))
    for name, symbol in terms:
        found = [_noise_term(name, row, rows) for row in rows_of(rows[rows["term"] == symbol])]
        yield max(found, key=lambda figure: figure.value)


def _noise_term(name: str, row: dict, rows: pd.DataFrame) -> Figure:
    if row["identified"]:
        return Figure(name, row["value"], (row["high"] - row["low"]) / (2.0 * NORMAL_95))
    limit = row["high"]
    if row["term"] == "B":  # two upper bounds: the smaller holds
        bound = rows[(rows["term"] == B_BOUND) & (rows["axis"] == row["axis"])]["high"]
        limit = min(limit, float(bound.iloc[0]))
    return Figure(name, limit, 0.0)
