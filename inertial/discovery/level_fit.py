"""Sizes of an effect by the levels of a driver, fitted to all lots together, and their errors by the scatter of the lots.

A lot shows how its units differ from each other, and the mean of its levels beside what all lots of its station have in common.
Levels that share few lots, as batches that follow each other, are tied by both. The normal equations of all levels and columns
are solved by conjugate gradients. Errors are those of the estimating function's scatter between blocks of consecutive lots of a
station (White 1980; Liang and Zeger 1986), so that nothing is assumed about the noise of an effect, alike in the units of a lot
or slow; draws of it with random signs by block (wild bootstrap, Cameron, Gelbach and Miller 2008) give its covariance.
"""

from dataclasses import replace

import numpy as np
from scipy.sparse import csr_array

from inertial.arrays import Array, Places, over
from inertial.discovery.driver_sums import DriverSums, LotStack
from inertial.discovery.evidence import MEAN, STATION

_BLOCKS = 20
"""Number of blocks of consecutive lots of a station, if there are as many lots: the standard errors have a scatter of
1/√40 = 16 %, and wander that lasts less than a block is in them. A level has four at least, as what it explains of a block is
no scatter."""

WIDE = 2.09
"""Half width of a 95 % interval in standard deviations: Student's t of as many blocks."""

_DRAWS = 40  # of errors; more have no use beside the scatter of the blocks

_PLAN = 4.0
"""Factor by which the information of a lot on an effect may differ from that by the noise of its other axes: beyond it is another
plan. That of equal plans differs by up to three where an effect is as slow as the wander; with 2, sizes of the quadratic of bias
over temperature were 2 % lower, with 100 the same."""

_CLOSE, _MOST = 1e-8, 60
"""Part of the first chi-square at which the iteration ends, 1e-4 of the sizes, and the largest number of iterations."""


