"""Centrifuge: the polynomial over a = rω²/g, with the input reversed or not, at one radius or at several.

At several radii the curve of the unit, the stretch of the arm and the offset of the proof mass are told apart.
"""

from dataclasses import dataclass

import numpy as np

from inertial.arrays import Array
from inertial.dynamics.missing_effects import NamedFit
from inertial.dynamics.spectra import STANDARD_GRAVITY
from inertial.errors import NotIdentified

TERMS = ("bias", "scale", "second_order", "third_order", "arm_stretch_or_odd_quadratic", "mass_offset_or_asymmetry")


@dataclass(frozen=True)
class Polynomial(NamedFit):
    """Coefficients of a centrifuge test in g of indicated acceleration, with their covariance.

    The indicated acceleration is the output over the sensitivity; terms are named in :data:`TERMS`. At one radius arm stretch
    and Koq·a|a| are one parameter of such a test, and so are the offset of the proof mass from the turning centre and a scale
    that differs by sign; :func:`fit_radii` separates them.
    """


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
    rows = columns(acceleration, names)
    solved = _least_squares(rows / error[:, None], output / error)
    if solved is None:
        raise NotIdentified(
            f"centrifuge: {len(output)} points do not tell {', '.join(names)} apart; add speeds, or measure with the mounting "
            "reversed too"
        )
    value, covariance = solved
    residuals = output - rows @ value
    square = float(np.sum((residuals / error) ** 2))
    return Polynomial(names, value, covariance, residuals, square, len(output) - len(names))


def _least_squares(weighted: Array, target: Array) -> tuple[Array, Array] | None:
    """Coefficients and their covariance by weighted rows (n, terms) and values (n,); None where these do not tell terms apart."""
    size = np.linalg.norm(weighted, axis=0)
    unit = weighted / size
    if np.linalg.matrix_rank(unit, tol=1e-8) < weighted.shape[1]:
        return None
    value = np.linalg.lstsq(unit, target, rcond=None)[0] / size
    return value, np.linalg.inv(unit.T @ unit) / np.outer(size, size)


def linearity_percent(polynomial: Polynomial, full_scale_g: float) -> float:
    """Largest deviation from the least-squares line over 0 … full scale of both signs, % of the one-sided range."""
    x = np.linspace(-full_scale_g, full_scale_g, 2001)
    deviation = _apart(x, columns(x, polynomial.names) @ polynomial.value)
    return float(100.0 * np.max(np.abs(deviation)) / (abs(polynomial.of("scale")[0]) * full_scale_g))


def linearity_error(polynomial: Polynomial, full_scale_g: float) -> float:
    """Standard uncertainty of the linearity by the least-squares line, % of the one-sided range.

    The deviation is linear in the coefficients, whose errors are correlated: over one set of speeds the terms are nearly of one
    shape, and errors of one are made up for by the others. Where the deviation is largest it is √(dᵀCd).
    """
    x = np.linspace(-full_scale_g, full_scale_g, 2001)
    each = _apart(x, columns(x, polynomial.names))
    row = each[int(np.argmax(np.abs(each @ polynomial.value)))]
    gain = abs(polynomial.of("scale")[0])
    return float(100.0 * np.sqrt(row @ polynomial.covariance @ row) / (gain * full_scale_g))


def _apart(x: Array, y: Array) -> Array:
    """Deviations (n,) or (n, k) from the least-squares line."""
    return np.asarray(y - np.vander(x, 2) @ np.polyfit(x, y, 1), dtype=np.float64)


BOTH = ("bias", "scale", "second_order", "third_order", "odd_quadratic", "asymmetry")
"""Terms of a unit that both mountings and two radii separate."""
ONE_WAY = BOTH[:4]
"""Terms of a unit in one mounting: K1′ is in the scale then, and Koq in K2."""


@dataclass(frozen=True)
class RadiiFit:
    """Result of a centrifuge test at several radii; pairs are a value and its standard uncertainty.

    unit : the unit's own curve, without arm and mounting; residuals (n,), χ² and degrees of freedom are those of the whole fit
    mass_offset_m : of the proof mass from the turning centre of the mounting, outwards
    arm_stretch_s2 : κ of r = r₀(1 + κω²)
    radius_errors_m : each radius minus its nominal value
    consistency : scale by a further radius over that by the first, minus 1, from the outputs alone; the largest of several.
        None in one mounting, where it is not told from the offset
    """

    unit: Polynomial
    mass_offset_m: tuple[float, float]
    arm_stretch_s2: tuple[float, float]
    radius_errors_m: tuple[tuple[float, float], ...]
    consistency: tuple[float, float] | None


