"""Degrees of freedom: effective ones and coverage factors (JCGM 100:2008, G.4, G.6.4), and the law of a standard deviation.

What a measurement tells of a standard deviation has the law of χ², which few degrees of freedom make far from normal: with nine
of them a normal law at two standard uncertainties states a risk of 2.3 % where it is 10 %, with two 22 %.
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from scipy.optimize import brentq
from scipy.special import ndtri, stdtrit

from inertial.arrays import Array
from inertial.distributions import chi2_quantile, chi2_tail, normal_tail

UPPER_95 = 0.975
FEWEST_DOF, MOST_DOF = 0.05, 1e6
PROBABILITY = 0.9545
"""Of k = 2 for a normal distribution."""
_LARGEST = 1e9


def effective_degrees(u: Array, dof: Array) -> Array:
    """ν_eff of every row, by Welch and Satterthwaite (JCGM 100, G.2b): contributions u and dof (n, c), result (n,)."""
    parts = np.ascontiguousarray(u, dtype=float)
    below = np.sum(np.ascontiguousarray(parts**4 / np.asarray(dof, dtype=float)), axis=1)
    numerator = np.sum(np.ascontiguousarray(parts**2), axis=1) ** 2
    return np.divide(numerator, below, out=np.full_like(below, np.inf), where=below > 0.0)


def coverage_factors(dof: Array, probability: float = PROBABILITY) -> Array:
    """K of Student's distribution for ν_eff truncated to a whole number (JCGM 100, G.4.1, table G.2); 2 for 95.45 % and ν = ∞."""
    finite = dof < _LARGEST
    truncated = np.maximum(np.where(finite, dof, 1.0).astype(np.int64), 1)
    return np.where(finite, stdtrit(truncated, 0.5 * (1.0 + probability)), ndtri(0.5 * (1.0 + probability)))


@dataclass(frozen=True)
class DeviationLaw:
    """A standard deviation σ that was estimated as ``value`` with ν degrees of freedom.

    Of a deviation s that contains a part of known size, (σ² + removed²)·χ²/ν is s², with s² = value² + removed².

    Parameters
    ----------
    value, removed : one unit; dof : ν, effective
    """

    value: float
    dof: float
    removed: float = 0.0

    def quantile(self, probability: float) -> float:
        """Upper limit of σ that holds with a probability; zero where the removed part explains as much."""
        variance = (self.value**2 + self.removed**2) * self.dof / float(chi2_quantile(1.0 - probability, self.dof))
        return float(np.sqrt(max(variance - self.removed**2, 0.0)))

    def beyond(self, limit: float) -> float:
        """Probability that σ exceeds a limit."""
        variance = limit**2 + self.removed**2
        if not variance > 0.0:
            return 1.0
        return 1.0 - float(chi2_tail(self.dof * (self.value**2 + self.removed**2) / variance, self.dof))

    def threshold(self, limit: float, guard: float) -> float:
        """The estimate at which σ exceeds the limit with the probability 1 − Φ(guard).

        It is the acceptance limit of a guard band of ``guard`` standard uncertainties; a negative guard gives the estimate from
        which on σ is beyond the limit. Without a guard band the estimate itself is compared.
        """
        if guard == 0.0:
            return limit
        share = float(chi2_quantile(normal_tail(guard), self.dof)) / self.dof
        return float(np.sqrt(max((limit**2 + self.removed**2) * share - self.removed**2, 0.0)))


@lru_cache(maxsize=65536)
def dof_of_upper(ratio: float) -> float:
    """Degrees of freedom with which the 95 % interval of a standard deviation ends at ``ratio`` times its value.

    Of terms that are fitted to a curve, whose interval is that of a likelihood: few means determine the slow ones.
    """
    if not ratio > 1.0 or not np.isfinite(ratio):
        return float("nan")

    def above(log: float) -> float:
        dof = float(np.exp(log))
        return float(np.sqrt(dof / chi2_quantile(1.0 - UPPER_95, dof))) - ratio

    ends = float(np.log(FEWEST_DOF)), float(np.log(MOST_DOF))
    if above(ends[1]) > 0.0:
        return MOST_DOF
    if above(ends[0]) < 0.0:
        return FEWEST_DOF
    root: Any = brentq(above, *ends)
    return float(np.exp(root))
