"""Adequacy of a model for the noise of the data: the largest of many test statistics against its own distribution."""

from collections.abc import Callable, Iterable, Iterator

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from inertial.criticism.bases import SEEN, eigen
from inertial.criticism.candidate import Candidate, times_rows
from inertial.criticism.decisions import CERTAIN_BELOW, DRAWS, ENOUGH, LEAST_SHARE
from inertial.criticism.drivers import Driver
from inertial.criticism.field import Candidates
from inertial.criticism.likelihood import scatter_of_poses, shared_noise
from inertial.criticism.model import Model
from inertial.criticism.noise_shares import Noise, Shares
from inertial.criticism.penalty import log_p_value
from inertial.criticism.shares import place_of, shares_at
from inertial.criticism.space import Space
from inertial.criticism.tail_areas import log_f_tail
from inertial.criticism.tails import heavy

Array = NDArray[np.float64]

_BATCH = 33
_NUMBERS = 4_000_000
"""Largest number of random numbers per batch: large lots get fewer draws."""

_PIECE = 1_000_000
"""Largest number of them worked on at a time."""

_OFF = (-8, -4, 0, 4, 8)
"""Eighths of a decade about the fitted shares within which the noise of a draw is estimated."""


def adequacy(field: Candidates, drivers: list[Driver], model: Model, rng: Generator) -> float:
    """Natural logarithm of the probability that an adequate model fits as badly somewhere, over all looks together.

    The look that fails most is compared with the most failing look of noise drawn from the fitted covariance, whose own noise
    is estimated again (of the model's own residuals where their tails are heavy); a failure far beyond what draws can show is
    charged with the number of looks instead.
    """
    space = model.space
    common = shared_noise(model)
    of_poses = max(common, scatter_of_poses(model))
    worst, looks, draws = 0.0, 0, _Draws(model, rng)
    for candidate in _everything(field, drivers):
        gain = space.gain(candidate)
        looks += gain.drop.size
        for place, (drop, rank) in enumerate(zip(gain.drop.tolist(), gain.rank.tolist(), strict=True)):
            log_p = log_p_value(space, drop, rank)
            together = of_poses if candidate.shared else common
            if log_p < worst and together > 1.0:
                log_p = log_p_value(space, drop * _own_part(space, candidate, place, together), rank)
            worst = min(worst, log_p)
    charged = worst + np.log(max(looks, 1))
    certain = CERTAIN_BELOW**2 if draws.heavy else CERTAIN_BELOW
    if charged < np.log(certain):
        return float(charged)
    return _against_draws(draws, lambda: _everything(field, drivers), worst)


