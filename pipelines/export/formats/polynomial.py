"""Polynomial of each axis: a = c0 + c1·ã + c2·ã² + c3·ã³ + kT·(T − T0), for correction axis by axis without a matrix."""

import csv
import io
from collections.abc import Sequence

import numpy as np

from inertial.arrays import Array, levels_apart
from inertial.errors import NotIdentified
from inertial.fits.polynomial import AxisPolynomial, fit_axis_polynomial
from inertial.quantities import FORCE_COLUMNS
from pipelines.export.polynomials import UnitCalibration
from pipelines.export.settings import ExportSettings
from schemas.errors import WrongUse
from schemas.units import MICRO

SUFFIX = ".csv"
FEWER_AXES = True
COMPLETE = True  # it is fitted to the dwells themselves, and states what it leaves
DEGREE = 3
APART_G = 0.05
"""Width of a level of force along an axis."""
SPAN_K = 5.0
"""Of the temperatures, from which on kT is fitted."""
TERMS = ("c0", "c1", "c2", "c3", "kT")


def write(units: Sequence[UnitCalibration], run: str, settings: ExportSettings) -> str:
    """The table as text: a row for each axis, with the standard uncertainties and what the polynomial leaves, rms."""
    sink = io.StringIO()
    writer = csv.writer(sink, lineterminator="\n")
    errors = [f"u_{term}" for term in TERMS]
    writer.writerow(["unit", "axis", *TERMS, "T0_C", *errors, "rms_ug", "output_unit", "left_out", "certificate"])
    for c in units:
        for letter in c.letters:
            fitted = _fitted(c, letter)
            values, u = _terms(fitted)
            rms = f"{MICRO * float(np.sqrt(np.mean(fitted.residuals**2))):.6g}"
            origin = "" if fitted.reference_temperature is None else f"{fitted.reference_temperature:g}"
            ends = rms, c.out_unit, " ".join(c.left_out), c.certified
            writer.writerow([c.unit, letter, *values, origin, *u, *ends])
    return sink.getvalue()


def _fitted(c: UnitCalibration, letter: str) -> AxisPolynomial:
    """The polynomial of one axis, of the degree that its levels of force determine, up to the third."""
    rows = c.dwells[np.isfinite(c.dwells[f"out_{letter}"].to_numpy(dtype=float))]
    if not set(FORCE_COLUMNS) <= set(rows):
        raise WrongUse(
            f"export: unit {c.unit} has no known forces, a polynomial needs them; import with poses, or use --format json"
        )
    output, force = (rows[f"{name}_{letter}"].to_numpy(dtype=float)[:, None] for name in ("out", "force"))
    temperature = rows["unit_C"].to_numpy(dtype=float) if "unit_C" in rows else np.full(len(rows), np.nan)
    varied = bool(np.isfinite(temperature).all()) and float(np.ptp(temperature)) > SPAN_K
    degree = min(DEGREE, levels_apart(force[:, 0], APART_G) - 1)
    try:
        return fit_axis_polynomial(output, force, temperature=temperature if varied else None, degree=max(degree, 1))
    except NotIdentified as problem:
        raise WrongUse(f"export: unit {c.unit}, axis {letter}: {problem}") from None


def _terms(fitted: AxisPolynomial) -> tuple[list[str], list[str]]:
    """Values and standard uncertainties of all terms; empty for those that are not in the polynomial."""
    value, error = fitted.coefficients[0], np.sqrt(np.diagonal(fitted.covariance[0]))
    heat = fitted.reference_temperature is not None
    return _texts(value, fitted.degree, heat=heat), _texts(error, fitted.degree, heat=heat)


def _texts(numbers: Array, degree: int, *, heat: bool) -> list[str]:
    texts = [repr(float(number)) for number in numbers]
    powers, last = texts[: degree + 1], texts[-1] if heat else ""
    return [*powers, *[""] * (DEGREE - degree), last]
