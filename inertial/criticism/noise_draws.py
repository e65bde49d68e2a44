"""Simulated noise of a model's covariance: smallest p-value of each draw, with shares and variances estimated from the draw.

Draws are stored as rows, (blocks, draws, n), so that groups of blocks fit into the cache and no series is transposed.
"""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.random import Generator

from inertial.arrays import Array, Places
from inertial.data_errors.tails import heavy
from inertial.decisions import LEAST_SHARE
from inertial.estimation.bases import SEEN, eigen, inverse_roots
from inertial.estimation.candidate import Candidate, times_rows
from inertial.estimation.likelihood import known_together, several
from inertial.estimation.model import Model
from inertial.estimation.noise_shares import Noise, Shares
from inertial.estimation.shares import nearest_point, shares_at
from inertial.estimation.space import Space
from inertial.probability import log_f_tail

_PIECE = 150_000
"""Largest number of values worked on at a time."""

_KEPT = 3_200_000
"""Largest number of matrix elements of bases that are stored for further draws."""

_OFF = (-8, -4, 0, 4, 8)
"""Offsets from the fitted shares, in eighths of a decade, at which the noise of a draw is estimated."""


@dataclass(frozen=True)
class _Basis:
    """Orthonormal basis of a model's whitened columns at given shares.

    q : (blocks, n, p), basis; by_block : (blocks,), residual degrees of freedom, with sum ``dof``
    determinants : sum of the log-determinants of covariance and information
    """

    shares: Shares
    q: Array
    by_block: Array
    dof: int
    determinants: float


