"""The shares of 1/f noise and random walk, searched on a lattice by restricted likelihood.

The shares are common to a lot, because equal sensors have equal noise. An axis that jumps between two levels, or has a random
walk where the others only have 1/f noise, has autocorrelated whitened residuals; with the shares of the lot its jumps are steps
of many standard deviations, which a slow effect with a coefficient for every axis absorbs. Such a block gets shares of its own,
by its own restricted likelihood, in every model that is judged. With an effect in the model that explains the block, its
residuals are no longer autocorrelated, and the block has the lot's shares again.
"""

from collections.abc import Callable

import numpy as np

from inertial.arrays import Array
from inertial.decisions import LARGEST_SHARE, LEAST_SHARE, OWN_SHARES, OWN_SUSPECT, SHARE_STEP
from inertial.estimation.noise_shares import LONGEST, Shares
from inertial.estimation.problem import Problem
from inertial.estimation.space import Space

Point = tuple[int | None, int | None]

_STRIDES = (4, 2, 1)
"""Lattice steps of the successive searches: half, quarter and eighth of a decade."""

_LEAST = 1e-3
"""Smallest reduction of the deviance by a step."""

_RULED_OUT = 12.0
"""Deviance above the minimum from which shares are ruled out: a weight of 0.25 %."""

_MOST_POINTS = 240

FEWEST = 20
"""Smallest number of degrees of freedom of a block for an estimate of its own shares."""

_LAGS = 3


def best_shares(deviance: Callable[[Shares], float], near: Shares | None = None, *, finest: int = 1) -> Shares:
    """The shares of the smallest deviance, by descent from a start.

    Parameters
    ----------
    near : start; 1/f of three times the white variance if None; shares of single blocks stay as they are
    finest : smallest stride, in eighths of a decade
    """
    known: dict[Point, float] = {}
    by_block = () if near is None else near.by_block

    def at(point: Point) -> float:
        if point not in known:
            known[point] = deviance(shares_at(point, by_block))
        return known[point]

    here = (4, None) if near is None else nearest_point(near)
    for stride in _STRIDES:
        if stride < finest:
            break
        for _ in range(60):
            best = next((p for p in _around(here, stride) if at(p) < at(here) - _LEAST), None)
            if best is None:
                break
            here = best
    return shares_at(here, by_block)


def plausible_shares(deviance: Callable[[Shares], float], best: Shares) -> list[tuple[Shares, float]]:
    """Shares at half decades around the best that a record does not rule out, with weights that add up to one.

    The weights are the restricted likelihood with a flat prior on the logarithms of the shares, where a share of zero counts as
    one half decade. Few dwells leave decades of shares open, and errors stated at the best shares alone are too small.
    """
    stride = _STRIDES[0]
    middle = nearest_point(best)
    known = {middle: deviance(shares_at(middle, best.by_block))}
    open_, least = [middle], known[middle]
    while open_:
        first, second = open_.pop()
        near = [(k, second) for k in _adjacent(first, stride, middle[0])]
        near += [(first, k) for k in _adjacent(second, stride, middle[1])]
        for point in near:
            if point not in known and len(known) < _MOST_POINTS:
                known[point] = deviance(shares_at(point, best.by_block))
                if known[point] < least + _RULED_OUT:
                    least = min(least, known[point])
                    open_.append(point)
    weights = {point: np.exp(-0.5 * (value - least)) for point, value in known.items() if value < least + _RULED_OUT}
    total = sum(weights.values())
    return [(shares_at(point, best.by_block), float(weight / total)) for point, weight in weights.items()]


