"""What columns leave of measurements, by the products of all of them with each other."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from inertial.estimation.bases import SEEN

Array = NDArray[np.float64]

_HANGING = 1e-3
"""Independent part of a column below which a single factorisation is inaccurate."""

_FIRM = 1e4
"""Largest inverse eigenvalue of the products of columns of unit length at which their order is of no account."""

_ABSORBED = 1e-8
"""Share of the squares of a column that all blocks share below which products are too inaccurate for what is left of it."""


@dataclass(frozen=True)
class Left:
    """What columns with coefficients by block leave of measurements, beside those that all blocks share.

    information : log|HᵀV⁻¹H| of the columns H with coefficients by block; squares : (blocks,), sums of squares
    sizes : (q + 1,), what the columns that all blocks share, and the measurements, have in what is left; None if there are none
    root : (blocks, r, r), lower factor of the products of the columns of unit length
    """

    information: float
    squares: Array
    sizes: Array | None = None
    root: Array | None = None

    @property
    def firm(self) -> bool:
        """Whether another order of the same columns gives the same numbers: no combination of them nearly vanishes.

        The smallest eigenvalue of the products is at least one over the sum of squares of the inverse factor.
        """
        if self.root is None:
            return False
        return float(np.max(np.sum(np.linalg.inv(self.root) ** 2, axis=(1, 2)), initial=0.0)) < _FIRM


def factorised(products: Array) -> Left | None:
    """What columns leave of measurements; None if columns are collinear.

    Parameters
    ----------
    products : (blocks, r + 1, r + 1), of the columns, and of the measurements, which are last
    """
    size = np.sqrt(np.maximum(np.diagonal(products, axis1=-2, axis2=-1), 1e-300))
    try:
        root = np.linalg.cholesky(products / (size[:, :, None] * size[:, None, :]))
    except np.linalg.LinAlgError:
        return None
    diagonal = np.diagonal(root, axis1=-2, axis2=-1)
    if float(diagonal[:, :-1].min(initial=1.0)) < _HANGING:
        return None
    information = 2.0 * float(np.sum(np.log(diagonal[:, :-1] * size[:, :-1])))
    squares = np.asarray((diagonal[:, -1] * size[:, -1]) ** 2, dtype=np.float64)
    return Left(information, squares, root=np.asarray(root[:, :-1, :-1], dtype=np.float64))


def beside_common(products: Array, common: NDArray[np.bool_], scale: Array) -> Left | None:
    """The same where all blocks share some coefficients; None if any columns are collinear.

    Parameters
    ----------
    common : (r,), whether all blocks share the coefficient of a column
    scale : (blocks,), standard deviations of the blocks, by which they weigh in the common coefficients
    """
    size = np.sqrt(np.maximum(np.diagonal(products, axis1=-2, axis2=-1), 1e-300))
    unit = products / (size[:, :, None] * size[:, None, :])
    own, joint = np.flatnonzero(~common), np.append(np.flatnonzero(common), common.size)
    inner, across = unit[:, own[:, None], own], unit[:, own[:, None], joint]
    values = np.linalg.eigvalsh(inner)
    if float(values[:, :1].min(initial=1.0)) < SEEN**2:
        return None  # some are limited in what they count
    left = unit[:, joint[:, None], joint] - np.swapaxes(across, -1, -2) @ np.linalg.solve(inner, across)
    left *= size[:, joint, None] * size[:, None, joint]
    whole = np.sum(left / scale[:, None, None] ** 2, axis=0)
    before = np.sum((size[:, joint] / scale[:, None]) ** 2, axis=0)
    after = np.diagonal(whole)
    if float((after[:-1] / before[:-1]).min(initial=1.0)) < _ABSORBED:
        return None
    root = np.sqrt(after[:-1])
    gram, right = whole[:-1, :-1] / np.outer(root, root), whole[:-1, -1] / root
    if float(np.linalg.eigvalsh(gram).min(initial=1.0)) < _ABSORBED:
        return None
    sizes = np.append(-np.linalg.solve(gram, right) / root, 1.0)
    information = float(np.sum(np.log(values))) + 2.0 * float(np.sum(np.log(size[:, own])))
    return Left(information, np.einsum("s,bst,t->b", sizes, left, sizes), sizes)
