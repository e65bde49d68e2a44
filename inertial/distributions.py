"""Quantiles and tail areas of a few distributions by scipy.special, with the numbers of scipy.stats.

Loading scipy.stats takes 0.7 s of processor time, which a command that needs one quantile should not spend.
"""

import numpy as np
from numpy.typing import ArrayLike
from scipy import special

from inertial.arrays import Array

NORMAL_95 = 1.959964
"""Half width of the two-sided interval of 95 % of a normal distribution, in standard deviations."""


def chi2_quantile(probability: ArrayLike, dof: ArrayLike) -> Array:
    """Value below which chi-square with ``dof`` degrees of freedom lies with a probability; broadcast."""
    return np.asarray(2.0 * special.gammaincinv(0.5 * _positive(dof), probability), dtype=np.float64)


def chi2_tail(value: ArrayLike, dof: ArrayLike) -> Array:
    """Probability that chi-square with ``dof`` degrees of freedom exceeds a value, one below zero; broadcast."""
    return np.asarray(special.chdtrc(_positive(dof), np.maximum(value, 0.0)), dtype=np.float64)


def chi2_upper(probability: ArrayLike, dof: ArrayLike) -> Array:
    """Value that chi-square with ``dof`` degrees of freedom exceeds with a probability; broadcast."""
    return np.asarray(special.chdtri(_positive(dof), probability), dtype=np.float64)


def f_tail(value: ArrayLike, first: ArrayLike, second: ArrayLike) -> Array:
    """Probability that F with ``first`` and ``second`` degrees of freedom exceeds a value, one below zero; broadcast."""
    return np.asarray(special.fdtrc(_positive(first), _positive(second), np.maximum(value, 0.0)), dtype=np.float64)


def f_upper(probability: ArrayLike, first: ArrayLike, second: ArrayLike) -> Array:
    """Value that F with ``first`` and ``second`` degrees of freedom exceeds with a probability; broadcast."""
    return np.asarray(
        special.fdtri(_positive(first), _positive(second), 1.0 - np.asarray(probability)), dtype=np.float64
    )


def f_noncentrality(probability: ArrayLike, value: ArrayLike, first: ArrayLike, second: ArrayLike) -> Array:
    """Noncentrality (within 1e-4 of it) with which F exceeds a value with a probability; broadcast."""
    below = 1.0 - np.asarray(probability)
    return np.asarray(special.ncfdtrinc(_positive(first), _positive(second), below, value), dtype=np.float64)


def normal_tail(value: ArrayLike) -> Array:
    """Probability that a standard normal variable exceeds a value."""
    return np.asarray(special.ndtr(-np.asarray(value)), dtype=np.float64)


def student_tail(value: ArrayLike, dof: ArrayLike) -> Array:
    """Probability that Student's t with ``dof`` degrees of freedom exceeds a value; broadcast."""
    return np.asarray(special.stdtr(_positive(dof), -np.asarray(value)), dtype=np.float64)


def student_upper(probability: ArrayLike, dof: ArrayLike) -> Array:
    """Value that Student's t with ``dof`` degrees of freedom exceeds with a probability; broadcast."""
    return np.asarray(-special.stdtrit(_positive(dof), probability), dtype=np.float64)


def kurtosis_tail(values: Array) -> float:
    """Probability that as many normal values, eight at least, have more kurtosis (Anscombe & Glynn, Biometrika 70 (1983) 227)."""
    n = float(values.size)
    centred = values - values.mean()
    kurtosis = float(np.mean(centred**4) / np.mean(centred**2) ** 2)
    variance = 24.0 * n * (n - 2.0) * (n - 3.0) / ((n + 1.0) ** 2 * (n + 3.0) * (n + 5.0))
    x = (kurtosis - 3.0 * (n - 1.0) / (n + 1.0)) / np.sqrt(variance)
    skew = 6.0 * (n**2 - 5.0 * n + 2.0) / ((n + 7.0) * (n + 9.0))
    skew *= np.sqrt(6.0 * (n + 3.0) * (n + 5.0) / (n * (n - 2.0) * (n - 3.0)))
    dof = 6.0 + 8.0 / skew * (2.0 / skew + np.sqrt(1.0 + 4.0 / skew**2))
    ratio = (1.0 - 2.0 / dof) / (1.0 + x * np.sqrt(2.0 / (dof - 4.0)))
    return float(normal_tail((1.0 - 2.0 / (9.0 * dof) - np.cbrt(ratio)) / np.sqrt(2.0 / (9.0 * dof))))


def normal_upper(probability: ArrayLike) -> Array:
    """Value that a standard normal variable exceeds with a probability."""
    return np.asarray(-special.ndtri(probability), dtype=np.float64)


def _positive(dof: ArrayLike) -> Array:
    """Degrees of freedom; NaN where there are none: scipy.special answers 0 there, which would pass for a probability."""
    values = np.asarray(dof, dtype=np.float64)
    return np.where(values > 0.0, values, np.nan)