class LevelFit:
    """Sizes of the columns of an effect by level, about the mean of the units where there are several levels.

    sizes : (levels, h), g per unit of the column · errors : (n, levels, h), draws of their errors
    weight : (levels,), share of the units

    Parameters
    ----------
    sums : of the driver over the lots of the stack · here : indices of the h hypotheses of the effect, axis by axis
    correlations : (h, h) each, of the columns within lots, in the means of lots; inverses without what lots do not separate, of
        those that apply to the driver, and in the means of lots
    stated : weigh the units by the noise they state, as the scores of names do, so that no chi-square by it is left, and draw no
        errors
    """

    def __init__(
        self,
        stack: LotStack,
        sums: DriverSums,
        here: Places,
        axes: int,
        correlations: tuple[Array, Array, Array, Array],
        *,
        stated: bool = False,
    ) -> None:
        own = stack.own[:, here]
        weights = own if stated else _weights(stack.own, here, axes)
        heavier = over(stack.by_lot @ weights, stack.by_lot @ own)
        score, information = stack.score[:, here] * over(weights, own), stack.information[:, here] * heavier
        self._stack = replace(stack, score=score, own=weights, information=information)
        self._by_level, self._levels = sums.weights(stack), len(sums.labels)
        self._inside, self._between, *self._inner = correlations
        # what the lots of a station have in common is no size of a level, unless the driver is just that
        in_common = sums.driver not in {MEAN, STATION}
        self._common = csr_array(np.eye(int(stack.station.max()) + 1)[stack.station] * in_common)
        self._blocks = _blocks_of(stack.station, max(_BLOCKS, 4 * self._levels))
        # what is not measured has infinite noise: means of lots by slot
        self._noise = np.inf if sums.inside_only else sums.noise[0], sums.noise[1]
        own_sums = sums.information[:, here], self._common.T @ information / self._noise[0]
        self._roots = over(1.0, np.sqrt(np.maximum(np.concatenate(own_sums), 0.0)))
        self.weight = sums.units / sums.units.sum()
        known = stack.lot.size if sums.mixed else int(self._blocks.max()) + 1
        self._inflation = float(np.sqrt(known / max(known - self._levels, 1)))
        left, of_lots = self._stack.left, self._stack.sums
        sizes = self._solution(self._gradient(left, of_lots))
        explained = self._predicted(sizes)
        self._after = left, of_lots = left - explained[0], of_lots - explained[1]
        signs = np.random.default_rng(0).choice([-1.0, 1.0], (0 if stated else _DRAWS, self._blocks.max() + 1))
        errors = [
            self._solution(self._gradient(left * sign[stack.lot, None], of_lots * sign[:, None]))
            for sign in signs[:, self._blocks]
        ]
        self.sizes = self._levels_of(sizes)
        drawn = np.array([self._levels_of(each) for each in errors]).reshape(-1, *self.sizes.shape)
        self.errors = self._inflation * drawn

    def mean_square(self, product: Array) -> tuple[float, float]:
        """Mean of sᵀ·product·s over the units, less what noise adds to it, and its standard deviation.

        Parameters
        ----------
        product : (h, h), symmetric
        """
        noise = np.einsum("g,ngp,pq,ngq->n", self.weight, self.errors, product, self.errors)
        value = float(np.einsum("g,gp,pq,gq->", self.weight, self.sizes, product, self.sizes))
        linear = 2.0 * self._scatter_of(self.weight[:, None] * (self.sizes @ product))
        twice = float(noise.var())
        # the sizes have noise, too, which adds 2·twice to the linear part
        return value - float(noise.mean()), float(np.sqrt(max(linear**2 - twice, twice)))

    @property
    def shrunk(self) -> Array:
        """Sizes (levels, h), those of several levels shrunk towards zero according to the noise that scores are divided by."""
        if self._levels < 2:
            return self.sizes
        noise, squares = self._roots[: self._levels] ** 2 @ np.diag(self._inner[0]), (self.sizes**2).sum(axis=1)
        return self.sizes * np.clip(1.0 - noise / np.maximum(squares, 1e-300), 0.0, 1.0)[:, None]

    def _scatter_of(self, direction: Array) -> float:
        """Standard deviation of Σ direction·size, (levels, h), by the scatter between blocks of lots."""
        if self._levels > 1:
            direction = direction - self.weight[:, None] * direction.sum(axis=0)
        full = np.zeros_like(self._roots)
        full[: self._levels] = direction
        about, of_lots = self._effects_of(self._solution(full))
        left, sums = self._after
        inside = (about * left).sum(axis=1) / self._noise[1]
        by_lot = self._stack.by_lot @ inside + (of_lots * sums).sum(axis=1) / self._noise[0]
        return self._inflation * float(np.sqrt(np.sum(np.bincount(self._blocks, by_lot) ** 2)))

    def _levels_of(self, sizes: Array) -> Array:
        """Sizes of the levels about the mean of the units."""
        of_levels = sizes[: self._levels]
        return of_levels - self.weight @ of_levels if self._levels > 1 else of_levels

    def _effects_of(self, sizes: Array) -> tuple[Array, Array]:
        """Sizes of the units about the mean of their lot, and of the means of lots."""
        about, means = self._stack.about_lots(self._by_level @ sizes[: self._levels])
        return about, means + self._common @ sizes[self._levels :]

    def _predicted(self, sizes: Array) -> tuple[Array, Array]:
        """Scores of the units about the mean of their lot, and their sums, that sizes give."""
        return self._stack.predicted(self._effects_of(sizes), self._inside, self._between)

    def _gradient(self, left: Array, sums: Array) -> Array:
        """Estimating function (levels + stations, h) of scores of the units and their sums."""
        within, means, stack = left / self._noise[1], sums / self._noise[0], self._stack
        of_levels = self._by_level.T @ (within + stack.share * (means - stack.by_lot @ within)[stack.lot])
        return np.concatenate([of_levels, self._common.T @ means])

    def _solution(self, target: Array) -> Array:
        """Solution of the normal equations, from zero, so that what they do not determine stays zero.

        scipy's `cg` measures its end without the preconditioner, and iterates rounding errors in what is not determined.
        """
        x, left = np.zeros_like(target), target.copy()
        step = near = self._near(left)
        first = product = float((left * near).sum())
        for _ in range(_MOST):
            if product <= _CLOSE * first:
                break
            moved = self._gradient(*self._predicted(step))
            curvature = float((step * moved).sum())
            if curvature <= 0.0:
                break
            length = product / curvature
            x, left = x + length * step, left - length * moved
            near = self._near(left)
            step, product = near + float((left * near).sum()) / product * step, float((left * near).sum())
        return x

    def _near(self, left: Array) -> Array:
        """Solution without the ties between levels."""
        scaled = self._roots * left
        parts = (scaled[: self._levels] @ self._inner[0], scaled[self._levels :] @ self._inner[1])
        return self._roots * np.concatenate(parts)


def _weights(every: Array, here: Places, axes: int) -> Array:
    """Information (n, h) of units, of all hypotheses in ``every``, by the noise that most columns of their other axes state.

    A lot states its noise by what its model leaves, which the effect and the error along it are in: where both have the same sign
    it counts for less, which takes 2/ν of the effect at ν degrees of freedom: 3 % at 60, and more of an effect as slow as wander.
    """
    typical = every.mean(axis=0)
    relative = over(every, typical).reshape(len(every), axes, -1)
    each = np.median(relative, axis=2)
    others = (each.sum(axis=1, keepdims=True) - each) / (axes - 1) if axes > 1 else each
    own = every[:, here]
    alike = typical[here] * np.repeat(others, here.size // axes, axis=1)
    return np.clip(alike, own / _PLAN, own * _PLAN)


def _blocks_of(stations: Places, count: int) -> Places:
    """Number of the block of each lot: consecutive lots of a station, about so many in all."""
    out, next_ = np.zeros(stations.size, dtype=np.intp), 0
    for station in range(int(stations.max()) + 1):
        here = np.flatnonzero(stations == station)
        parts = np.array_split(here, max(1, min(here.size, round(count * here.size / stations.size))))
        for part in parts:
            out[part] = next_
            next_ += 1
    return out
