"""A recording turned about one axis of the sensor: bias, scale and misalignment of the axes in the plane."""

from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from inertial.arrays import Array
from inertial.counts import number_of
from inertial.errors import NotIdentified
from inertial.fits.plane import FEWEST_DOF, PlaneFit, fit_plane, fit_plane_norm, inside_of, plane_across, quiet_axis
from inertial.probability import passes
from inertial.quantities import OUTPUT_COLUMNS, SPREAD_COLUMNS
from inertial.uncertainty.rounding import equal
from pipelines.importers.judged import FitAnswer, gravity_of, imported_dwells
from pipelines.importers.mapping import Mapping
from pipelines.tables.dwells import measured
from schemas.errors import DataRejected
from schemas.units import AXES, MICRO, STANDARD_GRAVITY_M_S2

if TYPE_CHECKING:
    from pipelines.importers.record import Imported

OUT, SPREAD = list(OUTPUT_COLUMNS), list(SPREAD_COLUMNS)
FEWEST = 4
UNLIKELY = 0.05
SHOWN_DOF = 4
"""Degrees of freedom from which an ellipse shows a turn where poses are not known.

With fewer, outputs of any poses lie on one by chance: 1 to 6 of 100 records with a dead axis.
"""
GROSS = 0.02
"""Residual per degree of freedom, g, above which the dwells lie in no plane, or the model is wrong however few they are."""


def known_force(dwells: pd.DataFrame) -> Array | None:
    """The force (n, 3), g, of the first unit's dwells with known poses; None where they are not known."""
    measurement = measured(dwells)
    return None if measurement.reference == "norm" else measurement.state.force[0]


def axis_of_plane(dwells: pd.DataFrame) -> int | None:
    """The axis that a sensor was turned about alone, by its poses or, where these are not known, its outputs; else None."""
    if len(dwells) < FEWEST or len(set(dwells["unit"])) != 1 or not set(OUT) <= set(dwells.columns):
        return None
    force = known_force(dwells)
    return quiet_axis(dwells[OUT].to_numpy(dtype=np.float64)) if force is None else plane_across(force)


def plane(data: "Imported", mapping: Mapping) -> FitAnswer:
    """The answer of ``import --fit plane``, with known poses or by the norm of gravity."""
    dwells = imported_dwells(data)
    across = axis_of_plane(dwells)
    if across is None:
        raise DataRejected(
            "import: the poses lie in no plane across an axis of the sensor, one axis of rotation along x, y or z is needed for "
            "--fit plane; use --fit norm, or mount the sensor with an axis along that of the table"
        )
    return plane_answer(dwells, across, _gravity(dwells, mapping), data.out_unit)


def _gravity(dwells: pd.DataFrame, mapping: Mapping) -> float:
    """Local gravity, g, which is needed only where the poses are not known."""
    return gravity_of(mapping) if known_force(dwells) is None else 1.0


def shown_turn(data: "Imported", mapping: Mapping) -> FitAnswer | None:
    """The answer of a sensor that was turned about its quiet axis; None where its outputs do not show that it was.

    The norm of the two other axes is that of gravity in a turn. About a dead axis it is not, for the missing part changes.
    """
    dwells = imported_dwells(data)
    across = axis_of_plane(dwells)
    if across is None:
        return None
    try:
        fit = _fitted(dwells, across, _gravity(dwells, mapping))
    except DataRejected:
        return None
    enough = known_force(dwells) is not None or fit.dof >= SHOWN_DOF
    return _answer(fit, dwells, data.out_unit) if enough and fit.misfit < GROSS else None


def plane_answer(dwells: pd.DataFrame, across: int, gravity: float, out_unit: str) -> FitAnswer:
    """The fit with its verdict.

    Parameters
    ----------
    across : axis of the sensor across the plane; gravity : g, read where the poses are not known

    Raises
    ------
    DataRejected
        Too few dwells, or outputs that lie on no ellipse.
    """
    return _answer(_fitted(dwells, across, gravity), dwells, out_unit)


def _fitted(dwells: pd.DataFrame, across: int, gravity: float) -> PlaneFit:
    output = dwells[OUT].to_numpy(dtype=np.float64)
    time = dwells["time_s"].to_numpy(dtype=np.float64)
    error = _errors(dwells, output)
    force = known_force(dwells)
    try:
        if force is None:
            return fit_plane_norm(output, across, gravity, time, error)
        return fit_plane(output, force, across, time, error)
    except NotIdentified as problem:
        raise DataRejected(f"import: {problem}") from None


def _answer(fit: PlaneFit, dwells: pd.DataFrame, out_unit: str) -> FitAnswer:
    known = known_force(dwells) is not None
    adequate, reason = _verdict(fit)
    opened = _opened(fit, known=known)
    document = {
        "adequate": adequate,
        "reason": reason or None,
        "across": AXES[fit.across],
        "open": opened,
        "error": {"rms_ug": MICRO * fit.rms, "p_value": fit.p_value, "dof": fit.dof, "coverage_factor": 2.0},
        "bias": fit.bias.tolist(),
        "bias_u": fit.bias_error.tolist(),
        "response_per_g": fit.response.tolist(),
        "response_u": fit.response_error.tolist(),
    }
    lines = [_head(fit), *(_line(fit, k, out_unit) for k in (*fit.inside, fit.across)), f"open: {'; '.join(opened)}"]
    lines += [reason] if reason else []
    rows = _rows(fit, str(dwells["unit"].iloc[0]), out_unit, known=known)
    return FitAnswer("plane", adequate, document, tuple(lines), rows)


