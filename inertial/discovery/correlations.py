"""Correlations between coefficients over units, corrected for the correlated errors of their fits.

In a plan that is not centred, the errors of a bias and of its temperature coefficient are correlated; over thousands of units the
estimates then correlate although the true values do not. For a pair of coefficients each lot contributes
Σ(a·b) − (1 − 1/n)·ΣC, with a and b about the means of the lot and C the covariance of the fit. Its mean is zero where the true
values are uncorrelated, and the evidence over the lots remains valid however often it is evaluated.
"""

from dataclasses import dataclass

import numpy as np

from inertial.arrays import NORMAL_MEDIAN, Array, over
from inertial.discovery.running_sums import FIRST, Scale, Sums


@dataclass(frozen=True)
class Correlation:
    """Two coefficients of an axis, by index: log evidence, correlation of the true values, and its standard error."""

    axis: int
    first: int
    second: int
    log_e: float
    value: float
    error: float


class Correlations:
    """Accumulated sums of products of the lots, in the order of their measurement."""

    def __init__(self) -> None:
        self._lots: list[Array] = []
        self.units = 0

    def add(self, values: Array, covariance: Array) -> None:
        """Add a lot.

        Parameters
        ----------
        values : (units, axes, p), coefficients · covariance : (units, axes, p, p), of their errors
        """
        n = len(values)
        if n < 2:
            return
        about = values - values.mean(axis=0)
        self._lots.append(np.einsum("uap,uaq->apq", about, about) - (1.0 - 1.0 / n) * covariance.sum(axis=0))
        self.units += n

    def found(self, alpha: float) -> list[Correlation]:
        """Correlated pairs, the strongest first; the probability of any false one is at most ``alpha``."""
        if len(self._lots) < FIRST:
            return []
        every = np.array(self._lots)
        p = every.shape[2]
        first, second = np.triu_indices(p, 1)
        pairs = every[:, :, first, second].reshape(len(every), -1)
        needed = np.log(pairs.shape[1] / alpha) if pairs.shape[1] else np.inf
        log_e = _evidence(pairs)
        variance = np.diagonal(every.sum(axis=0), axis1=1, axis2=2)  # (axes, p), of the true values
        both = np.sqrt(np.maximum(variance[:, first] * variance[:, second], 0.0)).reshape(-1)
        known = (variance[:, first] > 0.0) & (variance[:, second] > 0.0)
        value, error = over(pairs.sum(axis=0), both), over(np.sqrt((pairs**2).sum(axis=0)), both)
        out = [
            Correlation(k // first.size, int(first[k % first.size]), int(second[k % first.size]), *row)
            for k, row in enumerate(zip(log_e.tolist(), value.tolist(), error.tolist(), strict=True))
            if row[0] >= needed and known.reshape(-1)[k]
        ]
        return sorted(out, key=lambda pair: -pair.log_e)


def _evidence(increments: Array) -> Array:
    """Log evidence (h,) of increments (lots, h), each bounded by the scale of earlier ones; it starts from medians."""
    spread = np.median(np.abs(increments[:FIRST]), axis=0) / NORMAL_MEDIAN
    scale = Scale(np.where(spread > 0.0, spread, 1.0))
    sums = Sums.of(increments.shape[1], two_sided=True)
    for x in increments:
        sums.add(scale.standardised(x))
    return sums.log_e
