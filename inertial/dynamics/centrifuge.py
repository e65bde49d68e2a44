"""Centrifuge: the polynomial over a = rω²/g, with the input reversed or not."""

from dataclasses import dataclass

import numpy as np

from inertial.arrays import Array
from inertial.errors import NotIdentified

STANDARD_GRAVITY = 9.80665
TERMS = ("bias", "scale", "second_order", "third_order", "arm_stretch_or_odd_quadratic", "mass_offset_or_asymmetry")


@dataclass(frozen=True)
class Polynomial:
    """Coefficients of a centrifuge test in g of indicated acceleration, with their covariance.

    The indicated acceleration is the output over the sensitivity; terms are named in :data:`TERMS`. At one radius arm stretch
    and Koq·a|a| are one parameter of such a test, and so are the offset of the proof mass from the turning centre and a scale
    that differs by sign; :mod:`inertial.dynamics.centrifuge_radii` separates them.
    """

    names: tuple[str, ...]
    value: Array
    covariance: Array
    residuals: Array
    chi_square: float
    dof: int

    def of(self, name: str) -> tuple[float, float]:
        """Value and standard uncertainty of a term."""
        k = self.names.index(name)
        return float(self.value[k]), float(np.sqrt(self.covariance[k, k]))


def columns(acceleration: Array, names: tuple[str, ...]) -> Array:
    """Design columns (n, terms) over the signed acceleration (n,), g."""
    a = acceleration
    known = {
        "bias": np.ones_like(a),
        "scale": a,
        "second_order": a**2,
        "third_order": a**3,
        "arm_stretch_or_odd_quadratic": a * np.abs(a),
        "mass_offset_or_asymmetry": np.abs(a),
        "odd_quadratic": a * np.abs(a),
        "asymmetry": np.abs(a),
    }
    return np.column_stack([known[name] for name in names])


def fit_polynomial(acceleration: Array, output: Array, error: Array, names: tuple[str, ...]) -> Polynomial:
    """Weighted least squares of the terms.

    Parameters
    ----------
    acceleration : (n,), signed, g
    output, error : (n,), indicated acceleration and its standard uncertainty, g

    Raises
    ------
    NotIdentified
        The speeds and mountings do not tell the terms apart.
    """
    design = columns(acceleration, names) / error[:, None]
    size = np.linalg.norm(design, axis=0)
    if len(output) < len(names) or np.linalg.matrix_rank(design / size, tol=1e-8) < len(names):
        raise NotIdentified(
            f"centrifuge: {len(output)} points do not tell {', '.join(names)} apart; add speeds, or measure with the mounting "
            "reversed too"
        )
    c = np.linalg.lstsq(design / size, output / error, rcond=None)[0] / size
    residuals = output - columns(acceleration, names) @ c
    inverse = np.linalg.inv((design / size).T @ (design / size)) / np.outer(size, size)
    return Polynomial(
        names, c, inverse, residuals, float(np.sum((residuals / error) ** 2)), int(len(output) - len(names))
    )


def linearity_percent(polynomial: Polynomial, full_scale_g: float) -> float:
    """Largest deviation from the least-squares line over 0 … full scale of both signs, % of the one-sided range."""
    x = np.linspace(-full_scale_g, full_scale_g, 2001)
    deviation = _apart(x, columns(x, polynomial.names) @ polynomial.value)
    return float(100.0 * np.max(np.abs(deviation)) / (abs(polynomial.of("scale")[0]) * full_scale_g))


def linearity_error(polynomial: Polynomial, full_scale_g: float) -> float:
    """Standard uncertainty of the linearity by the least-squares line, % of the one-sided range.

    The deviation is linear in the coefficients, whose errors are correlated: over one set of speeds the terms are nearly of one
    shape, and errors of one are made up for by the others. At the place of the largest deviation it is √(dᵀCd).
    """
    x = np.linspace(-full_scale_g, full_scale_g, 2001)
    each = _apart(x, columns(x, polynomial.names))
    place = each[int(np.argmax(np.abs(each @ polynomial.value)))]
    gain = abs(polynomial.of("scale")[0])
    return float(100.0 * np.sqrt(place @ polynomial.covariance @ place) / (gain * full_scale_g))


def _apart(x: Array, y: Array) -> Array:
    """Deviations (n,) or (n, k) from the least-squares line."""
    return np.asarray(y - np.vander(x, 2) @ np.polyfit(x, y, 1), dtype=np.float64)
