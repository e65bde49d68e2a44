"""Agreement of two results with their uncertainties."""

import numpy as np
from scipy.stats import norm
from scipy.stats import t as student

from inertial.arrays import Array

COVERAGE = 2.0


def e_n(new: Array, old: Array, new_error: Array, old_error: Array, dof: Array | float = np.inf) -> Array:
    """The E_n number of two results: their difference over the root sum of squares of their expanded uncertainties.

    |E_n| ≤ 1 agrees (ISO/IEC 17043:2010, B.3.1.3; ISO 13528:2015, 9.7). Standard uncertainties are given. Their coverage factor
    is 2, or larger where they are known from few values: Student's for the same 95.45 % (JCGM 100, G.4).

    Parameters
    ----------
    dof : effective degrees of freedom of the combined uncertainty, infinite where it is known
    """
    coverage = np.where(np.isinf(dof), COVERAGE, student.isf(norm.sf(COVERAGE), np.maximum(dof, 1.0)))
    return (new - old) / (coverage * np.sqrt(new_error**2 + old_error**2))