def fit_radii(acceleration: Array, radius_m: Array, output: Array, error: Array, radius_error_m: float) -> RadiiFit:
    """Weighted least squares over all radii.

    The acceleration of a point is a·(1 + e/r)·(1 + κω²) ± δ·|a|/r: the error e of each radius is a parameter whose own
    measurement, 0 with ``radius_error_m``, is one more observation. The offset δ of the proof mass is the same length at
    every radius, which K1′ is not: its part of the acceleration falls with the radius.

    Parameters
    ----------
    acceleration : (n,), rω²/g of the nominal radius, g; negative where the unit is mounted the other way round
    radius_m : (n,), nominal
    output, error : (n,), indicated acceleration and its standard uncertainty, g
    radius_error_m : standard uncertainty of each radius, m

    Raises
    ------
    NotIdentified
        There is one radius, or the speeds do not tell the terms apart.
    """
    radii = np.unique(radius_m)[::-1]
    if radii.size < 2 or not radius_error_m > 0.0:
        msg = f"centrifuge: {radii.size} radius with an uncertainty of {radius_error_m:g} m, two and more than 0 are needed"
        raise NotIdentified(f"{msg}; measure at another radius, state its uncertainty")
    both = bool(np.any(acceleration > 0.0) and np.any(acceleration < 0.0))
    names = BOTH if both else ONE_WAY
    rows = np.column_stack([columns(acceleration, names), _arm(acceleration, radius_m)])
    of_radii = np.where(radius_m[:, None] == radii, (acceleration / radius_m)[:, None], 0.0)
    value, covariance, residuals, chi_square = _solved(rows, of_radii, output, error, radius_error_m)
    count, scale = len(names), float(value[1])
    spread = np.sqrt(np.diag(covariance)) / abs(scale)
    pairs = [(float(v / scale), float(u)) for v, u in zip(value, spread, strict=True)]
    unit = Polynomial(
        names, value[:count], covariance[:count, :count], residuals, chi_square, len(output) - rows.shape[1]
    )
    return RadiiFit(
        unit,
        pairs[count + 1],
        pairs[count],
        tuple(pairs[count + 2 :]),
        _consistency(rows, of_radii, output, error, radii) if both else None,
    )


def _arm(acceleration: Array, radius_m: Array) -> Array:
    """Columns (n, 2) of arm stretch and offset of the proof mass for coefficients in s² and m."""
    size = np.abs(acceleration)
    return np.column_stack([acceleration * size * STANDARD_GRAVITY / radius_m, size / radius_m])


def radii_as_observed(count: int, unknowns: int, radius_error_m: float) -> Array:
    """Weighted rows (count, unknowns) of the stated radii, whose errors are the last unknowns: each is 0 with its uncertainty."""
    return np.eye(count, unknowns, unknowns - count) / (radius_error_m if count else 1.0)


def _solved(
    rows: Array, of_radii: Array, output: Array, error: Array, radius_error_m: float
) -> tuple[Array, Array, Array, float]:
    """Coefficients, their covariance, residuals (n,) and χ², with the radii as observations where their error is finite."""
    weighted = np.column_stack([rows, of_radii]) / error[:, None]
    target = output / error
    if np.isfinite(radius_error_m):
        known = radii_as_observed(of_radii.shape[1], weighted.shape[1], radius_error_m)
        weighted, target = np.vstack([weighted, known]), np.append(target, np.zeros(len(known)))
    solved = _least_squares(weighted, target)
    if solved is None:
        raise NotIdentified(
            f"centrifuge: {len(output)} points do not tell the terms of two radii apart; add speeds, choose radii further "
            "apart, or measure with the mounting reversed too"
        )
    value, covariance = solved
    residuals = output - np.column_stack([rows, of_radii]) @ value
    return value, covariance, residuals, float(np.sum((target - weighted @ value) ** 2))


def _consistency(rows: Array, of_radii: Array, output: Array, error: Array, radii: Array) -> tuple[float, float]:
    """Departure of the scale by a further radius from that by the first, as a share: the radii do not enter as known."""
    value, covariance = _solved(rows, of_radii[:, 1:], output, error, np.inf)[:2]
    at = slice(rows.shape[1], None)
    share = value[at] / (value[1] * radii[1:])
    spread = np.sqrt(np.diag(covariance)[at]) / abs(value[1] * radii[1:])
    most = int(np.argmax(np.abs(share)))
    return float(share[most]), float(spread[most])
