"""White noise over temperature: a curve of the density with its uncertainty, and the ratio between its ends."""

from dataclasses import dataclass

import numpy as np

from inertial.arrays import Array, levels_apart

APART_K = 5.0
"""Between temperatures, from which on noise is compared; and the most that one soak may move."""
QUADRATIC_FROM = 4
"""Soaks from which on the curve has a curvature, at three temperatures that are apart: one degree of freedom is left for its
misfit."""


@dataclass(frozen=True)
class DensityCurve:
    """ln N = c0 + c1·θ (+ c2·θ²) with θ = T − ``middle``: a density is positive, and its relative change is what is compared.

    coefficients : (p,) · covariance : (p, p), widened by the misfit of the points where that exceeds one
    """

    middle: float
    coefficients: Array
    covariance: Array

    def at(self, temperature: Array) -> tuple[Array, Array]:
        """Density (n,) and its standard uncertainty (n,) at temperatures (n,) in °C, in the unit of the points."""
        rows = _columns(temperature - self.middle, self.coefficients.size)
        value = np.exp(rows @ self.coefficients)
        return value, value * np.sqrt(np.einsum("np,pq,nq->n", rows, self.covariance, rows))

    def ratio(self, low: float, high: float) -> tuple[float, float]:
        """Density at ``high`` over that at ``low``, °C, and its standard uncertainty."""
        ends = _columns(np.array([low, high]) - self.middle, self.coefficients.size)
        row = ends[1] - ends[0]
        value = float(np.exp(row @ self.coefficients))
        return value, value * float(np.sqrt(row @ self.covariance @ row))


def density_curve(temperature: Array, value: Array, u: Array) -> DensityCurve | None:
    """The curve of densities (n,) with standard uncertainties (n,) at temperatures (n,), °C.

    Weighted least squares on the logarithm; None for fewer than two temperatures that are apart.
    """
    levels = levels_apart(temperature, APART_K)
    if levels < 2:
        return None
    middle = float(0.5 * (temperature.min() + temperature.max()))
    columns = _columns(temperature - middle, 3 if levels > 2 and value.size >= QUADRATIC_FROM else 2)
    weight = value / u
    rows = columns * weight[:, None]
    covariance = np.linalg.inv(rows.T @ rows)
    coefficients = covariance @ rows.T @ (weight * np.log(value))
    dof = value.size - coefficients.size
    misfit = float(np.sum((weight * (np.log(value) - columns @ coefficients)) ** 2))
    widened = max(1.0, misfit / dof) if dof > 0 else 1.0
    return DensityCurve(middle, coefficients, np.asarray(widened * covariance, dtype=np.float64))


def _columns(theta: Array, count: int) -> Array:
    return np.stack([theta**k for k in range(count)], axis=-1)