def _against_draws(draws: "_Draws", looks: Callable[[], Iterable[Candidate]], worst: float) -> float:
    """Logarithm of the share of draws that fail as much somewhere; drawing ends when the result is clear."""
    blocks, n = draws.model.problem.blocks, draws.model.problem.n
    batch = int(np.clip(_NUMBERS // (blocks * n), 5, _BATCH))
    drawn, beyond = 0, 0
    while drawn < DRAWS and beyond < ENOUGH:
        log_p = draws.worst(looks(), batch)
        drawn, beyond = drawn + log_p.size, beyond + int(np.count_nonzero(log_p <= worst))
    return float(np.log((1.0 + beyond) / (1.0 + drawn)))


def _own_part(space: Space, candidate: Candidate, place: int, common: float) -> float:
    """Part of the reduction by a test that remains if the noise common to all units is taken into account."""
    if candidate.shared:
        return 1.0 / common
    units = space.targets.shape[0] // 3
    columns = space.project(space.whiten(candidate.of_blocks[:, :, place, :]))
    inverse = np.linalg.pinv(np.swapaxes(columns, -1, -2) @ columns, rcond=1e-4, hermitian=True)
    fitted = columns @ (inverse @ (np.swapaxes(columns, -1, -2) @ space.residual[..., None]))
    fitted = fitted[..., 0].reshape(units, 3, -1)
    whole = max(float(np.sum(fitted**2)), 1e-300)
    return 1.0 - float(units * np.sum(fitted.mean(axis=0) ** 2) / whole) * (1.0 - 1.0 / common)


def _everything(field: Candidates, drivers: list[Driver]) -> Iterator[Candidate]:
    yield from field.pieces()
    yield from (d.candidate for d in drivers)


class _Draws:
    """Noise drawn from a model's covariance, each draw with shares and variances of its own."""

    def __init__(self, model: Model, rng: Generator) -> None:
        self.model, self.rng = model, rng
        self.lattice, self.start = _lattice(model.noise.shares)
        left = model.space.residual[model.problem.covariance.there]
        self.heavy = heavy(left)
        self._values = left / np.sqrt(np.mean(left**2))

    def worst(self, looks: Iterable[Candidate], count: int) -> Array:
        """Smallest log p over all tests of each draw."""
        covariance = self.model.problem.covariance
        shape = (self.model.problem.blocks, self.model.problem.n, count)
        # a few draws at a time: each step makes several arrays of their size
        series = self._white(shape)
        for some in _pieces(series, count):
            series[..., some] = covariance.coloured(self.model.noise, series[..., some])
        chosen = self._estimated(series)
        places = {k: np.flatnonzero(chosen == k) for k in np.unique(chosen).tolist()}
        spaces = {k: _At(self.model, self._shares(k), series, draws) for k, draws in places.items()}
        del series
        worst = np.zeros(count)
        for candidate in looks:
            for k, space in spaces.items():
                own = places[k]
                worst[own] = np.minimum(worst[own], space.worst(candidate))
        return worst

    def _white(self, shape: tuple[int, ...]) -> Array:
        """White noise of variance one; with heavy tails the residuals of the model in random order."""
        if self.heavy:
            return self._values[self.rng.integers(self._values.size, size=shape)]
        return self.rng.standard_normal(shape)

    def _shares(self, place: int) -> Shares:
        flicker, walk = self.lattice
        return shares_at((flicker[place // len(walk)], walk[place % len(walk)]), self.model.noise.shares.own)

    def _estimated(self, series: Array) -> NDArray[np.intp]:
        """The place of the lattice with the smallest restricted deviance of each draw, (draws,).

        Descent from the shares that the draws were made with, by the places about the best of each draw.
        """
        rows, columns = (len(each) for each in self.lattice)
        deviances = np.full((rows * columns, series.shape[-1]), np.inf)
        done = np.zeros(deviances.shape, dtype=bool)
        best = np.full(series.shape[-1], self.start)
        while True:
            wanted = np.zeros(done.shape, dtype=bool)
            for draw, place in enumerate(best.tolist()):
                row, column = divmod(place, columns)
                near = np.zeros((rows, columns), dtype=bool)
                near[max(row - 1, 0) : row + 2, max(column - 1, 0) : column + 2] = True
                wanted[:, draw] = near.ravel() & ~done[:, draw]
            if not wanted.any():
                return best
            for place in np.flatnonzero(wanted.any(axis=1)).tolist():
                draws = np.flatnonzero(wanted[place])
                deviances[place, draws] = self._deviances(self._shares(place), series, draws)
            done |= wanted
            best = np.argmin(deviances, axis=0)

    def _deviances(self, shares: Shares, series: Array, draws: NDArray[np.intp]) -> Array:
        """Restricted deviance of some draws at some shares, (draws,)."""
        space = self._space(shares)
        dof = space.by_block[:, None]
        log_squares = np.empty(draws.size)
        for some in _pieces(series, draws.size):
            left = space.project(space.whiten(series[..., draws[some]]))
            squares = np.einsum("bnd,bnd->bd", left, left)
            log_squares[some] = np.sum(dof * np.log(np.maximum(squares, 1e-300)), axis=0)
        return space.logdet + space.information + log_squares

    def _space(self, shares: Shares) -> Space:
        return self.model.at(Noise(shares, np.ones(self.model.problem.blocks)))


class _At:
    """Draws with equal estimated shares.

    Parameters
    ----------
    series : (blocks, n, all draws), g; draws : those with these shares
    """

    def __init__(self, model: Model, shares: Shares, series: Array, draws: NDArray[np.intp]) -> None:
        self.space = model.at(Noise(shares, model.noise.scale))
        self.total = np.empty(draws.size)
        self.rows = np.empty((series.shape[0], draws.size, series.shape[1]))
        prior, dof = model.noise.prior, self.space.by_block[:, None]
        for some in _pieces(series, draws.size):
            left = self.space.project(self.space.whiten(series[..., draws[some]]))
            squares = np.einsum("bnd,bnd->bd", left, left)
            if np.isfinite(prior):
                variance = (squares + prior) / (
                    dof + prior
                )  # the centre of the prior is one in units of the fitted scale
            else:
                variance = np.broadcast_to(squares.sum(axis=0) / max(float(dof.sum()), 1.0), squares.shape)
            left /= np.sqrt(variance)[:, None, :]
            self.total[some] = np.einsum("bnd,bnd->d", left, left)
            self.rows[:, some] = self.space.backed(left)

    def worst(self, candidate: Candidate) -> Array:
        """Smallest log p of a candidate over its grid, for each draw."""
        log_p = np.zeros(self.total.size)
        for drop, rank in _drops(candidate, self.space, self.rows):
            after = self.space.dof - rank
            if rank and after > 0:
                ratio = (drop / rank) / (np.maximum(self.total - drop, 1e-300) / after)
                log_p = np.minimum(log_p, log_f_tail(ratio, rank, after))
        return log_p


def _pieces(series: Array, count: int) -> list[slice]:
    """Of so many draws of series (blocks, n, ...) those that are worked on together."""
    few = max(_PIECE // (series.shape[0] * series.shape[1]), 1)
    return [slice(start, min(start + few, count)) for start in range(0, count, few)]


def _lattice(shares: Shares) -> tuple[tuple[list[int | None], list[int | None]], int]:
    """The lattice about fitted shares, none first, each share in rising order; and the place in it of the fitted ones."""
    fitted = place_of(shares)
    rows, columns = (_about(k) for k in fitted)
    return (rows, columns), rows.index(fitted[0]) * len(columns) + columns.index(fitted[1])


def _about(k: int | None) -> list[int | None]:
    """A share of the lattice, those about it, and none."""
    near = {LEAST_SHARE, LEAST_SHARE + 8} if k is None else {max(k + d, LEAST_SHARE) for d in _OFF}
    return [None, *sorted(near)]


def _drops(candidate: Candidate, space: Space, rows: Array) -> list[tuple[Array, int]]:
    """For every value of the nonlinear parameters: the reduction of each draw by the candidate, and its rank.

    Parameters
    ----------
    rows : (blocks, d, n), of the whitened draws after the local columns, for columns in g
    """
    found = space.products(candidate)
    own, squares, along = found.left, found.squares, times_rows(rows, candidate)
    if candidate.shared:
        own, squares, along = (each.sum(axis=0, keepdims=True) for each in (own, squares, along))
    size = np.sqrt(np.where(squares > 0.0, squares, 1.0))
    values, vectors = eigen(own / (size[..., :, None] * size[..., None, :]))
    seen = values > SEEN**2
    # what each draw has along the directions of every value's columns: those columns themselves are not made
    turned = np.swapaxes(
        vectors * np.where(seen, 1.0 / np.sqrt(np.where(seen, values, 1.0)), 0.0)[..., None, :], -1, -2
    )
    turned = turned @ (along / size[..., None])
    drops, ranks = np.einsum("bgpd,bgpd->gd", turned, turned), seen.sum(axis=(0, 2))
    return [(drop, int(rank)) for drop, rank in zip(drops, ranks.tolist(), strict=True)]