class NoiseDraws:
    """Draws of a model's noise: normal, or the model's residuals resampled where their tails are heavy.

    Parameters
    ----------
    rng : generator; the draws do not depend on how many are processed at a time
    """

    def __init__(self, model: Model, rng: Generator) -> None:
        self.model, self.rng = model, rng
        self.lattice, self.start = _lattice_around(model.noise.shares)
        left = model.space.residual[model.problem.covariance.there]
        self.heavy = heavy(left)
        self._values = left / np.sqrt(np.mean(left**2))
        self._bases: dict[int, _Basis] = {}
        self._directions: dict[tuple[int, int], Directions] = {}
        self._states: list[Mapping[str, object]] = []

    def worst(self, looks: Iterable[Candidate], count: int, batches: int = 1) -> Array:
        """Smallest log p-value over all tests, for each of ``count`` further draws per batch, (batches, count).

        Parameters
        ----------
        looks : the tests, the same for all draws
        batches : number of batches, drawn one after the other and processed together
        """
        rows = self._drawn(count, batches)
        count *= batches
        chosen = self._estimated(rows)
        order = np.argsort(chosen, kind="stable")
        for some in _some_blocks(rows):
            rows[some] = np.take(rows[some], order, axis=1)
        points, first = np.unique(chosen[order], return_index=True)
        groups = [slice(a, b) for a, b in zip(first, [*first[1:], count], strict=True)]
        total = np.concatenate(
            [self._residual_squares(rows, point, draws) for point, draws in zip(points.tolist(), groups, strict=True)]
        )
        dof = {point: self._basis(point).dof for point in points.tolist()}
        worst, spaces = np.zeros(count), dict[int, Space]()
        # products of at most as many columns as dwells take no more memory than the draws
        for look, candidate in enumerate(piece for test in looks for piece in test.pieces(self.model.problem.n)):
            along = times_rows(rows, candidate)
            for point, draws in zip(points.tolist(), groups, strict=True):
                if (look, point) not in self._directions:
                    if point not in spaces:
                        spaces[point] = self.model.at(Noise(self._shares(point), self.model.noise.scale))
                    found = Directions.of(spaces[point], candidate, together=several(self.model))
                    self._directions[look, point] = found
                for drop, rank, known in self._directions[look, point].drops(along[..., draws]):
                    after = dof[point] - rank
                    if rank and after > 0:
                        ratio = (drop / rank) / (np.maximum(total[draws] - drop, 1e-300) / after)
                        worst[draws] = np.minimum(worst[draws], log_f_tail(ratio, rank, min(after, known)))
        drawn = np.empty(count)
        drawn[order] = worst
        return drawn.reshape(batches, -1)

    def keep(self, batches: int) -> None:
        """Reset the generator to its state after the first ``batches`` of the last call."""
        self.rng.bit_generator.state = self._states[batches - 1]

    def _drawn(self, count: int, batches: int) -> Array:
        """Draws (blocks, batches · count, n) of the noise of the model, g."""
        problem = self.model.problem
        rows = np.empty((problem.blocks, batches * count, problem.n))
        self._states = []
        for first in range(0, batches * count, count):
            for some in _some_blocks(rows):
                shape = (len(rows[some]), problem.n, count)
                if self.heavy:  # the residuals of the model in random order
                    white = self._values[self.rng.integers(self._values.size, size=shape)]
                else:
                    white = self.rng.standard_normal(shape)
                rows[some, first : first + count] = np.swapaxes(white, 1, 2)
            self._states.append(self.rng.bit_generator.state)
        return problem.covariance.coloured(self.model.noise, rows)

    def _shares(self, point: int) -> Shares:
        flicker, walk = self.lattice
        return shares_at((flicker[point // len(walk)], walk[point % len(walk)]), self.model.noise.shares.by_block)

    def _basis(self, point: int) -> _Basis:
        """The basis of the model's columns at the shares of a point of the lattice."""
        if point not in self._bases:
            shares = self._shares(point)
            space = self.model.at(Noise(shares, np.ones(self.model.problem.blocks)))
            determinants = space.logdet + space.information
            made = _Basis(shares, space.q, space.by_block, space.dof, determinants)
            while self._bases and (len(self._bases) + 1) * made.q.size > _KEPT:
                del self._bases[next(iter(self._bases))]
            self._bases[point] = made
        return self._bases[point]

    def _estimated(self, rows: Array) -> Places:
        """Lattice point of smallest restricted deviance for each draw, (draws,), by descent from the shares that generated it."""
        across, columns = (len(each) for each in self.lattice)
        deviances = np.full((across * columns, rows.shape[1]), np.inf)
        done = np.zeros(deviances.shape, dtype=bool)
        best = np.full(rows.shape[1], self.start)
        while True:
            wanted = np.zeros(done.shape, dtype=bool)
            for draw, point in enumerate(best.tolist()):
                row, column = divmod(point, columns)
                near = np.zeros((across, columns), dtype=bool)
                near[max(row - 1, 0) : row + 2, max(column - 1, 0) : column + 2] = True
                wanted[:, draw] = near.ravel() & ~done[:, draw]
            if not wanted.any():
                return best
            for point in np.flatnonzero(wanted.any(axis=1)).tolist():
                draws = np.flatnonzero(wanted[point])
                deviances[point, draws] = self._deviances(self._basis(point), rows, draws)
            done |= wanted
            best = np.argmin(deviances, axis=0)

    def _deviances(self, basis: _Basis, rows: Array, draws: Places) -> Array:
        """Restricted deviance of some draws at the shares of a basis, (draws,), each block with its own variance."""
        covariance = self.model.problem.covariance
        log_squares = np.zeros(draws.size)
        for some in _some_blocks(rows):
            white = covariance.white_rows(np.take(rows[some], draws, axis=1), basis.shares, some)
            along = white @ basis.q[some]
            squares = np.einsum("bdn,bdn->bd", white, white) - np.einsum("bdp,bdp->bd", along, along)
            squares /= covariance.level[some, None] ** 2
            log_squares += basis.by_block[some] @ np.log(np.maximum(squares, 1e-300))
        return basis.determinants + log_squares

    def _residual_squares(self, rows: Array, point: int, draws: slice) -> Array:
        """Residual sums of squares (draws,) of draws with equal shares, over their estimated variances.

        ``rows`` of these draws are overwritten: their products with columns in g are then those with the whitened residuals.
        """
        covariance, noise, basis = self.model.problem.covariance, self.model.noise, self._basis(point)
        scale = covariance.level * noise.scale
        squares = np.empty((len(rows), rows[0, draws].shape[0]))
        for some in _some_blocks(rows):
            left = covariance.white_rows(rows[some, draws].copy(), basis.shares, some)
            left /= scale[some, None, None]
            q = basis.q[some]
            left -= (left @ q) @ np.swapaxes(q, -1, -2)
            squares[some] = np.einsum("bdn,bdn->bd", left, left)
            rows[some, draws] = covariance.back(left, basis.shares, np.arange(len(rows))[some])
        dof = basis.by_block[:, None]
        if np.isfinite(noise.prior):
            # in units of the fitted scale the prior is centred at 1
            variance = (squares + noise.prior) / (dof + noise.prior)
        else:
            variance = np.broadcast_to(squares.sum(axis=0) / max(float(dof.sum()), 1.0), squares.shape)
        rows[:, draws] /= (np.sqrt(variance) * scale[:, None])[..., None]
        return np.sum(squares / variance, axis=0)


@dataclass(frozen=True)
class Directions:
    """Orthonormal directions of a candidate's columns beyond the model, for each value of its nonlinear parameters.

    parts : for coefficients of each block, and for those by axis that all units share: (b, grid, p, p), which transforms products
        of the columns with a series, summed to b blocks, into those of the directions; (grid,), the number of directions; and
        the degrees of freedom of the noise of the sums
    """

    parts: tuple[tuple[Array, Places, float], ...]

    @staticmethod
    def of(space: Space, candidate: Candidate, *, together: bool = False) -> "Directions":
        """The directions of a candidate in a space; ``together``: also of coefficients that units share."""
        found = space.products(candidate)
        parts: list[tuple[Array, Places, float]] = []
        both = {len(found.left): np.inf} | ({space.covariance.axes: known_together(space)} if together else {})
        for blocks, known in ({1: np.inf} if candidate.shared else both).items():
            left, squares = _summed(found.left, blocks), _summed(found.squares, blocks)
            size = np.sqrt(np.where(squares > 0.0, squares, 1.0))
            values, vectors = eigen(left / (size[..., :, None] * size[..., None, :]))
            vectors = vectors * inverse_roots(values, SEEN**2)[..., None, :]
            parts.append(
                (np.swapaxes(vectors, -1, -2) / size[..., None, :], (values > SEEN**2).sum(axis=(0, 2)), known)
            )
        return Directions(tuple(parts))

    def drops(self, along: Array) -> Iterator[tuple[Array, int, float]]:
        """Reductions (draws,) of sums of squares, rank and degrees of freedom, from products (blocks, grid, p, draws)."""
        for turn, ranks, known in self.parts:
            onto = _summed(along, len(turn))
            # multiplied before they are squared: the squares of nearly vanishing columns overflow
            turned = turn * onto if turn.shape[-1] == 1 else turn @ onto
            drops = np.einsum("bgpd,bgpd->gd", turned, turned)
            yield from ((drop, rank, known) for drop, rank in zip(drops, ranks.tolist(), strict=True))


def _summed(values: Array, blocks: int) -> Array:
    """Values (b, …) of all blocks, summed to one block, to one per axis, or as they are."""
    return values if len(values) == blocks else values.reshape(-1, blocks, *values.shape[1:]).sum(axis=0)


def _some_blocks(rows: Array) -> list[slice]:
    """Slices of the blocks of ``rows`` (blocks, draws, n) that are processed together."""
    few = max(_PIECE // max(rows[0].size, 1), 1)
    return [slice(start, min(start + few, len(rows))) for start in range(0, len(rows), few)]


def _lattice_around(shares: Shares) -> tuple[tuple[list[int | None], list[int | None]], int]:
    """The lattice around fitted shares, for each share None and then rising indices; and the flat index of the fitted ones."""
    fitted = nearest_point(shares)
    rows, columns = (_indices_around(k) for k in fitted)
    return (rows, columns), rows.index(fitted[0]) * len(columns) + columns.index(fitted[1])


def _indices_around(k: int | None) -> list[int | None]:
    """Lattice indices at and around a share, after None for no share."""
    near = {LEAST_SHARE, LEAST_SHARE + 8} if k is None else {max(k + d, LEAST_SHARE) for d in _OFF}
    return [None, *sorted(near)]
