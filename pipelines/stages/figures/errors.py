"""Figures of what a calibration leaves: residual of the fit, errors of verification, error over the period of validity."""

import numpy as np
from scipy.special import ndtri

from pipelines.stages.figures.base import FigureKind, UnitTables, Value
from pipelines.tables.frames import UnitRows
from schemas.decisions import BOUND, LARGEST_ERROR, MEDIAN
from schemas.recipe import Recipe
from schemas.units import AXES

ALARM = 0.01  # probability that a good unit shows an error beyond what the uncertainty allows


def rms(errors: np.ndarray) -> Value:
    """Root mean square of n normal values, with its standard uncertainty rms/√(2n)."""
    value = float(np.sqrt(np.mean(errors**2)))
    return Value(value, value / np.sqrt(2.0 * errors.size))


def _largest_error(rows: UnitRows, uncertainty: str, guard: float) -> Value:
    """The error that is closest to a limit under a guard band, as a magnitude."""
    errors, spread = rows["error_ug"], rows[uncertainty]
    worst = int(np.argmax(np.abs(errors) + guard * spread))
    return Value(abs(float(errors[worst])), float(spread[worst]))


def _with_references(shown: Value, shared: float) -> Value:
    """A figure with its uncertainty for the user: that of the verification, and that of the references."""
    return shown._replace(uncertainty=float(np.hypot(shown.uncertainty, shared)), shared=shared)


def _norm(tables: UnitTables) -> Value | None:
    if not len(tables.verification):
        return None
    shown = _largest_error(tables.verification_poses, "uncertainty_ug", tables.guard)
    return _with_references(shown, tables.stated_u("verification_norm", "norm"))


def _dwell(tables: UnitTables) -> Value | None:
    """The wander of the device is part of a single dwell's value; the noise of the reading is its uncertainty."""
    return _largest_error(tables.verification, "reading_ug", tables.guard) if len(tables.verification) else None


def _ratio(tables: UnitTables) -> Value | None:
    """The allowed error is the two-sided quantile of a normal distribution, 1 % shared by all dwells."""
    rows = tables.verification
    if not len(rows):
        return None
    quantile = -float(ndtri(0.5 * ALARM / len(rows)))
    return Value(float(np.max(np.abs(rows["error_ug"]) / (quantile * rows["uncertainty_ug"]))), 0.0)


def _bias_error(tables: UnitTables) -> Value | None:
    """RMS error of the worst axis, with the uncertainty of the verification's covariance.

    See :func:`pipelines.stages.rms_error.rms_uncertainty`. Runs of earlier versions have the uncertainty of white noise alone.
    """
    rows = tables.verification
    if not len(rows):
        return None
    values: list[Value] = []
    for axis in AXES:
        if f"error_{axis}_ug" in rows:
            name, shown = f"rms_uncertainty_{axis}_ug", rms(rows[f"error_{axis}_ug"])
            shown = shown._replace(uncertainty=float(rows[name][0])) if name in rows else shown
            values.append(_with_references(shown, tables.stated_u("bias_error", axis)))
    return max(values, key=lambda value: value.reach(tables.guard))


def _over_period(tables: UnitTables) -> Value | None:
    if (LARGEST_ERROR, BOUND) not in tables.budget:
        return None
    bound, median = (tables.budget[LARGEST_ERROR, name].value for name in (BOUND, MEDIAN))
    return Value(bound, 0.0, median=median)


def _verification_poses(recipe: Recipe) -> str:
    return "" if recipe.verification else "verification poses"


def _stability(recipe: Recipe) -> str:
    stated = getattr(recipe, "stability", None) is not None
    return _verification_poses(recipe) or (
        "" if stated else "[stability] of the device, and [uncertainty] of the station"
    )


FIGURES = (
    FigureKind(
        name="residual_rms_ug",
        unit="µg",
        meaning="Residual of the fit: root mean square over the dwells and axes of the fit.",
        label="rms residual of the fit",
        order=10,
        value=lambda tables: rms(tables.residuals["residual_ug"]),
    ),
    FigureKind(
        name="verification_norm_ug",
        unit="µg",
        meaning="Largest error of |a|, the magnitude of gravity (of a device with fewer axes, along them), in a pose not used by "
        "the fit, mean over the dwells of the pose; of its worst soak where its error is not the same at all temperatures.",
        label="largest error of |a| in a pose not used, mean of its dwells",
        order=20,
        value=_norm,
        missing=_verification_poses,
    ),
    FigureKind(
        name="verification_dwell_ug",
        unit="µg",
        meaning="Largest error of |a| (of a device with fewer axes, along them) in a single dwell of verification.",
        label="largest error of |a| in a single dwell there",
        order=30,
        value=_dwell,
        missing=_verification_poses,
    ),
    FigureKind(
        name="verification_ratio",
        unit="1",
        meaning="Largest error of verification over the error that its uncertainty allows.",
        label="largest error over what the uncertainty allows",
        order=40,
        value=_ratio,
        missing=_verification_poses,
    ),
    FigureKind(
        name="bias_error_ug",
        unit="µg",
        meaning="Error of the worst axis on poses not used by the fit, root mean square.",
        label="rms error of the worst axis on poses not used",
        order=50,
        value=_bias_error,
        missing=_verification_poses,
    ),
    FigureKind(
        name="bias_error_period_ug",
        unit="µg",
        meaning="95 % bound of the largest axis' RMS error in a use at the end of the period: run, references, walk, switch-on, "
        "ageing.",
        label="95 % bound of the largest rms error of an axis at the end of the period of validity",
        order=55,
        value=_over_period,
        missing=_stability,
    ),
)
