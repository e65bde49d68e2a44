"""What makes the noise of one set of dwells white: a lower triangle by Cholesky factors, or one factor for each dwell."""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import get_blas_funcs, get_lapack_funcs

from inertial.arrays import Array, Flags, Places
from inertial.decisions import SHARE_STEP

_factor, _invert = get_lapack_funcs(("potrf", "trtri"), dtype=np.float64)
_times, _solve = get_blas_funcs(("trmm", "trsm"), dtype=np.float64)

EVEN = 1.5
"""White standard errors of a block that differ by less than this factor are taken as equal."""


@dataclass(frozen=True)
class DwellProfile:
    """Valid dwells, their times and white profile, common to the blocks of one whitener.

    loudness : (n,), by which all noise of a dwell is larger than the lot's; one where it is not known
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
        """A covariance of wander (n, n), scaled by the loudness of the dwells."""
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
    """Profiles of dwells that whiteners are made for, and groups of blocks that have a whitener in common.

    A group is the index of its profile, the steps of the lattice by which its shares are larger than the lot's, and its blocks.

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
        # by quarters of a decade: levels within a factor of 1.3 share a whitener, the rest is in the block's own variance
        steps = 2 * round(0.5 * SHARE_STEP * np.log10(white / level[block] ** 2))
        groups.setdefault((index, steps), []).append(block)
    return profiles, [(index, steps, np.array(blocks)) for (index, steps), blocks in groups.items()]


@dataclass(frozen=True)
class Whitener:
    """What makes the noise of dwells white, of variance one over the block's level.

    there : (n,), the dwells that are not missing; the others become zero
    white : (n,), factors of the dwells for white noise alone
    logdet : log-determinant of the covariance of the dwells
    lower : (n, n), lower triangle where the noise wanders; None where it is white
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
        """Series (..., n) with white noise; ``overwrite``: the result may be written over them."""
        if self.lower is None:
            return np.multiply(series, self.white, out=series if overwrite else None)
        # half of the products, as the matrix is triangular
        flat = _flat(series)
        return _times(1.0, self.lower.T, flat.T, side=0, lower=0, trans_a=1, overwrite_b=overwrite).T.reshape(
            series.shape
        )

    def columns(self, columns: Array) -> Array:
        """Columns (b, n, m) with white noise."""
        if self.lower is None:
            return columns * self.white[:, None]
        return np.swapaxes(self.rows(np.swapaxes(columns, -1, -2)), -1, -2)

    def back(self, series: Array) -> Array:
        """Series (..., n) times the transpose of the whitener: their products with series in g are those of whitened ones."""
        if self.lower is None:
            return series * self.white
        return _times(1.0, self.lower.T, _flat(series).T, side=0, lower=0).T.reshape(series.shape)

    def coloured(self, series: Array) -> Array:
        """White series (..., n) with this noise; zero where a dwell is missing."""
        if self.lower is None:
            return series * np.divide(1.0, self.white, out=np.zeros_like(self.white), where=self.there)
        out = np.zeros(series.shape)
        inside = np.ascontiguousarray(self.lower[np.ix_(self.there, self.there)])
        flat = _flat(series[..., self.there])
        solved = _solve(1.0, inside.T, flat.T, side=0, lower=0, trans_a=1, overwrite_b=1).T
        out[..., self.there] = solved.reshape(*series.shape[:-1], -1)
        return out


def _flat(series: Array) -> Array:
    """Series (..., n) as rows, (m, n)."""
    return np.ascontiguousarray(series).reshape(-1, series.shape[-1])


def whitener_of(dwells: DwellProfile, index: list[int | None], wander: tuple[Array, Array] | None) -> Whitener:
    """The whitener of a block.

    Parameters
    ----------
    index : steps of the lattice at which the shares of 1/f and of random walk stand; None for none
    wander : covariances (n, n) of 1/f and of random walk of variance one; None for records too long for them
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
    # of the transpose, which is in Fortran order: no copy
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
