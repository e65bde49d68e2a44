"""T-criterion: how well a plan discriminates between rival effects, from the normal matrix of the model with all of them.

Each rival in turn is taken as the truth, with coefficients of a given size; the model with another rival instead is fitted
to the predicted data. The remaining χ² is the noncentrality of the test between the two; a T-optimal plan maximises the
smallest of them.

Source: A. C. Atkinson and V. V. Fedorov, "The design of experiments for discriminating between two rival models",
Biometrika 62 (1975) 57.
"""

from dataclasses import dataclass
from itertools import permutations

import numpy as np

from inertial.arrays import Array

_SINGULAR, _RIDGE, _TINY = 1e-11, 1e-12, 1e-300
"""Smallest eigenvalue of a determined, scaled normal matrix; ridge added to its diagonal; smallest diagonal before scaling."""

_OTHERS = 0.1  # weight of the other pairs beside the pair with the smallest separation
_NEGLIGIBLE = 1e-12  # fraction of a rival's own information below which its separation counts as zero


@dataclass(frozen=True)
class Discrimination:
    """Rival effects that a plan must discriminate between.

    base : indices of the base model's columns in the normal matrix
    rivals : per rival, the indices of its columns
    sizes : per rival, (axes, k), its coefficients per axis in units of the columns; zero on an axis that it does not act on
    chi_square : χ² of the wrong rival over the lot that counts as enough
    units : number of units in the lot, all with effects of that size
    """

    base: tuple[int, ...]
    rivals: tuple[tuple[int, ...], ...]
    sizes: tuple[Array, ...]
    chi_square: float
    units: int = 1

    def separations(self, matrix: Array) -> Array:
        """χ² (..., pairs) of every wrong rival, summed over axes and units, of normal matrices (..., axes, p, p)."""
        pairs = permutations(range(len(self.rivals)), 2)
        each = [self._remaining_chi_square(matrix, *pair).sum(axis=-1) for pair in pairs]
        return self.units * np.stack(each, axis=-1)

    def ratio_to_required(self, matrix: Array) -> Array:
        """√(required χ² / reached χ²), (..., pairs): above 1 where a pair is not discriminated yet.

        Infinite where the plan does not determine the base model.
        """
        base = list(self.base)
        inner, _ = _scaled(matrix[..., base, :][..., base])
        known = np.linalg.eigvalsh(inner)[..., 0] > _SINGULAR
        return np.where(np.all(known, axis=-1)[..., None], np.sqrt(self.chi_square / self.separations(matrix)), np.inf)

    def objective(self, matrix: Array) -> Array:
        """The function that an exchange minimises: −log of the smallest χ², plus a small weight of the others."""
        costs = -np.log(self.separations(matrix))
        return costs.max(axis=-1) + _OTHERS * costs.mean(axis=-1)

    def _remaining_chi_square(self, matrix: Array, true: int, wrong: int) -> Array:
        """χ² (..., axes) of the true rival after a fit of the base model and the wrong rival."""
        of_true, fitted = list(self.rivals[true]), [*self.base, *self.rivals[wrong]]
        size = self.sizes[true]
        total = np.einsum("ak,...akl,al->...a", size, matrix[..., of_true, :][..., of_true], size)
        cross = np.einsum("...akl,al->...ak", matrix[..., fitted, :][..., of_true], size)
        scaled, scale = _scaled(matrix[..., fitted, :][..., fitted])
        part = cross / scale
        absorbed = np.einsum(
            "...ak,...ak->...a", part, np.linalg.solve(scaled + _RIDGE * np.eye(len(fitted)), part[..., None])[..., 0]
        )
        return np.maximum(total - absorbed, _NEGLIGIBLE * np.maximum(total, _TINY))


def _scaled(matrix: Array) -> tuple[Array, Array]:
    """Normal matrices scaled to a diagonal of ones, and the roots of the original diagonal; a column of zeros keeps zeros."""
    scale = np.sqrt(np.maximum(np.diagonal(matrix, axis1=-2, axis2=-1), _TINY))
    return matrix / (scale[..., :, None] * scale[..., None, :]), scale