def _adjacent(k: int | None, stride: int, middle: int | None) -> list[int | None]:
    """Lattice indices one stride below and above ``k`` on the lattice through ``middle``; None (no share) below the least."""
    least = LEAST_SHARE if middle is None else middle - stride * ((middle - LEAST_SHARE) // stride)
    if k is None:
        return [least]
    return [k - stride if k - stride >= LEAST_SHARE else None, *([k + stride] if k + stride <= LARGEST_SHARE else [])]


def nearest_point(shares: Shares) -> Point:
    """The point of the lattice nearest to shares."""
    first, second = (
        None if s <= 10.0 ** ((LEAST_SHARE - 4) / SHARE_STEP) else _inside(round(SHARE_STEP * np.log10(s)))
        for s in (shares.flicker, shares.walk)
    )
    return first, second


def shares_at(point: Point, by_block: tuple[tuple[int, float, float], ...] = ()) -> Shares:
    """The shares at a point of the lattice, together with given shares of single blocks."""
    flicker, walk = (0.0 if k is None else 10.0 ** (k / SHARE_STEP) for k in point)
    return Shares(flicker, walk, by_block)


def _inside(k: int) -> int:
    return min(max(k, LEAST_SHARE), LARGEST_SHARE)


def _around(point: Point, stride: int) -> list[Point]:
    """Neighbours of a point: each share up or down, also both; at the first stride also a share removed or added."""
    first, second = point
    near: list[Point] = [*((first, k) for k in _moved(second, stride)), *((k, second) for k in _moved(first, stride))]
    if first is not None and second is not None:
        ways = ((-stride, stride), (stride, -stride), (-stride, -stride), (stride, stride))
        near += [(_inside(first + flicker_step), _inside(second + walk_step)) for flicker_step, walk_step in ways]
    if stride == _STRIDES[0]:
        near += [(first, None), (None, second)]
        # a new share is visible only if it is as large as the other
        if second is None:
            near += [(first, LEAST_SHARE + 8)]
            near += [] if first is None else [(first, first), (_inside(first - 8), first)]
        if first is None:
            near += [(LEAST_SHARE + 8, second)]
            near += [] if second is None else [(second, second), (second, _inside(second - 8))]
    return [p for p in dict.fromkeys(near) if p != point]


def _moved(k: int | None, stride: int) -> list[int]:
    return [] if k is None else [_inside(k + stride), _inside(k - stride)]


def own_shares(
    problem: Problem, series: Array, local: Array, space: Space, of_block: Callable[[int, Shares], float | None]
) -> tuple[tuple[int, float, float], ...]:
    """(index, 1/f, random walk) of each block that needs shares of its own, from a model's residuals at the lot's shares.

    Parameters
    ----------
    series : (blocks, n), g, measurements less the fitted shared columns
    local : (blocks, n, p), g per unit of the coefficient, columns with coefficients by block
    space : space of the model at the lot's shares, possibly with own shares of some blocks
    of_block : −2 log restricted likelihood of a block at given shares, less the log-determinant; None if not available
    """
    if problem.lot.radial or problem.n > LONGEST:
        return ()
    before = {block for block, _, _ in space.noise.shares.by_block}
    suspect = before | set(np.flatnonzero(_box_pierce(space) > OWN_SUSPECT).tolist())
    dof = space.by_block
    common = space.noise.shares.common
    by_block: list[tuple[int, float, float]] = []
    for block in sorted(suspect):
        if dof[block] < FEWEST:
            continue
        columns = np.concatenate([local[block], series[block][:, None]], axis=1)

        def deviance(shares: Shares, block: int = block, columns: Array = columns) -> float:
            quick = of_block(block, shares)
            return (
                _deviance_of_block(problem, block, columns, shares)
                if quick is None
                else problem.covariance.whitener_of_block(block, shares).logdet + quick
            )

        best = best_shares(deviance, common, finest=_STRIDES[0])
        if deviance(common) - deviance(best) > OWN_SHARES:
            by_block.append((block, best.flicker, best.walk))
    return tuple(by_block)


def _box_pierce(space: Space) -> Array:
    """Box-Pierce statistic (blocks,) of the whitened residuals over the first ``_LAGS`` lags; χ² with as many dof."""
    there = space.covariance.there
    left = np.where(there, space.residual, 0.0)
    squares = np.maximum(np.einsum("bn,bn->b", left, left), 1e-300)
    count = there.sum(axis=1)
    lags = [np.einsum("bn,bn->b", left[:, lag:], left[:, :-lag]) / squares for lag in range(1, _LAGS + 1)]
    return count * np.sum(np.square(lags), axis=0)


def _deviance_of_block(problem: Problem, block: int, columns: Array, shares: Shares) -> float:
    """−2 log restricted likelihood of one block at given shares; ``columns`` (n, p + 1): its columns, then its measurements."""
    covariance = problem.covariance
    there = covariance.there[block]
    whitener = covariance.whitener_of_block(block, shares)
    white = whitener.columns(columns[None])[0, there] / covariance.level[block]
    size = np.linalg.norm(white[:, :-1], axis=0)
    seen = size > 0.0
    upper = np.linalg.qr(np.concatenate([white[:, :-1][:, seen] / size[seen], white[:, -1:]], axis=1), mode="r")
    diagonal = np.abs(np.diagonal(upper))
    determined = diagonal[:-1] > 1e-6
    dof = int(there.sum()) - int(determined.sum())
    information = 2.0 * float(np.sum(np.log(diagonal[:-1][determined] * size[seen][determined])))
    return whitener.logdet + information + dof * float(np.log(max(diagonal[-1] ** 2, 1e-300)))
