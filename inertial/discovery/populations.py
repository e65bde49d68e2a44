"""Test of a coefficient of many units for two populations, against a single unimodal one (split likelihood ratio).

A mixture of two normal distributions is fitted to one half of the units; on the other half it is compared with the best unimodal
distribution fitted to that half (Student's t, sinh-arcsinh or generalised normal). The likelihood ratio, averaged over both ways,
is evidence: under one population its mean is at most one (Wasserman, Ramdas, Balakrishnan 2020; Jones and Pewsey 2009).
"""

from dataclasses import dataclass

import numpy as np
from numpy.random import Generator
from scipy import optimize, special, stats

from inertial.arrays import Array

FEWEST = 200
"""Smallest number of units for the test."""

MOST = 4000
"""Largest number of units that are used, drawn at random from more."""

_STARTS = (0.02, 0.1, 0.5, 0.9, 0.98)  # starting values of the share of the lower population
_STEPS = 300
_LEAST = -2.5  # lower bound of the logarithm of a distribution's width over that by the quartiles
_NARROW = 0.05  # smallest width of a population over that of all units


@dataclass(frozen=True)
class TwoPopulations:
    """Log evidence, and the mixture fitted to all units: means, standard deviations, share of the smaller population (first)."""

    log_e: float
    means: tuple[float, float]
    widths: tuple[float, float]
    share: float


def two_populations(values: Array, rng: Generator) -> TwoPopulations | None:
    """The evidence for two populations; None if there are too few values or no scatter.

    Parameters
    ----------
    values : (n,), a coefficient of each unit once; values that are not finite are left out
    """
    known = values[np.isfinite(values)]
    if known.size < FEWEST:
        return None
    if known.size > MOST:
        known = rng.choice(known, MOST, replace=False)
    centre = float(np.median(known))
    scale = float(np.subtract(*np.percentile(known, [75.0, 25.0]))) / 1.349
    if scale <= 0.0:
        return None
    z = rng.permutation((known - centre) / scale)
    halves = z[0::2], z[1::2]
    ways = [
        float(np.sum(np.logaddexp(*_parts(test, *_fitted(training))))) - _one_peak(test)
        for training, test in (halves, halves[::-1])
    ]
    log_e = float(special.logsumexp(ways) - np.log(2.0))
    weights, means, widths = _fitted(z)
    first, other = np.argsort(weights, kind="stable")
    return TwoPopulations(
        log_e,
        (centre + scale * float(means[first]), centre + scale * float(means[other])),
        (scale * float(widths[first]), scale * float(widths[other])),
        float(weights[first]),
    )


def _parts(z: Array, weights: Array, means: Array, widths: Array) -> Array:
    """Log likelihoods (2, n) of values under the two weighted components of a mixture."""
    about = (z - means[:, None]) / widths[:, None]
    return np.log(weights / widths)[:, None] - 0.5 * about**2 - 0.5 * np.log(2.0 * np.pi)


def _fitted(z: Array) -> tuple[Array, Array, Array]:
    """Weights, means and widths, (2,) each, of a normal mixture by expectation-maximisation, best of several starts."""
    best: tuple[float, tuple[Array, Array, Array]] | None = None
    least = _NARROW * float(z.std())
    for share in _STARTS:
        edge = np.quantile(z, share)
        low, high = z[z <= edge], z[z > edge]
        weights, means = np.array([share, 1.0 - share]), np.array([low.mean(), high.mean()])
        widths = np.maximum(np.array([low.std(), high.std()]), least)
        before = -np.inf
        for _ in range(_STEPS):
            parts = _parts(z, weights, means, widths)
            total = np.logaddexp(*parts)
            shares = np.exp(parts - total)
            counts = np.maximum(shares.sum(axis=1), 2.0)
            weights, means = counts / counts.sum(), shares @ z / counts
            # a lower bound, because a constant added to the widths would widen both at each step
            widths = np.maximum(np.sqrt((shares * (z - means[:, None]) ** 2).sum(axis=1) / counts), least)
            now = float(np.sum(total))
            if now - before < 1e-4:
                break
            before = now
        if best is None or before > best[0]:
            best = before, (weights, means, widths)
    if best is None:
        raise ArithmeticError("no beginning of a mixture")
    return best[1]


def _one_peak(z: Array) -> float:
    """Largest log likelihood of values under one unimodal distribution: Student's t, sinh-arcsinh, generalised normal."""

    def student(theta: Array) -> float:
        width, nu = np.exp(np.clip(theta[1], _LEAST, 5.0)), 1.0 + np.exp(min(float(theta[2]), 8.0))
        return -float(stats.t.logpdf(z, nu, theta[0], width).sum())

    def sinh_arcsinh(theta: Array) -> float:
        # width and tails are bounded: a narrow distribution with wide tails could have any density at a single value
        scale = float(np.clip(theta[1], _LEAST, 5.0))
        width, tails = np.exp(scale), np.exp(np.clip(theta[3], -1.5, 3.0))
        about = (z - theta[0]) / width
        inner = np.clip(tails * np.arcsinh(about) - theta[2], -50.0, 50.0)
        log = np.log(tails) + np.log(np.cosh(inner)) - 0.5 * np.log1p(about**2) - 0.5 * np.sinh(inner) ** 2
        return -float((log - scale - 0.5 * np.log(2.0 * np.pi)).sum())

    def flat(theta: Array) -> float:
        width, power = np.exp(np.clip(theta[1], _LEAST, 5.0)), np.exp(np.clip(theta[2], 0.0, 4.0))
        return -float(np.maximum(stats.gennorm.logpdf(z, power, theta[0], width), -1e6).sum())

    skewed = [(sinh_arcsinh, [0.0, 0.0, skew, 0.0]) for skew in (-0.5, 0.0, 0.5)]
    ends = {"xatol": 1e-3, "fatol": 1e-2}
    return -min(
        float(optimize.minimize(law, start, method="Nelder-Mead", options=ends).fun)
        for law, start in [(flat, [0.0, 0.5, 1.0]), (student, [0.0, 0.0, 2.0]), *skewed]
    )
