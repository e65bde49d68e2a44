"""Effective degrees of freedom and coverage factors (JCGM 100:2008, G.4, G.6.4)."""

import numpy as np
from scipy.special import ndtri, stdtrit

from inertial.arrays import Array

PROBABILITY = 0.9545
"""Of k = 2 for a normal distribution."""
_LARGEST = 1e9


def effective_degrees(u: Array, dof: Array) -> Array:
    """ν_eff of every row, by Welch and Satterthwaite (JCGM 100, G.2b): contributions u and dof (n, c), result (n,)."""
    parts = np.ascontiguousarray(u, dtype=float)
    below = np.sum(np.ascontiguousarray(parts**4 / np.asarray(dof, dtype=float)), axis=1)
    whole = np.sum(np.ascontiguousarray(parts**2), axis=1) ** 2
    return np.divide(whole, below, out=np.full_like(below, np.inf), where=below > 0.0)


def coverage_factors(dof: Array, probability: float = PROBABILITY) -> Array:
    """K of Student's distribution for ν_eff truncated to a whole number (JCGM 100, G.4.1, table G.2); 2 for 95.45 % and ν = ∞."""
    finite = dof < _LARGEST
    whole = np.maximum(np.where(finite, dof, 1.0).astype(np.int64), 1)
    return np.where(finite, stdtrit(whole, 0.5 * (1.0 + probability)), ndtri(0.5 * (1.0 + probability)))
