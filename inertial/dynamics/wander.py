"""Variance of 1/f wander in a short series of means, beside known noise and fitted terms, and how well it is known."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import null_space
from scipy.optimize import brentq, minimize_scalar
from scipy.stats import norm, t

Array = NDArray[np.float64]
FEWEST_DOF = 1.0
GRID = 120  # variances of wander of a posterior
REACHED, FARTHEST = 0.99, 30.0  # bracket of a 95 % interval: the deviation at this probability, times this


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

    minimum: Any = minimize_scalar(cost, bounds=(np.log(1e-6 * size), np.log(1e3 * size)), method="bounded")
    variance = float(np.exp(minimum.x))
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


def stated_error(variance: float, slope: float, error: float, scatter: float = 0.0) -> float:
    """Standard uncertainty u, half of whose U (k = 2) has 95 % where a part of the variance is an estimate from few data.

    Welch and Satterthwaite: ν = 2·V²/Var V, and u = √V·t₀.₉₇₅(ν)/z₀.₉₇₅ (GUM, G.4).

    Parameters
    ----------
    variance : V; slope : of V over the estimated variance; error : standard deviation of that estimate
    scatter : relative standard deviation of a factor of √V that is estimated from the same record
    """
    if variance <= 0.0:
        return 0.0
    spread = (slope * error / variance) ** 2 + (2.0 * scatter) ** 2
    dof = max(FEWEST_DOF, 2.0 / spread) if spread > 0.0 else np.inf
    return float(np.sqrt(variance) * t.ppf(0.975, dof) / norm.ppf(0.975))


@dataclass(frozen=True)
class Posterior:
    """Variances of wander (g,), squares of the output's unit, with their probabilities (g,)."""

    variance: Array
    probability: Array

    def error_of(self, known: float, slope: float) -> float:
        """Standard uncertainty u, half of whose U (k = 2) has 95 %, of an estimate of the variance known + slope·wander.

        The estimate is normal for each variance of the wander; the 95 % are those of the mixture.
        """
        each = np.sqrt(known + slope * self.variance)
        top = float(each[np.cumsum(self.probability) <= REACHED].max(initial=each[0]))
        if top <= 0.0:
            return 0.0

        def outside(half: float) -> float:
            return float(2.0 * self.probability @ norm.cdf(-half / np.maximum(each, 1e-300)) - 0.05)

        half_width: Any = brentq(outside, 0.0, FARTHEST * top)
        return float(half_width / norm.ppf(0.975))


def wander_posterior(rows: Array, output: Array, white: float, kernel: Array) -> Posterior:
    """Probabilities of the variance of wander beside white noise, by restricted likelihood and the prior of Jeffreys.

    A short record knows the variance to a third at best: what one value of it says of an interval is too little where it is
    estimated low. Student's t is the case without white noise.

    Parameters
    ----------
    rows : (n, terms); output : (n,), any unit
    white : known variance of each value, square of the output's unit
    kernel : (n, n), of the wander
    """
    free = null_space(rows.T)
    share, turn = np.linalg.eigh(free.T @ kernel @ free)
    square = (turn.T @ (free.T @ output)) ** 2
    size = float(square.mean())
    if size <= 0.0:
        return Posterior(np.zeros(1), np.ones(1))
    variance = np.geomspace(1e-5 * size, 1e4 * size, GRID)
    whole = white + variance[:, None] * share
    prior = np.log(variance) + 0.5 * np.log(np.sum((share / whole) ** 2, axis=1))  # over ln of the variance
    log = prior - 0.5 * np.sum(np.log(whole) + square / whole, axis=1)
    weight = np.exp(log - log.max())
    return Posterior(variance, np.asarray(weight / weight.sum(), dtype=np.float64))
