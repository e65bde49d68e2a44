"""The lower triangle that makes the noise of one set of dwells white, by Cholesky factors."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import get_blas_funcs, get_lapack_funcs

from inertial.criticism.decisions import SHARE_STEP

Array = NDArray[np.float64]

_factor, _invert = get_lapack_funcs(("potrf", "trtri"), dtype=np.float64)
_times = get_blas_funcs(("trmm",), dtype=np.float64)[0]

EVEN = 1.5
"""White standard errors of a block that differ by less than this factor are taken as equal."""


@dataclass(frozen=True)
class DwellProfile:
    """Valid dwells, their times and white profile, common to the blocks of one whitener."""

    time: Array
    there: NDArray[np.bool_]
    profile: Array
    direction: Array | None = None

    def fits(self, time: Array, there: NDArray[np.bool_], profile: Array) -> bool:
        """Whether a block with these dwells can have the same whitener."""
        if self.direction is not None:
            return False
        alike = bool(np.array_equal(there, self.there)) and bool(np.all(np.abs(time - self.time) < 1.0))
        ratio = np.where(there, profile / self.profile, 1.0)
        return alike and float(ratio.max()) < EVEN and float(ratio.min()) > 1.0 / EVEN


def whitener_of(dwells: DwellProfile, index: list[int | None], wander: tuple[Array, Array]) -> tuple[Array, float]:
    """Lower triangle (n, n) that makes a block's noise white, and the log-determinant of its covariance.

    Parameters
    ----------
    index : steps of the lattice at which the shares of 1/f and of random walk stand; None for none
    wander : covariances (n, n) of 1/f and of random walk of variance one
    """
    there, whole = dwells.there, bool(dwells.there.all())
    covariance = np.diag(dwells.profile[there] ** 2)
    for i, kernel in zip(index, wander, strict=True):
        if i is not None:
            own = kernel if whole else kernel[np.ix_(there, there)]
            covariance += 10.0 ** (i / SHARE_STEP) * own
    # of the transpose, which is in Fortran order: no copy
    upper, failed = _factor(covariance.T, lower=0, clean=1, overwrite_a=1)
    if failed:
        raise np.linalg.LinAlgError("the covariance of the noise is not positive definite")
    logdet = 2.0 * float(np.sum(np.log(np.diagonal(upper))))
    inverse = _invert(upper, lower=0, overwrite_c=1)[0].T
    if whole:
        return inverse, logdet
    filled = np.zeros((there.size, there.size))
    filled[np.ix_(there, there)] = inverse
    return filled, logdet


def applied(lower: Array, series: Array) -> Array:
    """Series (blocks, m, n) times a lower triangle (n, n), by half of the products, as the matrix is triangular."""
    flat = np.ascontiguousarray(series).reshape(-1, lower.shape[0])
    return _times(1.0, lower.T, flat.T, side=0, lower=0, trans_a=1).T.reshape(series.shape)


def applied_back(lower: Array, series: Array) -> Array:
    """Series (..., n) times the transpose of a lower triangle (n, n), by half of the products."""
    flat = np.ascontiguousarray(series).reshape(-1, lower.shape[0])
    return _times(1.0, lower.T, flat.T, side=0, lower=0).T.reshape(series.shape)
