"""The family of a kind of device: mean and covariance of its units' coefficients, without the errors of their calibrations.

A calibration of a unit of a lot is y = μ + b + a + e: b of the lot with covariance L, a of the unit with T, e the error of the
fit with its own covariance C. T and L are estimated by restricted maximum likelihood (EM), with μ as one more random effect of
unbounded variance (D. A. Harville, JASA 72 (1977) 320; N. M. Laird and J. H. Ware, Biometrics 38 (1982) 963). The prior of a new
unit of a new lot is the empirical Bayes one, with the uncertainty of its own parameters.
"""

from dataclasses import dataclass, field

import numpy as np
from scipy.special import gammaln

from inertial.arrays import Array, Index
from inertial.counts import number_of
from inertial.errors import NotIdentified

SPARE = 4
"""Lots beyond the number of coefficients that a family needs: with fewer the variance of the prediction has no mean."""

PAIRS = 12
"""Pairs of calibrations of one unit from which its change is known."""

_ROUNDS, _SETTLED = 2000, 1e-5
_TAILS = (5.0, 6.0, 8.0, 10.0, 14.0, 20.0, 40.0, 1e6)
"""Degrees of freedom of Student's distribution that are tried for the tails of a family; the last one is normal."""
_HEAVIER = 4.0
"""Twice the log likelihood that heavier tails must be worth."""


@dataclass(frozen=True)
class Family:
    """What calibrations say of their kind of device; the p coefficients of each of m axes.

    mean : (m, p), output unit per unit of the column
    unit, lot : (m, p, p), covariances between the units of a lot, and between lots
    error : (m, p, p), covariance of the mean
    units, lots : numbers that it is known from
    tails : (m, p), degrees of freedom of Student's distribution that the tails of a coefficient are like
    own : by serial number, mean (m, p) and covariance (m, p, p) of units with earlier calibrations of their own
    """

    mean: Array
    unit: Array
    lot: Array
    error: Array
    units: int
    lots: int
    tails: Array
    own: dict[str, tuple[Array, Array]] = field(default_factory=dict[str, tuple[Array, Array]])

    @property
    def within(self) -> Array:
        """Covariance (m, p, p) of new units of one lot about its mean, widened as few units require."""
        return _widened(self.units - self.lots + 1, self.mean.shape[-1]) * self.unit

    @property
    def between(self) -> Array:
        """Covariance (m, p, p) of the mean of a new lot, widened as few lots require."""
        return _widened(self.lots, self.mean.shape[-1]) * self.lot + self.error

    @property
    def precision(self) -> Array:
        """Precision (m, p, p) of the coefficients of a unit of a new lot."""
        return np.asarray(np.linalg.inv(self.within + self.between), dtype=np.float64)


def _widened(count: int, p: int) -> float:
    """Variance of a prediction of p values over the estimated one of ``count``: Student's, from the inverse Wishart law."""
    return (count - 1.0) / (count - p - 2.0)


def family_of(values: Array, covariance: Array, lot: Index) -> Family:
    """The family of calibrated units.

    Parameters
    ----------
    values : (units, m, p), coefficients
    covariance : (units, m, p, p), of their errors
    lot : (units,), number of the lot of each, from 0

    Raises
    ------
    NotIdentified
        There are too few lots or units for the number of coefficients.
    """
    units, _, p = values.shape
    lots = int(lot.max()) + 1 if lot.size else 0
    if lots < p + SPARE or units - lots + 1 < p + SPARE:
        raise NotIdentified(
            f"prior: {number_of(units, 'calibration')} in {number_of(lots, 'lot')}, {p} coefficients need {p + SPARE} lots "
            f"and {p + SPARE} units more than lots; take an earlier 'since', or leave [prior] out"
        )
    size = np.std(values, axis=0)
    size = np.where(size > 0.0, size, 1.0)
    y, c = values / size, covariance / (size[..., :, None] * size[..., None, :])
    counts = np.bincount(lot, minlength=lots)
    middles = _by_lot(y, lot, lots) / counts[:, None, None]
    inside = y - middles[lot]
    within = np.einsum("uai,uaj->aij", inside, inside) / max(units - lots, 1)
    between = _covariance(middles - middles.mean(axis=0)) * lots / (lots - 1.0)
    for _ in range(_ROUNDS):
        before = np.stack([within, between])
        within, between, *_ = _round(y, c, lot, lots, within, between)
        if np.max(np.abs(np.stack([within, between]) - before)) < _SETTLED * np.max(np.abs(before)):
            break
    *_, mean, error = _round(y, c, lot, lots, within, between)
    spread = np.diagonal(within + between + error, axis1=-2, axis2=-1) + np.diagonal(c, axis1=-2, axis2=-1)
    tails = _tails((y - mean) / np.sqrt(spread))
    across = size[..., :, None] * size[..., None, :]
    return Family(mean * size, within * across, between * across, error * across, units, lots, tails)


