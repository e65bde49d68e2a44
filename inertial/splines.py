"""Functions of a smooth curve."""

import numpy as np

from inertial.arrays import Array


def natural_spline(z: Array, knots: Array) -> list[Array]:
    """The curved functions of a natural cubic spline at values (...): k − 2 arrays (...) for knots (k,).

    Source: Hastie, Tibshirani, Friedman: Elements of Statistical Learning, eq. 5.4.
    """

    def d(k: int) -> Array:
        return (np.maximum(z - knots[k], 0.0) ** 3 - np.maximum(z - knots[-1], 0.0) ** 3) / (knots[-1] - knots[k])

    return [d(k) - d(knots.size - 2) for k in range(knots.size - 2)]
