"""Positions logged back to back, without the moves between them: a record that is level in pieces, and where it changes."""

import heapq
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from inertial.arrays import NORMAL_MEDIAN, Array, Index

_MANY_TIMES = 4.0
"""Scatter of a stretch over its noise from neighbouring samples, from which on it is more than one level."""
_EXPLAINED = 0.9
"""Share of the squares that levels must explain: a ramp or a motion leaves more to its pieces."""
_CLEAR_STEP = 8.0
"""Steps between levels, in standard deviations of the noise: a ramp that is cut into levels has smaller ones."""
_SHORTEST = 5
_USUAL = 2 * _SHORTEST
"""Samples in the usual piece of levels: pieces near the shortest are those of a motion."""
_MOST = 2000


@dataclass(frozen=True)
class Levels:
    """Pieces of one level each.

    start, stop : (k,), first and one past the last sample · explained : share of the squares about the mean that they explain
    """

    start: Index
    stop: Index
    explained: float

    def __len__(self) -> int:
        return int(self.start.size)


def neighbour_noise(x: ArrayLike) -> Array:
    """Standard deviation of white noise (k,) of a record (n, k), from the median size of its first differences."""
    steps = np.abs(np.diff(np.asarray(x, dtype=np.float64), axis=0))
    # of coarse digits most steps may be zero: their mean square, with the largest tenth left out, is none
    robust = np.median(steps, axis=0) / (NORMAL_MEDIAN * np.sqrt(2.0))
    smaller = np.sort(steps, axis=0)[: max(1, int(0.9 * len(steps)))]
    return np.maximum(robust, np.sqrt(np.mean(smaller**2, axis=0) / 2.0))


def several_levels(x: ArrayLike) -> int:
    """How many positions a stretch (n, k) seems to hold back to back; 1 where it scatters as its noise or a motion does."""
    data = np.asarray(x, dtype=np.float64)
    if len(data) < 4 * _SHORTEST:
        return 1
    noise = neighbour_noise(data)
    if not np.any(data.std(axis=0) > _MANY_TIMES * noise):
        return 1
    pieces = levels(data, None)
    if not 2 <= len(pieces) < min(_MOST, len(data) / _USUAL) or pieces.explained < _EXPLAINED:
        return 1
    means = np.stack([data[a:b].mean(axis=0) for a, b in zip(pieces.start, pieces.stop, strict=True)])
    steps = np.linalg.norm(np.diff(means, axis=0) / np.where(noise > 0.0, noise, 1.0), axis=1)
    return len(pieces) if np.quantile(steps, 0.25) > _CLEAR_STEP else 1


def levels(x: ArrayLike, count: int | None, *, shortest: int = _SHORTEST) -> Levels:
    """The pieces of a record (n, k) that is level in pieces.

    The piece whose division explains most squares, in units of the noise from neighbouring samples, is divided next (binary
    segmentation: A. J. Scott, M. Knott, Biometrics 30 (1974) 507); then every boundary is set anew between its neighbours.

    Parameters
    ----------
    count : pieces wanted; None for as many as explain more than noise does (a penalty of 3 ln n per axis and boundary).
    shortest : samples in the shortest piece.

    Raises
    ------
    ValueError
        The record is too short for so many pieces.
    """
    data = np.asarray(x, dtype=np.float64)
    n = len(data)
    if count is not None and n < count * shortest:
        raise ValueError(
            f"positions: {n} samples, {count * shortest} are needed for {count} positions of {shortest}; ask for fewer"
        )
    noise = neighbour_noise(data)
    scaled = (data - data.mean(axis=0)) / np.where(noise > 0.0, noise, 1.0)
    sums = np.concatenate([np.zeros((1, data.shape[1])), np.cumsum(scaled, axis=0)])
    boundaries = _divided(
        sums, n, (count or _MOST) - 1, shortest, 3.0 * np.log(n) * data.shape[1] if count is None else -1.0
    )
    boundaries = _refined(sums, [0, *sorted(boundaries), n], shortest)
    total = float(np.sum(scaled**2))
    edges = np.array(boundaries)
    pieces = sums[edges[1:]] - sums[edges[:-1]]
    between = float(np.sum(pieces**2 / np.diff(edges)[:, None]))
    return Levels(edges[:-1], edges[1:], between / total if total > 0.0 else 0.0)


def _divided(sums: Array, n: int, most: int, shortest: int, penalty: float) -> list[int]:
    queue: list[tuple[float, int, int, int]] = []
    cuts: list[int] = []

    def offer(a: int, b: int) -> None:
        gain, cut = _best(sums, a, b, shortest)
        if cut > a and gain > penalty:
            heapq.heappush(queue, (-gain, cut, a, b))

    offer(0, n)
    while queue and len(cuts) < most:
        _, cut, a, b = heapq.heappop(queue)
        cuts.append(cut)
        offer(a, cut)
        offer(cut, b)
    return cuts


def _best(sums: Array, a: int, b: int, shortest: int) -> tuple[float, int]:
    """Squares that the best division of a piece explains, and the index where it divides; the beginning where there is none."""
    if b - a < 2 * shortest:
        return 0.0, a
    cuts = np.arange(a + shortest, b - shortest + 1)
    left, right = sums[cuts] - sums[a], sums[b] - sums[cuts]
    total = sums[b] - sums[a]
    gain = np.sum(left**2 / (cuts - a)[:, None] + right**2 / (b - cuts)[:, None] - total**2 / (b - a), axis=1)
    best = int(np.argmax(gain))
    return float(gain[best]), int(cuts[best])


def _refined(sums: Array, edges: list[int], shortest: int) -> list[int]:
    for _ in range(3):
        before = list(edges)
        for k in range(1, len(edges) - 1):
            gain, cut = _best(sums, edges[k - 1], edges[k + 1], shortest)
            edges[k] = cut if gain > 0.0 else edges[k]
        if edges == before:
            break
    return edges
