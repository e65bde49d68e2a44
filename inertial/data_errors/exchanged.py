"""Pairs of units whose readings were exchanged for a range of dwells, by their residuals after a plain fit.

What one of the two has too much the other lacks, so that their residuals are opposite; with the readings exchanged back they
vanish. A look at all pairs costs one product of the residuals with themselves.
"""

from collections.abc import Callable, Iterator, Sequence

import numpy as np

from inertial.arrays import Array, Flags, Places

EDGE = 3
"""Dwells at both ends within which no exchange can be detected."""

AROUND = 3
"""Dwells on either side of the best one that may be as good."""

_OPPOSITE = -0.5
"""Correlation of the residuals of two units below which they may have been exchanged."""

_TOGETHER = 256
"""First dwells of a range that are looked at together: a record of ten thousand dwells has fifty million ranges."""

_LEFT = 0.5
"""Share of the squares of both that is left with the readings exchanged back."""

_MANY = 4
"""Units from which the median over the units is what they have in common."""

_WARM = 1.0
"""Range of temperature, K, from which on the fit has slopes over it."""


class PlainFit:
    """Bias, response and their slopes over temperature of every unit, by least squares.

    Parameters
    ----------
    output : (units, n, 3); force : (units, n, 3), g; theta : (units, n), K, None where unknown
    there : (units, n), which units have which dwells
    of_other : outputs (2, n, 3) of two units, each as that of the other
    """

    def __init__(
        self,
        output: Array,
        force: Array,
        theta: Array | None,
        there: Flags,
        of_other: Callable[[int, int], Array],
    ) -> None:
        units, n = there.shape
        force = np.broadcast_to(force, (units, n, 3))
        columns = [np.ones((units, n, 1)), force]
        if theta is not None and float(np.ptp(theta[there])) > _WARM:
            theta = np.where(there, theta, 0.0)
            columns += [theta[..., None], theta[..., None] * force]
        known = there[..., None]
        self.basis = np.linalg.qr(np.concatenate(columns, axis=-1) * known)[0]
        self.output, self.there, self.of_other = np.where(known, output, 0.0), there, of_other
        self.left = self.output - self.basis @ (np.swapaxes(self.basis, -1, -2) @ self.output)

    def pairs(self) -> Iterator[tuple[int, int]]:
        """Pairs of units, each of which has the residuals that are most opposite to the other's."""
        units = len(self.left)
        deviations = self.left - np.median(self.left, axis=0) if units >= _MANY else self.left
        flat = deviations.reshape(units, -1)
        size = np.linalg.norm(flat, axis=1)
        flat = flat / np.where(size > 0.0, size, 1.0)[:, None]
        alike = flat @ flat.T
        partner = np.argmin(alike, axis=1)
        mutual = (partner[partner] == np.arange(units)) & (np.arange(units) < partner)
        for a in np.flatnonzero(mutual).tolist():
            if alike[a, partner[a]] < _OPPOSITE:
                yield a, int(partner[a])

    def ranges(self, unit: int, partner: int, around: int = AROUND) -> list[tuple[int, int]]:
        """Ranges of dwells (first, end) in which an exchange of two units leaves least; none if it leaves too much.

        The end of most is that of the record; units that came back into their seats before it were exchanged for a while. Beside
        the best range others whose first or whose last dwell is near.
        """
        pair = [unit, partner]
        changes = self._changes(pair)
        n = self.there.shape[1]
        first, end = np.arange(EDGE, n - EDGE + 1), np.append(np.arange(2 * EDGE, n - EDGE + 1), n)
        total = float(np.sum(self.left[pair] ** 2))
        if total <= 0.0 or not first.size:
            return []
        lasting = (int(first[np.argmin(_left_by(changes, first, end[-1:])[:, 0])]), n)
        each = [_best_of(changes, first[k : k + _TOGETHER], end) for k in range(0, first.size, _TOGETHER)]
        found: dict[tuple[int, int], float] = {}
        for a, b in {lasting, min(each)[1]}:
            if total + float(_left_by(changes, np.array([a]), np.array([b]))[0, 0]) > _LEFT * total:
                continue
            near = [(k, b) for k in range(a - around, a + around + 1)]
            near += [(a, k) for k in range(b - around, b + around + 1) if b < n]
            for k, m in near:
                if first[0] <= k <= first[-1] and k + EDGE <= m <= (n if b == n else n - EDGE):
                    found[k, m] = float(_left_by(changes, np.array([k]), np.array([m]))[0, 0])
        return sorted(found, key=lambda dwells: found[dwells])

    def _changes(self, pair: list[int]) -> list[tuple[Array, Array]]:
        """Running sums for each unit and axis, of dᵀd + 2·rᵀd, (n + 1,), and of Qᵀd, (n + 1, k).

        d is the readings of the other unit less its own, r what the fit leaves, Q the basis of the fit.
        """
        both = np.all(self.there[pair], axis=0, keepdims=True).T
        apart = np.where(both, self.of_other(*pair) - self.output[pair], 0.0)
        sums: list[tuple[Array, Array]] = []
        for difference, basis, rest in zip(apart, self.basis[pair], self.left[pair], strict=True):
            for change, left in zip(difference.T, rest.T, strict=True):
                sums.append((_running(change * (change + 2.0 * left)), _running(basis * change[:, None])))
        return sums


def _left_by(changes: Sequence[tuple[Array, Array]], first: Places, end: Places) -> Array:
    """What exchanges in ranges of dwells add to the squares of two units, (first, end); infinite where a range is too short.

    ‖r + c‖² of the columns c = P·H·d, from running sums: cᵀc = dᵀHd − (QᵀHd)², rᵀc = rᵀHd.
    """
    squares = np.zeros((first.size, end.size))
    for single, along in changes:
        squares += single[end] - single[first][:, None] + 2.0 * along[first] @ along[end].T
        squares -= np.sum(along[end] ** 2, axis=-1) + np.sum(along[first] ** 2, axis=-1)[:, None]
    return np.where(end - first[:, None] < EDGE, np.inf, squares)


def _best_of(changes: Sequence[tuple[Array, Array]], first: Places, end: Places) -> tuple[float, tuple[int, int]]:
    """The range that leaves least, and what it adds."""
    squares = _left_by(changes, first, end)
    a, b = np.unravel_index(int(np.argmin(squares)), squares.shape)
    return float(squares[a, b]), (int(first[a]), int(end[b]))


def _running(values: Array) -> Array:
    """Sums (n + 1, …) of the values (n, …) before each index."""
    return np.concatenate([np.zeros((1, *values.shape[1:])), np.cumsum(values, axis=0)])
