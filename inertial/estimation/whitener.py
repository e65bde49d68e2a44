"""Whitening transformations: an inverse Cholesky factor for noise with wander, a factor per dwell for white noise."""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import get_blas_funcs, get_lapack_funcs

from inertial.arrays import Array, Flags, Places
from inertial.decisions import SHARE_STEP

_factor, _invert = get_lapack_funcs(("potrf", "trtri"), dtype=np.float64)
_times, _solve = get_blas_funcs(("trmm", "trsm"), dtype=np.float64)

EVEN = 1.5
"""White standard errors that differ by less than this factor are treated as equal."""


@dataclass(frozen=True)
class DwellProfile:
    """Times of the dwells, which of them are valid, and their relative white noise, common to the blocks of a whitener.

    time : (n,), s; there : (n,), whether a dwell is valid; direction : (n, 3), unit vectors of the force, for norms only
    profile : (n,), white standard error over the block's typical one; loudness : (n,), standard deviation over the lot's, or 1
    """

    time: Array
    there: Flags
    profile: Array
    direction: Array | None = None
    loudness: Array | float = 1.0

    @property
    def white(self) -> Array:
        """Standard deviation of the white noise of each dwell over the block's, (n,)."""
        return self.profile * self.loudness

    def louder(self, kernel: Array) -> Array:
        """A covariance of wander (n, n), scaled by the loudness of both dwells."""
        if not isinstance(self.loudness, np.ndarray):
            return kernel
        return kernel * (self.loudness[:, None] * self.loudness)

    def fits(self, time: Array, there: Flags, profile: Array) -> bool:
        """Whether a block with these dwells can have the same whitener."""
        if self.direction is not None:
            return False
        alike = bool(np.array_equal(there, self.there)) and bool(np.all(np.abs(time - self.time) < 1.0))
        ratio = np.where(there, profile / self.profile, 1.0)
        return alike and float(ratio.max()) < EVEN and float(ratio.min()) > 1.0 / EVEN


def grouped(
    time: Array, error: Array, direction: Array | None, level: Array, white: float, loudness: Array | None = None
) -> tuple[list[DwellProfile], list[tuple[int, int, Places]]]:
    """The distinct profiles of dwells, and the groups of blocks that share a whitener.

    A group is (index of its profile, lattice steps by which its shares exceed the lot's, indices of its blocks).

    Parameters
    ----------
    time, error : (blocks, n); direction : (blocks, n, 3) or None; as of :class:`inertial.estimation.covariance.Covariance`
    level : (blocks,), typical white standard error, g; white : the lot's white variance, g²
    loudness : (n,), of the dwells of all blocks
    """
    louder = 1.0 if loudness is None else loudness
    profiles: list[DwellProfile] = []
    groups: dict[tuple[int, int], list[int]] = {}
    for block, there in enumerate(np.isfinite(error)):
        profile = np.where(there, np.where(there, error[block], 1.0) / level[block], 1.0)
        present = profile[there]
        if present.size and present.max() < EVEN * present.min():
            profile = np.ones_like(profile)
        index = next((i for i, known in enumerate(profiles) if known.fits(time[block], there, profile)), None)
        if index is None:
            index = len(profiles)
            way = None if direction is None else direction[block]
            profiles.append(DwellProfile(time[block], there, profile, way, louder))
        # in quarter decades: levels within a factor of 1.3 share a whitener, the block's variance absorbs the difference
        steps = 2 * round(0.5 * SHARE_STEP * np.log10(white / level[block] ** 2))
        groups.setdefault((index, steps), []).append(block)
    return profiles, [(index, steps, np.array(blocks)) for (index, steps), blocks in groups.items()]


