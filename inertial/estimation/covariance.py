"""Whitening of a lot's series: white noise, 1/f and random walk, with whiteners shared by equal blocks.

A block is the series of one unit and axis. Its covariance is s²·(diag(e²) + F·K_F + W·K_W), where e is the white standard error
of its dwells; F and W, in units of the lot's white variance, are the same for all blocks but those with shares estimated for
the block alone (:mod:`inertial.estimation.shares`). Blocks with the same dwell times and similar white noise share a whitener;
a missing dwell only leaves out its row.

Where only the norm of gravity is known, a block is a unit. Wander along one axis enters the norm in proportion to the force along
that axis: the kernels are then (F·K_F + W·K_W) ∘ (u·uᵀ) with the directions u of the force.
"""

from collections import OrderedDict
from collections.abc import Callable, Iterable, Iterator
from functools import cached_property, lru_cache

import numpy as np

from inertial.arrays import Array, Places
from inertial.decisions import SHARE_STEP
from inertial.estimation.candidate import Candidate
from inertial.estimation.noise_shares import LONGEST, Noise, Shares
from inertial.estimation.whitener import Whitener, grouped, whitener_of
from inertial.noise.flicker import flicker_kernel
from inertial.noise.measurands import walk_kernel

PIECE = 1_000_000
"""Largest number of column elements that are whitened at a time."""

_WHITENERS = 18_000_000
"""Largest number of stored matrix elements of whiteners."""

_PRODUCTS = 2_000_000
"""Largest number of stored products of columns."""

LARGE = 15_000
"""Number of measurements (blocks · dwells) above which columns are not stored between passes: the store would hold only a small
part of the columns of a pass, and each would be displaced before it is used again."""


@lru_cache(maxsize=256)
def _lattice_indices(shares: Shares) -> tuple[int | None, ...]:
    """Lattice indices of the shares of 1/f and of random walk; None for a share of zero."""
    return tuple(None if s <= 0.0 else round(SHARE_STEP * np.log10(s)) for s in (shares.flicker, shares.walk))


