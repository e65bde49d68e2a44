"""Whitening of a lot's series: white noise, 1/f and random walk, with whiteners shared by equal blocks.

A block is the series of one unit and axis. Its covariance is s²·(diag(e²) + F·K_F + W·K_W), where e is the white standard error
of its dwells and F and W, in units of the lot's white variance, are the same for all blocks. Blocks that have the same dwells at
the same times and about the same white noise share a whitener; a missing dwell only leaves out its row.

Where only the norm of gravity is known, a block is a unit. Wander along one axis enters the norm in proportion to the force along
that axis: the kernels are then (F·K_F + W·K_W) ∘ (u·uᵀ) with the directions u of the force.
"""

from collections import OrderedDict
from collections.abc import Iterator
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular

from inertial.criticism.decisions import SHARE_STEP
from inertial.criticism.noise import LONGEST, walk_kernel
from inertial.criticism.noise_shares import Noise, Shares
from inertial.criticism.whitener import EVEN, DwellProfile, applied, whitener_of
from inertial.noise.flicker import flicker_kernel

Array = NDArray[np.float64]

_FEW = 16
"""Columns of a block up to which a triangular product, including its transposition, is faster than a general one."""

_WHITENERS = 12_000_000
"""Largest number of stored whiteners."""

_COLUMNS = 6_000_000
"""Largest number of whitened columns stored between passes; more are computed again."""


LARGE = 15_000
"""Values of a column of all blocks above which columns are not stored between passes: a store has room for a small part of those
that a pass goes through in turn, and each would be gone before it is used again."""


@lru_cache(maxsize=256)
def _lattice(shares: Shares) -> tuple[int | None, ...]:
    """The steps of the lattice at which shares stand; None for none."""
    return tuple(None if s <= 0.0 else round(SHARE_STEP * np.log10(s)) for s in shares)


