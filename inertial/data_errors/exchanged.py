"""Pairs of units whose readings were exchanged for a range of dwells, by their residuals after a plain fit.

What one of the two has too much the other lacks, so that their residuals are opposite; with the readings exchanged back they
vanish. A look at all pairs costs one product of the residuals with themselves.
"""

from collections.abc import Callable, Iterator

import numpy as np

from inertial.arrays import Array, Flags

EDGE = 3
"""Dwells at both ends within which no exchange can be detected."""

AROUND = 3
"""Dwells on either side of the best one that may be as good."""

_OPPOSITE = -0.5
"""Correlation of the residuals of two units below which they may have been exchanged."""

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
        own = self.left - np.median(self.left, axis=0) if units >= _MANY else self.left
        flat = own.reshape(units, -1)
        size = np.linalg.norm(flat, axis=1)
        flat = flat / np.where(size > 0.0, size, 1.0)[:, None]
        alike = flat @ flat.T
        partner = np.argmin(alike, axis=1)
        mutual = (partner[partner] == np.arange(units)) & (np.arange(units) < partner)
        for a in np.flatnonzero(mutual).tolist():
            if alike[a, partner[a]] < _OPPOSITE:
                yield a, int(partner[a])

    def ranges(self, one: int, other: int, around: int = AROUND) -> list[tuple[int, int]]:
        """Ranges of dwells (first, end) in which an exchange of two units leaves least; none if it leaves too much.

        The end of most is that of the record; units that came back into their seats before it were exchanged for a while. Beside
        the best range others whose first or whose last dwell is near.
        """
        pair = [one, other]
        both = np.all(self.there[pair], axis=0, keepdims=True).T
        apart = np.where(both, self.of_other(one, other) - self.output[pair], 0.0)
        n = both.size
        first, end = np.arange(EDGE, n - EDGE + 1), np.append(np.arange(2 * EDGE, n - EDGE + 1), n)
        squares = np.zeros((first.size, end.size))
        for difference, basis, rest in zip(apart, self.basis[pair], self.left[pair], strict=True):
            # ‖r + c‖² of the columns c = P·H·d, from running sums: cᵀc = dᵀHd − (QᵀHd)², rᵀc = rᵀHd
            for axis in range(difference.shape[-1]):
                change = difference[:, axis]
                single = _running(change * (change + 2.0 * rest[:, axis]))
                along = _running(basis * change[:, None])
                squares += single[end] - single[first][:, None]
                squares -= np.sum(along[end] ** 2, axis=-1) + np.sum(along[first] ** 2, axis=-1)[:, None]
                squares += 2.0 * along[first] @ along[end].T
        squares = np.where(end - first[:, None] < EDGE, np.inf, squares)
        whole = float(np.sum(self.left[pair] ** 2))
        if whole <= 0.0 or not first.size:
            return []
        lasting, best = int(np.argmin(squares[:, -1])), np.unravel_index(int(np.argmin(squares)), squares.shape)
        found: list[tuple[int, int]] = []
        for a, b in {(lasting, end.size - 1), (int(best[0]), int(best[1]))}:
            if whole + float(squares[a, b]) <= _LEFT * whole:
                near = [(k, b) for k in range(a - around, a + around + 1)]
                near += [(a, k) for k in range(b - around, b + around + 1) if b < end.size - 1]
                inside = {(k, m) for k, m in near if 0 <= k < first.size and 0 <= m < end.size}
                found += [(int(first[k]), int(end[m])) for k, m in sorted(inside) if np.isfinite(squares[k, m])]
        return sorted(found, key=lambda one: float(squares[one[0] - EDGE, np.searchsorted(end, one[1])]))


def _running(values: Array) -> Array:
    """Sums (n + 1, …) of the values (n, …) before each place."""
    return np.concatenate([np.zeros((1, *values.shape[1:])), np.cumsum(values, axis=0)])