def change_of(apart: Array, covariance: Array) -> Array:
    """Variances (m, p) of the change of a coefficient from one calibration of a unit to its next, with one standard error.

    Parameters
    ----------
    apart : (n, m, p), differences of pairs of calibrations
    covariance : (n, m, p, p), of the errors of both together

    Raises
    ------
    NotIdentified
        There are fewer than :data:`PAIRS` pairs.
    """
    if len(apart) < PAIRS:
        raise NotIdentified(f"prior: {number_of(len(apart), 'pair')} of calibrations of one unit, {PAIRS} are needed")
    square = apart**2 - np.diagonal(covariance, axis1=-2, axis2=-1)
    return np.maximum(square.mean(axis=0), 0.0) + square.std(axis=0, ddof=1) / np.sqrt(len(square))


def with_prior(covariance: Array, precision: Array) -> Array:
    """Covariance (..., p, p) of estimates of this covariance together with a prior of this precision."""
    size = np.sqrt(np.diagonal(covariance, axis1=-2, axis2=-1))
    across = size[..., :, None] * size[..., None, :]
    scaled = covariance / across
    both = np.linalg.solve(np.eye(size.shape[-1]) + scaled @ (precision * across), scaled)
    return 0.5 * (both + np.swapaxes(both, -1, -2)) * across


def _by_lot(values: Array, lot: Index, lots: int) -> Array:
    total = np.zeros((lots, *values.shape[1:]))
    np.add.at(total, lot, values)
    return total


def _covariance(rows: Array) -> Array:
    """Mean of the products of rows (n, m, p), (m, p, p)."""
    return np.einsum("nai,naj->aij", rows, rows) / len(rows)


def _round(
    y: Array, c: Array, lot: Index, lots: int, within: Array, between: Array
) -> tuple[Array, Array, Array, Array]:
    """One step of EM: the next T and L, and the mean and its covariance at the present ones."""
    precision = np.asarray(np.linalg.inv(c + within), dtype=np.float64)
    total = _by_lot(precision, lot, lots)
    spread = np.linalg.inv(total)
    middle = np.einsum("laij,laj->lai", spread, _by_lot(np.einsum("uaij,uaj->uai", precision, y), lot, lots))
    known = np.linalg.inv(spread + between)
    error = np.linalg.inv(known.sum(axis=0))
    mean = np.einsum("aij,aj->ai", error, np.einsum("laij,laj->ai", known, middle))
    gain = between @ known
    shift = np.einsum("laij,laj->lai", gain, middle - mean)
    left = between - gain @ between
    next_between = _covariance(shift) + np.mean(left + gain @ error @ np.swapaxes(gain, -1, -2), axis=0)
    rest = np.eye(y.shape[-1]) - gain
    of_lot = left + rest @ error @ np.swapaxes(rest, -1, -2)
    pull = within @ precision
    part = np.einsum("uaij,uaj->uai", pull, y - (mean + shift)[lot])
    next_within = _covariance(part) + np.mean(
        within - pull @ within + pull @ of_lot[lot] @ np.swapaxes(pull, -1, -2), axis=0
    )
    return next_within, next_between, mean, error


def _tails(standardised: Array) -> Array:
    """Degrees of freedom (m, p) of Student's distribution of variance one that fits values (n, m, p) best."""
    square = standardised**2
    deviance = np.stack(
        [
            -2.0
            * np.sum(
                gammaln(0.5 * (v + 1.0)) - gammaln(0.5 * v) - 0.5 * np.log(v - 2.0)
                - 0.5 * (v + 1.0) * np.log1p(square / (v - 2.0)),
                axis=0,
            )
            for v in _TAILS
        ]
    )  # fmt: skip
    best = np.where(deviance.min(axis=0) < deviance[-1] - _HEAVIER, deviance.argmin(axis=0), len(_TAILS) - 1)
    return np.array(_TAILS)[best]