class Covariance:
    """The covariances of all blocks, at any shares of wander.

    Parameters
    ----------
    time : (blocks, n), s
    error : (blocks, n), white standard error of each dwell, g; infinite where a dwell is missing
    direction : (blocks, n, 3), unit vectors of the force where the measurement is its norm; None where it is one axis' output
    """

    def __init__(self, time: Array, error: Array, direction: Array | None = None) -> None:
        self.there = np.isfinite(error)
        self.count = self.there.sum(axis=1)
        white = np.where(self.there, error, 0.0) ** 2
        typical = np.sqrt(white.sum(axis=1) / np.maximum(self.count, 1))
        known = typical > 0.0
        self.level = np.where(known, typical, np.median(typical[known]) if known.any() else 1.0)
        self.white = float(np.exp(np.mean(np.log(self.level**2))))
        """White variance that is the unit of the shares, g²."""
        self.span = max(float(np.ptp(time)), 1.0)
        self._kernels: list[DwellProfile] = []
        self._groups = self._grouped(time, error, direction)
        self._whiteners: OrderedDict[tuple[int, int | None, int | None], tuple[Array, float]] = OrderedDict()
        self._kept: OrderedDict[tuple[object, Shares], Array] = OrderedDict()
        self._used = 0

    def _grouped(self, time: Array, error: Array, direction: Array | None) -> list[tuple[int, int, NDArray[np.intp]]]:
        """(kernel, steps by which its shares are larger than the lot's, blocks)."""
        groups: dict[tuple[int, int], list[int]] = {}
        for block, there in enumerate(self.there):
            profile = np.where(there, np.where(there, error[block], 1.0) / self.level[block], 1.0)
            own = profile[there]
            if own.size and own.max() < EVEN * own.min():
                profile = np.ones_like(profile)
            place = next((i for i, k in enumerate(self._kernels) if k.fits(time[block], there, profile)), None)
            if place is None:
                place = len(self._kernels)
                way = None if direction is None else direction[block]
                self._kernels.append(DwellProfile(time[block], there, profile, way))
            # by quarters of a decade: levels within a factor of 1.3 share a whitener, the rest is in the block's own variance
            steps = 2 * round(0.5 * SHARE_STEP * np.log10(self.white / self.level[block] ** 2))
            groups.setdefault((place, steps), []).append(block)
        return [(place, steps, np.array(blocks)) for (place, steps), blocks in groups.items()]

    @cached_property
    def _wander(self) -> tuple[Array, Array] | None:
        """Covariances of 1/f and of random walk of variance one, (kernels, n, n); None for records too long for them."""
        if self.there.shape[1] > LONGEST:
            return None
        time = np.stack([k.time for k in self._kernels])
        flicker, walk = flicker_kernel(time), walk_kernel(time)
        ways = [k.direction for k in self._kernels if k.direction is not None]
        if ways:
            along = np.stack([way @ way.T for way in ways])
            flicker, walk = flicker * along, walk * along
        return flicker, walk

    def about_mean(self, shares: Shares) -> Array:
        """Mean variance of the wander of each block about its record's own mean, over its white variance, (blocks,)."""
        variance = np.zeros(len(self.level))
        if self._wander is None:
            return variance
        for place, steps, blocks in self._groups:
            there = self._kernels[place].there
            for share, kernel in zip(shares, self._wander, strict=True):
                own = kernel[place][np.ix_(there, there)]
                n = max(len(own), 1)
                variance[blocks] += share * 10.0 ** (steps / SHARE_STEP) * (np.trace(own) / n - own.sum() / n**2)
        return variance

    def side_by_side(self, shares: Shares) -> Array:
        """Half the mean variance of the wander's steps from one dwell to the next, over the white variance, (blocks,)."""
        variance = np.zeros(len(self.level))
        if self._wander is None:
            return variance
        for place, steps, blocks in self._groups:
            there = self._kernels[place].there
            for share, kernel in zip(shares, self._wander, strict=True):
                own = kernel[place][np.ix_(there, there)]
                if len(own) > 1:
                    each = np.diagonal(own)
                    step = 0.5 * (each[1:] + each[:-1]) - np.diagonal(own, 1)
                    variance[blocks] += share * 10.0 ** (steps / SHARE_STEP) * float(np.mean(step))
        return variance

    def _whitener(self, place: int, steps: int, shares: Shares) -> tuple[Array, float] | None:
        """Lower triangle (n, n) that makes a block's noise white, and the log-determinant of its covariance."""
        wander = self._wander
        if wander is None:
            return None
        index = [None if step is None else step + steps for step in _lattice(shares)]
        if index == [None, None]:
            return None
        key = (place, index[0], index[1])
        if key not in self._whiteners:
            self._whiteners[key] = whitener_of(self._kernels[place], index, (wander[0][place], wander[1][place]))
            # applied to many blocks, a whitener costs little beside its use
            room = _WHITENERS if self.there.size <= LARGE else _WHITENERS // 4
            most = max(room // self.there.shape[1] ** 2, 4)
            while len(self._whiteners) > most:
                self._whiteners.popitem(last=False)
        self._whiteners.move_to_end(key)
        return self._whiteners[key]

    def whiten(self, columns: Array, shares: Shares, blocks: NDArray[np.intp] | None = None) -> Array:
        """Columns (blocks, n, m) of all or some blocks with white noise of variance s² in them; zero where a dwell is missing."""
        if len(self._groups) == 1:
            place, steps, _ = self._groups[0]
            level = self.level if blocks is None else self.level[blocks]
            whitener = self._whitener(place, steps, shares)
            if whitener is not None:
                if columns.shape[-1] > _FEW:
                    white = np.matmul(whitener[0], columns)
                    white /= level[:, None, None]
                    return white
                own = columns / level[:, None, None]
                return np.swapaxes(applied(whitener[0], np.swapaxes(own, -1, -2)), -1, -2)
        place_of = np.arange(len(self.level)) if blocks is None else blocks
        where = np.full(len(self.level), -1)
        where[place_of] = np.arange(place_of.size)
        out = np.empty(columns.shape)
        for place, steps, members in self._groups:
            rows = where[members]
            rows = rows[rows >= 0]
            if rows.size:
                own = columns[rows] / self.level[place_of[rows], None, None]
                whitener = self._whitener(place, steps, shares)
                if whitener is None:
                    kernel = self._kernels[place]
                    out[rows] = own * np.where(kernel.there, 1.0 / kernel.profile, 0.0)[:, None]
                else:
                    n, m = columns.shape[1:]
                    flat = whitener[0] @ own.transpose(1, 0, 2).reshape(n, -1)
                    out[rows] = flat.reshape(n, rows.size, m).transpose(1, 0, 2)
        return out

    def _repeated(self, columns: Array, shares: Shares, distinct: int) -> Array | None:
        """Columns of which only so many blocks differ, whitened once; None where blocks have whiteners of their own."""
        if len(self._groups) > 1:
            return None
        place, steps, _ = self._groups[0]
        whitener = self._whitener(place, steps, shares)
        if whitener is None:
            return None
        few = np.matmul(whitener[0], columns[:distinct])
        whole = few[np.newaxis] / self.level.reshape(-1, distinct, 1, 1)
        return whole.reshape(columns.shape)

    def whiteners(self, shares: Shares) -> Iterator[tuple[NDArray[np.intp], Array]]:
        """Blocks that share a whitener, and the whitener (n, n), lower triangle, for white noise of variance one."""
        for place, steps, members in self._groups:
            whitener = self._whitener(place, steps, shares)
            kernel = self._kernels[place]
            yield (
                members,
                np.diag(np.where(kernel.there, 1.0 / kernel.profile, 0.0)) if whitener is None else whitener[0],
            )

    def coloured(self, noise: Noise, drawn: Array) -> Array:
        """Series (blocks, n, m), g, with this noise, from independent normal numbers; zero where a dwell is missing."""
        out = np.empty(drawn.shape)
        for place, steps, members in self._groups:
            kernel = self._kernels[place]
            whitener = self._whitener(place, steps, noise.shares)
            n, m = drawn.shape[1:]
            flat = drawn[members].transpose(1, 0, 2).reshape(n, -1)
            made = np.zeros_like(flat)
            if whitener is None:
                made = flat * (kernel.profile * kernel.there)[:, None]
            else:
                there = kernel.there
                made[there] = solve_triangular(whitener[0][np.ix_(there, there)], flat[there], lower=True)
            own = made.reshape(n, members.size, m).transpose(1, 0, 2)
            out[members] = own * (self.level * noise.scale)[members, None, None]
        return out

    def whitened(
        self,
        key: object,
        columns: Array,
        shares: Shares,
        blocks: NDArray[np.intp] | None = None,
        *,
        distinct: int | None = None,
    ) -> Array:
        """The same, kept under a key for the next time.

        Parameters
        ----------
        distinct : how many blocks, the first, have columns of their own, which the others repeat in turn; all where None
        """
        name = (key, shares)
        white = self._kept.get(name)
        if white is None:
            white = self._repeated(columns, shares, distinct) if distinct and blocks is None else None
            white = self.whiten(columns, shares, blocks) if white is None else white
            if self.there.size > LARGE:
                return white
            self._kept[name] = white
            self._used += white.size
            while self._used > _COLUMNS and self._kept:
                self._used -= self._kept.popitem(last=False)[1].size
        else:
            self._kept.move_to_end(name)
        return white

    def logdet(self, shares: Shares) -> Array:
        """Log-determinants of the blocks' covariances over their white variance, (blocks,)."""
        logdets = np.zeros(len(self.level))
        for place, steps, members in self._groups:
            kernel = self._kernels[place]
            whitener = self._whitener(place, steps, shares)
            white = 2.0 * float(np.sum(np.log(kernel.profile[kernel.there])))
            logdets[members] = white if whitener is None else whitener[1]
        return logdets

    def white_noise(self) -> Noise:
        """White noise as stated by the errors."""
        return Noise(Shares(), np.ones(len(self.level)))

    def rescaled(self, noise: Noise, other: "Covariance") -> Noise:
        """Noise of another covariance, of the same blocks, in the units of this one."""
        factor = other.white / self.white
        shares = Shares(noise.shares.flicker * factor, noise.shares.walk * factor * self.span / other.span)
        return Noise(shares, noise.scale, noise.prior)