def _errors(dwells: pd.DataFrame, output: Array) -> Array:
    """White standard errors (n, 3), output unit: sd/√n where recorded, else alike."""
    alike = np.full(output.shape, 1e-6 * float(np.ptp(output)))
    if not {*SPREAD, "n"} <= set(dwells.columns):
        return alike
    errors = dwells[SPREAD].to_numpy(dtype=np.float64) / np.sqrt(dwells["n"].to_numpy(dtype=np.float64))[:, None]
    typical = np.median(errors, axis=0)
    if not np.all(typical > 0.0):
        return alike
    return np.clip(np.where(np.isfinite(errors), errors, typical), typical / 20.0, typical * 20.0)


def _verdict(fit: PlaneFit) -> tuple[bool | None, str]:
    """Whether the model describes the dwells, by harmonics of the angle beside it; None where this cannot be judged."""
    if fit.misfit > GROSS:
        percent = f"{100.0 * fit.misfit:.3g} %"
        return False, f"the residual is {percent} of gravity: the poses lie in no plane, or an axis is dead"
    if fit.dof < FEWEST_DOF:
        return None, (
            f"cannot be judged: {number_of(fit.dof, 'degree')} of freedom, {FEWEST_DOF} are needed; measure "
            f"{number_of(FEWEST_DOF - fit.dof, 'more pose')}"
        )
    passed = passes(fit.p_value, UNLIKELY)
    if passed is None:
        return None, "cannot be judged: the probability of the residuals is no number; add poses"
    reason = "" if passed else "the residual follows harmonics of the angle, as a second- or third-order term does"
    return passed, reason


def _opened(fit: PlaneFit, *, known: bool) -> list[str]:
    """Quantities that a turn about one axis does not determine."""
    y = AXES[fit.across]
    i, j = (AXES[k] for k in fit.inside)
    parts = [
        f"scale of {y}",
        f"response of {i} and {j} to {y}",
        f"bias of {y} apart from the tilt of the axis of rotation (1 mrad is 1 mg)",
        "third-order terms apart from the scale, beyond 1 g",
    ]
    if not known:
        parts.append(f"rotation of {i} and {j} together about {y}")
    return parts


def _head(fit: PlaneFit) -> str:
    i, j = (AXES[k] for k in fit.inside)
    p = f"harmonics of the angle: p {equal(fit.p_value)}"
    axes = f"turned about {AXES[fit.across]}: {i} and {j} are calibrated in their plane"
    return f"{axes}; residual {MICRO * fit.rms:.1f} µg rms, {p}"


def _line(fit: PlaneFit, axis: int, unit: str) -> str:
    i, j = fit.inside
    bias = f"{AXES[axis]}: bias {fit.bias[axis]:.7g} ± {2.0 * fit.bias_error[axis]:.2g} {unit} (k = 2)"
    if axis == fit.across:
        parts = [
            f"K{AXES[axis]}{AXES[k]} {fit.response[axis, c]:.4g} ± {2.0 * fit.response_error[axis, c]:.2g} {unit}/g"
            for c, k in enumerate((i, j))
        ]
        return f"{bias}, with the tilt of the axis of rotation; couplings {', '.join(parts)}"
    along, other = (0, 1) if axis == i else (1, 0)
    scale = f"scale {fit.response[axis, along] / STANDARD_GRAVITY_M_S2:.6g} {unit} per m/s²"
    if fit.response_error[axis, other] == 0.0:
        return f"{bias}, {scale}"
    cross = f"K{AXES[axis]}{AXES[j if axis == i else i]} {fit.response[axis, other]:.4g}"
    return f"{bias}, {scale}, {cross} ± {2.0 * fit.response_error[axis, other]:.2g} {unit}/g"


def _rows(fit: PlaneFit, unit: str, out_unit: str, *, known: bool) -> list[dict[str, Any]]:
    """Rows of coefficients: only those that the plane determines."""
    rows: list[tuple[str, str, str, float, float, str]] = []
    for axis, letter in enumerate(AXES):
        rows.append((letter, "bias", "K0", fit.bias[axis], fit.bias_error[axis], out_unit))
        for column, other in enumerate(inside_of(fit.across)):
            effect, name = ("scale", "K1") if other == axis else ("misalignment", f"K{letter}{AXES[other]}")
            value, error = fit.response[axis, column], fit.response_error[axis, column]
            if other == axis or known or error > 0.0:
                rows.append((letter, effect, name, value, error, f"{out_unit}/g"))
    return [
        {"unit": unit, "axis": axis, "effect": effect, "name": name, "value": float(value), "standard_error": float(error),
         "unit_text": text}
        for axis, effect, name, value, error, text in rows
    ]  # fmt: skip
