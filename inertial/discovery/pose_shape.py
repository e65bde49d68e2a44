"""Free functions of pose, for dependences outside the catalogue: real spherical harmonics of the direction of the force.

Degrees 0 and 1 are bias, scale and misalignment; degrees 2 to 4 represent static errors of the transfer function or of a pose.
"""

import numpy as np
from scipy.special import factorial, lpmv

from inertial.arrays import Array

SHAPE = "any function of the pose"
"""Name of these columns in place of an effect id."""

_DEGREES = (2, 3, 4)
COUNT = sum(2 * degree + 1 for degree in _DEGREES)


def harmonics(force: Array) -> Array:
    """Values (..., 21) at the directions of forces (..., 3): orthogonal over the sphere, each of rms one; zero for zero force."""
    size = np.linalg.norm(force, axis=-1)
    x, y, z = np.moveaxis(force / np.where(size > 0.0, size, 1.0)[..., None], -1, 0)
    around = np.arctan2(y, x)
    out: list[Array] = []
    for degree in _DEGREES:
        for order in range(degree + 1):
            norm = (2 * degree + 1) * factorial(degree - order) / factorial(degree + order) * (2.0 if order else 1.0)
            along = np.sqrt(norm) * lpmv(order, degree, z)
            out += [along * np.cos(order * around), along * np.sin(order * around)] if order else [along]
    return np.stack(out, axis=-1) * (size > 0.0)[..., None]


def map_of(force: Array, size: Array, covariance: Array) -> tuple[Array, Array]:
    """A free function at poses after a fit of bias and linear response, and its standard errors, (n,) each, unit of ``size``.

    Parameters
    ----------
    force : (n, 3), g · size : (21,), of each harmonic · covariance : (21, 21), of the sizes
    """
    linear = np.column_stack([np.ones(len(force)), force])
    columns = harmonics(force)
    left = columns - linear @ np.linalg.lstsq(linear, columns, rcond=None)[0]
    return left @ size, np.sqrt(np.maximum(np.einsum("np,pq,nq->n", left, covariance, left), 0.0))
