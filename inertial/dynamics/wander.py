"""Variance of 1/f wander in a short series of means, beside known noise and fitted terms, and how well it is known."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar
from scipy.stats import norm, t

Array = NDArray[np.float64]
FEWEST_DOF = 1.0


@dataclass(frozen=True)
class Wander:
    """Variance of wander and the standard deviation of its estimate, squares of the output's unit."""

    variance: float
    error: float


def wander_variance(rows: Array, output: Array, known: Array, kernel: Array) -> float:
    """Variance of wander as :func:`wander` estimates it."""
    return wander(rows, output, known, kernel).variance


def wander(rows: Array, output: Array, known: Array, kernel: Array) -> Wander:
    """Variance of wander with the correlation ``kernel`` (n, n) beside a known covariance, by restricted likelihood.

    The standard deviation of the estimate is that of the expected information, ½·tr((P·K)²) for the variance.

    Parameters
    ----------
    rows : (n, terms); output : (n,), any unit
    known : (n, n), square of the output's unit
    """
    left = output - rows @ np.linalg.lstsq(rows, output, rcond=None)[0]
    size = float(left @ left) / max(1, len(left) - rows.shape[1])
    if size <= 0.0:
        return Wander(0.0, 0.0)

    def cost(log: float) -> float:
        whole = known + np.exp(log) * kernel
        root = np.linalg.cholesky(whole)
        x, y = np.linalg.solve(root, rows), np.linalg.solve(root, output)
        normal = x.T @ x
        rest = y - x @ np.linalg.solve(normal, x.T @ y)
        return float(2.0 * np.sum(np.log(np.diag(root))) + np.linalg.slogdet(normal)[1] + rest @ rest)

    found: Any = minimize_scalar(cost, bounds=(np.log(1e-6 * size), np.log(1e3 * size)), method="bounded")
    variance = float(np.exp(found.x))
    inverse = np.linalg.inv(known + variance * kernel)
    free = inverse - inverse @ rows @ np.linalg.solve(rows.T @ inverse @ rows, rows.T @ inverse)
    own = free @ kernel
    return Wander(variance, float(np.sqrt(2.0 / np.sum(own * own.T))))


def logarithmic_kernel(count: int) -> Array:
    """Covariance (count,) of 1/f noise in adjacent means over their lag in means, for a one-sided density 1/f; up to a constant.

    It is minus the mean of ln|t − t′| over both means: 3/2 at lag 0, and −ln k from afar. A constant is common to all means,
    which cancels in any difference; see :func:`variance_of_sum`.
    """
    k = np.arange(1, count, dtype=np.float64)
    inner = np.where(k > 1.0, (k - 1.0) ** 2 * np.log(np.maximum(k - 1.0, 1.0)), 0.0)
    far = 0.5 * ((k + 1.0) ** 2 * np.log(k + 1.0) + inner - 2.0 * k**2 * np.log(k)) - 1.5
    return np.concatenate([[1.5], -far])


def variance_of_sum(weights: Array) -> float:
    """Variance of Σ wₖ·mean k in 1/f noise with the one-sided density 1/f, for adjacent means and weights (n,) of sum zero."""
    size = len(weights)
    spectrum = np.abs(np.fft.rfft(weights, 2 * size)) ** 2
    products = np.fft.irfft(spectrum, 2 * size)[:size]
    kernel = logarithmic_kernel(size)
    return float(products[0] * kernel[0] + 2.0 * products[1:] @ kernel[1:])


def stated_error(variance: float, slope: float, error: float) -> float:
    """Standard uncertainty u, half of whose U (k = 2) has 95 % where a part of the variance is an estimate from few data.

    Welch and Satterthwaite: ν = 2·V²/Var V, and u = √V·t₀.₉₇₅(ν)/z₀.₉₇₅ (GUM, G.4).

    Parameters
    ----------
    variance : V; slope : of V over the estimated variance; error : standard deviation of that estimate
    """
    if variance <= 0.0:
        return 0.0
    spread = (slope * error / variance) ** 2
    dof = max(FEWEST_DOF, 2.0 / spread) if spread > 0.0 else np.inf
    return float(np.sqrt(variance) * t.ppf(0.975, dof) / norm.ppf(0.975))