def _pieces(members: Places, size: int) -> list[Places]:
    """Member indices split into pieces small enough to be processed at a time; ``size``: elements of one member."""
    few = max(PIECE // max(size, 1), 1)
    return np.split(members, range(few, members.size, few))


def _half_step_variance(covariance: Array) -> float:
    """Half the mean variance of the steps between neighbouring dwells, from their covariance (n, n)."""
    if len(covariance) < 2:
        return 0.0
    each = np.diagonal(covariance)
    return float(np.mean(0.5 * (each[1:] + each[:-1]) - np.diagonal(covariance, 1)))


class Covariance:
    """The covariances of all blocks, at any shares of wander.

    Parameters
    ----------
    time : (blocks, n), s
    error : (blocks, n), white standard error of each dwell, g; infinite where a dwell is missing
    direction : (blocks, n, 3), unit vectors of the force where the measurement is its norm; None where it is one axis' output
    loudness : (n,), standard deviation of the noise of each dwell over the lot's; None where it is the same in all
    axes : number of blocks of a unit, whose coefficients units have in common; of all units where only the norm is known
    """

    def __init__(
        self, time: Array, error: Array, direction: Array | None = None, loudness: Array | None = None, axes: int = 1
    ) -> None:
        self.axes = axes
        self.there = np.isfinite(error)
        self.count = self.there.sum(axis=1)
        white = np.where(self.there, error, 0.0) ** 2
        typical = np.sqrt(white.sum(axis=1) / np.maximum(self.count, 1))
        known = typical > 0.0
        self.level = np.where(known, typical, np.median(typical[known]) if known.any() else 1.0)
        self.white = float(np.exp(np.mean(np.log(self.level**2))))
        """White variance that is the unit of the shares, g²."""
        self.span = max(float(np.ptp(time)), 1.0)
        self._kernels, self._groups = grouped(time, error, direction, self.level, self.white, loudness)
        self._whiteners: OrderedDict[tuple[int, int | None, int | None], Whitener] = OrderedDict()
        self._store: OrderedDict[tuple[object, Shares], Array] = OrderedDict()
        self._used = 0

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

    def forget(self) -> None:
        """Drop the stored products."""
        self._store.clear()
        self._used = 0

    def like(self, larger: "Covariance") -> None:
        """Use the whiteners of another covariance, of more blocks, if both have a single and equal profile of dwells."""
        kernels, whiteners = larger._kernels, larger._whiteners  # noqa: SLF001  # of its own kind
        kernel, other = self._kernels[0], kernels[0]
        same = len(self._kernels) == len(kernels) == 1 and other.fits(kernel.time, kernel.there, kernel.profile)
        if same and np.array_equal(kernel.time, other.time):
            self._whiteners = whiteners

    def squares_left(self, noise: Noise, local: Array, shared: Array, residual: Array) -> tuple[float, float]:
        """Expected and actual sum of squares, g², of the residuals of a fit weighted by the white errors.

        With P = I − LLᵀ of the block's own columns, each block's residuals P·z − S·Σ Sᵀz have the covariance
        P·V·P − P·V·S·Sᵀ − S·Sᵀ·V·P + S·(Σ SᵀVS)·Sᵀ, of which the diagonal counts.

        Parameters
        ----------
        local, shared : (blocks, n, p) and (blocks, n, t), orthonormal columns of each block and of all together
        residual : (blocks, n); all three weighted by the white errors within the block, and of equal weight for all blocks
        """
        terms = shared.shape[-1]
        left, held, between, weight = 0.0, 0.0, np.zeros((terms, terms)), np.zeros((terms, terms))
        for members, variance, white in self._variances(noise.shares):
            for some in _pieces(members, local[0].size):
                size = (self.level * noise.scale)[some] ** 2 / self.white
                basis, common = local[some], shared[some]
                along, beside = variance @ basis, variance @ common
                inner = np.swapaxes(basis, -1, -2) @ along
                free = beside - basis @ (np.swapaxes(basis, -1, -2) @ beside)
                each = np.diagonal(variance) + np.sum((basis @ inner - 2.0 * along) * basis, axis=-1)
                each = each - 2.0 * np.sum(free * common, axis=-1)
                left += float(np.sum(size[:, None] * white**2 * each))
                held += float(np.sum((white * residual[some]) ** 2))
                between += np.einsum("bnt,bns,b->ts", common, beside, size)
                weight += np.einsum("bnt,bns,n->ts", common, common, white**2)
        return self.white * (left + float(np.sum(weight * between))), self.white * held

    def _variances(self, shares: Shares) -> Iterator[tuple[Places, Array, Array]]:
        """Groups of blocks with equal covariance: the blocks, their covariance (n, n) over the white one, white errors (n,).

        Covariance and errors are zero where a dwell is missing.
        """
        for index, steps, blocks, common in self._groups_at(shares):
            kernel = self._kernels[index]
            variance = np.diag(kernel.there.astype(np.float64))
            for share, each in zip((common.flicker, common.walk), self._wander or (), strict=False):
                louder = share * 10.0 ** (steps / SHARE_STEP) * each[index] / np.outer(kernel.profile, kernel.profile)
                variance += np.where(np.outer(kernel.there, kernel.there), louder, 0.0)
            yield blocks, variance, np.where(kernel.there, kernel.white, 0.0)

    def side_by_side(self, shares: Shares) -> Array:
        """Half the mean variance of the wander's steps between neighbouring dwells, over the white variance, (blocks,)."""
        return self._of_wander(shares, _half_step_variance)

    def _of_wander(self, shares: Shares, variance_of: Callable[[Array], float]) -> Array:
        """A variance of the wander of each block over its white variance, (blocks,), from the covariance of its dwells."""
        variance = np.zeros(len(self.level))
        for index, steps, blocks, common in self._groups_at(shares) if self._wander is not None else ():
            there = self._kernels[index].there
            for share, kernel in zip((common.flicker, common.walk), self._wander or (), strict=True):
                covariance = self._kernels[index].louder(kernel[index])[np.ix_(there, there)]
                variance[blocks] += share * 10.0 ** (steps / SHARE_STEP) * variance_of(covariance)
        return variance

    def _groups_at(self, shares: Shares) -> list[tuple[int, int, Places, Shares]]:
        """Groups of blocks that share a whitener at given shares: index of the profile, steps, blocks, and their shares."""
        common = shares.common
        if not shares.by_block:
            return [(*group, common) for group in self._groups]
        apart = np.array([block for block, _, _ in shares.by_block])
        groups = [(index, steps, blocks[~np.isin(blocks, apart)], common) for index, steps, blocks in self._groups]
        groups = [group for group in groups if group[2].size]
        for block, flicker, walk in shares.by_block:
            groups.append((*self._group_of[block], np.array([block]), Shares(flicker, walk)))
        return groups

    @cached_property
    def _group_of(self) -> dict[int, tuple[int, int]]:
        """For each block the index of its profile, and the lattice steps by which its shares exceed the lot's."""
        return {int(block): (index, steps) for index, steps, blocks in self._groups for block in blocks}

    def like_of(self, block: int, noise: Noise) -> tuple[object, ...]:
        """A key that is equal for blocks whose noise covariances differ by a factor only."""
        return (*self._group_of[block], noise.shares.of_block(block))

    def whitener_of_block(self, block: int, shares: Shares) -> Whitener:
        """The whitener of a block at given shares."""
        return self._whitener(*self._group_of[block], shares)

    def _whitener(self, profile_index: int, steps: int, shares: Shares) -> Whitener:
        index = [None if step is None else step + steps for step in _lattice_indices(shares)]
        key = (profile_index, index[0], index[1])
        if key not in self._whiteners:
            wander = self._wander if index != [None, None] else None
            kernels = None if wander is None else (wander[0][profile_index], wander[1][profile_index])
            self._whiteners[key] = whitener_of(self._kernels[profile_index], index, kernels)
            # for many blocks, making a whitener costs little compared with applying it: fewer are stored
            room = _WHITENERS if self.there.size <= LARGE else _WHITENERS // 6
            most = max(room // self.there.shape[1] ** 2, 4)
            while len(self._whiteners) > most:
                self._whiteners.popitem(last=False)
        self._whiteners.move_to_end(key)
        return self._whiteners[key]

    def _by_whitener(self, shares: Shares, blocks: Places | None = None) -> Iterator[tuple[Places, Whitener]]:
        """Groups of blocks that share a whitener, as positions among ``blocks`` (all if None), and the whitener of each."""
        where = np.arange(len(self.level))
        if blocks is not None:
            where = np.full(len(self.level), -1)
            where[blocks] = np.arange(blocks.size)
        for index, steps, members, common in self._groups_at(shares):
            positions = where[members]
            positions = positions[positions >= 0]
            if positions.size:
                yield positions, self._whitener(index, steps, common)

    def whiten(self, columns: Array, shares: Shares, blocks: Places | None = None) -> Array:
        """Columns (blocks, n, m) of all or some blocks, whitened to noise of variance s²; zero where a dwell is missing."""
        level = self.level if blocks is None else self.level[blocks]
        out = np.empty(columns.shape)
        for members, whitener in self._by_whitener(shares, blocks):
            for some in _pieces(members, columns[0].size):
                out[some] = whitener.columns(columns[some] / level[some, None, None])
        return out

    def whiteners(self, shares: Shares) -> Iterator[tuple[Places, Array]]:
        """Groups of blocks that share a whitener, and the whitener (n, n), lower triangular, for white noise of variance one."""
        return ((members, whitener.matrix) for members, whitener in self._by_whitener(shares))

    def coloured(self, noise: Noise, drawn: Array) -> Array:
        """Series (blocks, m, n), g, with this noise, made in place from independent normal numbers; zero at missing dwells."""
        for members, whitener in self._by_whitener(noise.shares):
            for some in _pieces(members, drawn[0].size):
                drawn[some] = whitener.coloured(drawn[some]) * (self.level * noise.scale)[some, None, None]
        return drawn

    def white_rows(self, rows: Array, shares: Shares, blocks: slice) -> Array:
        """Series (b, m, n) of some blocks, whitened in place: noise of variance one after division by the level."""
        for members, whitener in self._by_whitener(shares, np.arange(len(self.level))[blocks]):
            if members.size == len(rows):
                return whitener.rows(rows, overwrite=True)
            rows[members] = whitener.rows(rows[members], overwrite=True)
        return rows

    def back(self, rows: Array, shares: Shares, blocks: Places | None = None) -> Array:
        """Rows (blocks, k, n) of whitened series of all or some blocks times the whiteners, for white noise of variance one."""
        out = np.empty(rows.shape)
        for members, whitener in self._by_whitener(shares, blocks):
            for some in _pieces(members, rows[0].size):
                out[some] = whitener.back(rows[some])
        return out

    def solved(self, columns: Array, column_of: Places, shares: Shares) -> Iterator[tuple[Places, Places, Array]]:
        """V⁻¹ times columns, for white noise of variance one: blocks that share a whitener, their columns, and rows (k, n).

        Parameters
        ----------
        columns : (rows, n); column_of : (blocks, p), the columns of each block
        """
        for members, whitener in self._by_whitener(shares):
            distinct = np.unique(column_of[members])
            yield members, distinct, whitener.back(whitener.rows(columns[distinct]))

    def precision(self, noise: Noise) -> Array:
        """Diagonal of V⁻¹ of every block, (blocks, n), 1/g²; zero where a dwell is missing."""
        out = np.empty(self.there.shape)
        for members, whitener in self._by_whitener(noise.shares):
            out[members] = whitener.precision
        return out / (self.level * noise.scale)[:, None] ** 2

    def products(self, candidate: Candidate, shares: Shares) -> Array:
        """Products cᵀV⁻¹c of columns with each other, for each value of their nonlinear parameters, (b, grid, p, p).

        They depend on the columns and the shares alone, and are stored for the models that are tried at the same shares.
        """
        name = (candidate.key, shares)
        stored = None if candidate.key is None else self._store.get(name)
        if stored is None:
            level = self.level if candidate.blocks is None else self.level[candidate.blocks]
            stored = _products_of(candidate, level, self._by_whitener(shares, candidate.blocks))
            if candidate.key is not None:
                self._store[name] = stored
                self._used += stored.size
                while self._used > _PRODUCTS and self._store:
                    self._used -= self._store.popitem(last=False)[1].size
        else:
            self._store.move_to_end(name)
        return stored

    def logdet(self, shares: Shares) -> Array:
        """Log-determinants of the blocks' covariances over their white variance, (blocks,)."""
        logdets = np.zeros(len(self.level))
        for members, whitener in self._by_whitener(shares):
            logdets[members] = whitener.logdet
        return logdets

    def of_dwells(self, block: int, noise: Noise, dwells: Places) -> Array:
        """Covariance (k, k), g², of some dwells of a block."""
        index, steps = self._group_of[block]
        kernel = self._kernels[index]
        covariance, shares = np.diag(kernel.white**2), noise.shares.of_block(block)
        for share, each in zip((shares.flicker, shares.walk), self._wander or (), strict=False):
            covariance = covariance + share * 10.0 ** (steps / SHARE_STEP) * kernel.louder(each[index])
        return covariance[np.ix_(dwells, dwells)] * float(self.level[block] * noise.scale[block]) ** 2

    def white_noise(self) -> Noise:
        """White noise as stated by the errors."""
        return Noise(Shares(), np.ones(len(self.level)))

    def rescaled(self, noise: Noise, other: "Covariance") -> Noise:
        """Noise of another covariance, of the same blocks, in the units of this one."""
        factor = other.white / self.white
        return Noise(noise.shares.times(factor, factor * self.span / other.span), noise.scale, noise.prior)


def _products_of(candidate: Candidate, level: Array, groups: Iterable[tuple[Places, Whitener]]) -> Array:
    """Products cᵀV⁻¹c (b, grid, p, p) of a candidate's columns; rows that blocks share are whitened once.

    Parameters
    ----------
    level : (b,), typical white standard error of each block, g; groups : places of the blocks that share a whitener, and it
    """
    columns = candidate.columns
    count, _, grid, p = columns.shape
    row_of = np.arange(count) if candidate.rows is None else candidate.rows
    out = np.empty((level.size, grid, p, p))
    for members, whitener in groups:
        rows, back = np.unique(row_of[members], return_inverse=True)
        parts = [_squares(columns[some], whitener) for some in _pieces(rows, columns[0].size)]
        out[members] = np.concatenate(parts)[back]
    return out / level[:, None, None, None] ** 2


def _squares(columns: Array, whitener: Whitener) -> Array:
    """Products (rows, grid, p, p) of columns (rows, n, grid, p) with each other after whitening."""
    rows, n, grid, p = columns.shape
    white = whitener.rows(columns.transpose(0, 2, 3, 1).reshape(rows * grid, p, n))
    return (white @ np.swapaxes(white, -1, -2)).reshape(rows, grid, p, p)
