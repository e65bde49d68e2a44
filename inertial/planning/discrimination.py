"""T-criterion: how far a plan parts rival effects, from the normal matrix of the model with all of them.

Each rival in turn is taken as the truth, with coefficients of a given size; the model with another in its place is fitted to
what it predicts. The chi-square that stays is the noncentrality of the test between the two; a T-optimal plan makes the smallest
of them large.

Source: A. C. Atkinson and V. V. Fedorov, "The design of experiments for discriminating between two rival models",
Biometrika 62 (1975) 57.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_SINGULAR, _RIDGE, _LEAST = 1e-11, 1e-12, 1e-300
"""Least eigenvalue of a scaled normal matrix that is determined; what is added to its diagonal; least diagonal before scaling."""

_OTHERS = 0.1
"""Share of the other pairs beside the one that is parted least."""

_NOTHING = 1e-12
"""Share of a rival's own information below which nothing is left of it."""


@dataclass(frozen=True)
class Discrimination:
    """Rivals that a plan is to tell apart.

    base : columns of the model that is fitted anyway, indices into the normal matrix
    rivals : per rival, its columns likewise
    sizes : per rival, (3, k), its coefficients per axis in units of the columns; zero on an axis that it does not concern
    wanted : chi-square of the wrong rival in the lot that is enough
    units : of the lot, all with effects of that size
    """

    base: tuple[int, ...]
    rivals: tuple[tuple[int, ...], ...]
    sizes: tuple[Array, ...]
    wanted: float
    units: int = 1

    def separations(self, matrix: Array) -> Array:
        """Chi-square (..., pairs) of every wrong rival over the axes and units, of normal matrices (..., 3, p, p)."""
        pairs = [
            (true, wrong) for true in range(len(self.rivals)) for wrong in range(len(self.rivals)) if wrong != true
        ]
        return self.units * np.stack([self._left(matrix, *pair).sum(axis=-1) for pair in pairs], axis=-1)

    def shortfall(self, matrix: Array) -> Array:
        """Root of the chi-square wanted over that reached, (..., pairs): above one where rivals are not parted yet.

        Infinite where the plan does not even determine the model that is fitted anyway.
        """
        base = list(self.base)
        inner, _ = _scaled(matrix[..., base, :][..., base])
        known = np.linalg.eigvalsh(inner)[..., 0] > _SINGULAR
        return np.where(np.all(known, axis=-1)[..., None], np.sqrt(self.wanted / self.separations(matrix)), np.inf)

    def value(self, matrix: Array) -> Array:
        """What an exchange makes small: minus the log of the least chi-square, and a little of the others'."""
        own = -np.log(self.separations(matrix))
        return own.max(axis=-1) + _OTHERS * own.mean(axis=-1)

    def _left(self, matrix: Array, true: int, wrong: int) -> Array:
        """Chi-square (..., 3) that the wrong rival beside the base leaves of the true one."""
        mine, kept = list(self.rivals[true]), [*self.base, *self.rivals[wrong]]
        size = self.sizes[true]
        whole = np.einsum("ak,...akl,al->...a", size, matrix[..., mine, :][..., mine], size)
        cross = np.einsum("...akl,al->...ak", matrix[..., kept, :][..., mine], size)
        scaled, scale = _scaled(matrix[..., kept, :][..., kept])
        part = cross / scale
        taken = np.einsum(
            "...ak,...ak->...a", part, np.linalg.solve(scaled + _RIDGE * np.eye(len(kept)), part[..., None])[..., 0]
        )
        return np.maximum(whole - taken, _NOTHING * np.maximum(whole, _LEAST))


def _scaled(matrix: Array) -> tuple[Array, Array]:
    """Normal matrices with a diagonal of ones, and the root of what it was; a column of zeros stays one."""
    scale = np.sqrt(np.maximum(np.diagonal(matrix, axis1=-2, axis2=-1), _LEAST))
    return matrix / (scale[..., :, None] * scale[..., None, :]), scale
