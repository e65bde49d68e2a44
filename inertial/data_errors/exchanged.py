"""Pairs of units whose readings were exchanged for a range of dwells, found by their residuals after a plain fit.

The residuals of the two units are opposite and vanish with the readings exchanged back. The correlations of all pairs take one
product of the residuals with themselves.
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
"""Number of first dwells processed at a time: a record of ten thousand dwells has fifty million ranges."""

_LEFT = 0.5
"""Largest share of both units' sums of squares that may remain with the readings exchanged back."""

_MANY = 4
"""Smallest number of units whose median is subtracted as common to all units."""

_WARM = 1.0
"""Range of temperature, K, from which on the fit has slopes over it."""


class PlainFit:
    """Least-squares fit of bias, response and their temperature slopes for every unit.

    Parameters
    ----------
    output : (units, n, 3), output unit; force : (units, n, 3), g; theta : (units, n), K, None where unknown
    there : (units, n), whether a unit has a dwell
    of_other : function of two unit indices: their outputs (2, n, 3) exchanged, each in the scale of the other unit
    """

    def __init__(
        self, output: Array, force: Array, theta: Array | None, there: Flags, of_other: Callable[[int, int], Array]
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
        """Pairs of units with opposite residuals, each the unit most opposite to the other."""
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
        """Ranges of dwells (first, end) in which exchanging back leaves the smallest residuals; empty if these are too large.

        Most exchanges last until the end of the record; others end when the units are put back into their seats. Ranges near the
        best one, with another first or last dwell, are included.
        """
        pair = [unit, partner]
        changes = self._changes(pair)
        n = self.there.shape[1]
        first, end = np.arange(EDGE, n - EDGE + 1), np.append(np.arange(2 * EDGE, n - EDGE + 1), n)
        total = float(np.sum(self.left[pair] ** 2))
        if total <= 0.0 or not first.size:
            return []
        lasting = (int(first[np.argmin(_change_of_squares(changes, first, end[-1:])[:, 0])]), n)
        each = [_best_range(changes, first[k : k + _TOGETHER], end) for k in range(0, first.size, _TOGETHER)]
        found: dict[tuple[int, int], float] = {}
        for a, b in {lasting, min(each)[1]}:
            if total + float(_change_of_squares(changes, np.array([a]), np.array([b]))[0, 0]) > _LEFT * total:
                continue
            near = [(k, b) for k in range(a - around, a + around + 1)]
            near += [(a, k) for k in range(b - around, b + around + 1) if b < n]
            for k, m in near:
                if first[0] <= k <= first[-1] and k + EDGE <= m <= (n if b == n else n - EDGE):
                    found[k, m] = float(_change_of_squares(changes, np.array([k]), np.array([m]))[0, 0])
        return sorted(found, key=lambda dwells: found[dwells])

    def _changes(self, pair: list[int]) -> list[tuple[Array, Array]]:
        """Running sums, for each of the two units and axis, of dᵀd + 2·rᵀd, (n + 1,), and of Qᵀd, (n + 1, k).

        d is the readings of the other unit less those of the unit, r the residuals of the fit, Q the basis of the fit.
        """
        both = np.all(self.there[pair], axis=0, keepdims=True).T
        apart = np.where(both, self.of_other(*pair) - self.output[pair], 0.0)
        sums: list[tuple[Array, Array]] = []
        for difference, basis, rest in zip(apart, self.basis[pair], self.left[pair], strict=True):
            for change, left in zip(difference.T, rest.T, strict=True):
                sums.append((_running(change * (change + 2.0 * left)), _running(basis * change[:, None])))
        return sums


def _change_of_squares(changes: Sequence[tuple[Array, Array]], first: Places, end: Places) -> Array:
    """Change of both units' sum of squares by exchanging ranges of dwells, (first, end); infinite where a range is too short.

    ‖r + c‖² of the columns c = P·H·d, from running sums: cᵀc = dᵀHd − (QᵀHd)², rᵀc = rᵀHd.
    """
    squares = np.zeros((first.size, end.size))
    for single, along in changes:
        squares += single[end] - single[first][:, None] + 2.0 * along[first] @ along[end].T
        squares -= np.sum(along[end] ** 2, axis=-1) + np.sum(along[first] ** 2, axis=-1)[:, None]
    return np.where(end - first[:, None] < EDGE, np.inf, squares)


def _best_range(changes: Sequence[tuple[Array, Array]], first: Places, end: Places) -> tuple[float, tuple[int, int]]:
    """The smallest change of the sum of squares, and its range of dwells (first, end)."""
    squares = _change_of_squares(changes, first, end)
    a, b = np.unravel_index(int(np.argmin(squares)), squares.shape)
    return float(squares[a, b]), (int(first[a]), int(end[b]))


def _running(values: Array) -> Array:
    """Sums (n + 1, …) of the values (n, …) before each index."""
    return np.concatenate([np.zeros((1, *values.shape[1:])), np.cumsum(values, axis=0)])