@dataclass(frozen=True)
class Whitener:
    """Transformation that makes the noise of a block's dwells white, of variance one in units of the block's level squared.

    there : (n,), whether a dwell is present; missing dwells become zero
    white : (n,), factor of each dwell for white noise alone
    logdet : log-determinant of the covariance of the present dwells
    lower : (n, n), lower-triangular matrix for noise with wander; None for white noise
    """

    there: Flags
    white: Array
    logdet: float
    lower: Array | None = None

    @property
    def matrix(self) -> Array:
        """The whitener as a matrix (n, n)."""
        return np.diag(self.white) if self.lower is None else self.lower

    @property
    def precision(self) -> Array:
        """Diagonal (n,) of the inverse covariance."""
        return self.white**2 if self.lower is None else np.einsum("mn,mn->n", self.lower, self.lower)

    def rows(self, series: Array, *, overwrite: bool = False) -> Array:
        """Whitened series (..., n); with ``overwrite`` the input may be overwritten."""
        if self.lower is None:
            return np.multiply(series, self.white, out=series if overwrite else None)
        # trmm needs half of the products of a full matrix
        flat = _flat(series)
        return _times(1.0, self.lower.T, flat.T, side=0, lower=0, trans_a=1, overwrite_b=overwrite).T.reshape(
            series.shape
        )

    def columns(self, columns: Array) -> Array:
        """Whitened columns (b, n, m)."""
        if self.lower is None:
            return columns * self.white[:, None]
        return np.swapaxes(self.rows(np.swapaxes(columns, -1, -2)), -1, -2)

    def back(self, series: Array) -> Array:
        """Whitened series (..., n) times the whitener: products of the result with series in g are those in whitened space."""
        if self.lower is None:
            return series * self.white
        return _times(1.0, self.lower.T, _flat(series).T, side=0, lower=0).T.reshape(series.shape)

    def coloured(self, series: Array) -> Array:
        """White series (..., n) transformed to this noise, the inverse of :meth:`rows`; zero where a dwell is missing."""
        if self.lower is None:
            return series * np.divide(1.0, self.white, out=np.zeros_like(self.white), where=self.there)
        out = np.zeros(series.shape)
        inside = np.ascontiguousarray(self.lower[np.ix_(self.there, self.there)])
        flat = _flat(series[..., self.there])
        solved = _solve(1.0, inside.T, flat.T, side=0, lower=0, trans_a=1, overwrite_b=1).T
        out[..., self.there] = solved.reshape(*series.shape[:-1], -1)
        return out


def _flat(series: Array) -> Array:
    """Series (..., n) as contiguous rows, (m, n)."""
    return np.ascontiguousarray(series).reshape(-1, series.shape[-1])


def whitener_of(dwells: DwellProfile, index: list[int | None], wander: tuple[Array, Array] | None) -> Whitener:
    """The whitener of a profile of dwells.

    Parameters
    ----------
    index : lattice indices of the shares of 1/f noise and random walk; None for a share of zero
    wander : covariances (n, n) of 1/f noise and random walk of variance one; None for records too long for them
    """
    there, complete = dwells.there, bool(dwells.there.all())
    white = np.where(there, 1.0 / dwells.white, 0.0)
    if wander is None or index == [None, None]:
        return Whitener(there, white, 2.0 * float(np.sum(np.log(dwells.white[there]))))
    covariance = np.zeros((there.size, there.size))
    covariance.reshape(-1)[:: there.size + 1] = dwells.white**2
    for i, each in zip(index, wander, strict=True):
        if i is not None:
            covariance += 10.0 ** (i / SHARE_STEP) * dwells.louder(each)
    if not complete:
        covariance = covariance[np.ix_(there, there)]
    # the transpose is in Fortran order, so that LAPACK needs no copy
    upper, failed = _factor(covariance.T, lower=0, clean=1, overwrite_a=1)
    if failed:
        raise np.linalg.LinAlgError("the covariance of the noise is not positive definite")
    logdet = 2.0 * float(np.sum(np.log(np.diagonal(upper))))
    lower = _invert(upper, lower=0, overwrite_c=1)[0].T
    if not complete:
        filled = np.zeros((there.size, there.size))
        filled[np.ix_(there, there)] = lower
        lower = filled
    return Whitener(there, white, logdet, lower)
