"""Orthonormal bases of column spaces, eigenvalues of Gram matrices, and the threshold of visibility of a column."""

import numpy as np

from inertial.arrays import Array, Places

SEEN = 0.01
"""Norm of a column beyond the base model, over its norm, below which it is not visible: noise of the drivers leaves as much."""

_LEFT = 1e-8
"""Share of a target's sum of squares that remains by rounding where a projection removes all of it."""


def eigen(gram: Array) -> tuple[Array, Array]:
    """Eigenvalues (..., p), ascending, and vectors (..., p, p) of symmetric matrices; up to two rows without a solver."""
    if gram.shape[-1] == 1:
        return gram[..., 0], np.ones(gram.shape)
    if gram.shape[-1] == 2:
        return _eigen_of_two(gram)
    return np.linalg.eigh(gram)


def _eigen_of_two(gram: Array) -> tuple[Array, Array]:
    """Eigenvalues (..., 2) and vectors (..., 2, 2) of symmetric matrices (..., 2, 2), by the angle of their main axes."""
    first, second, beside = gram[..., 0, 0], gram[..., 1, 1], gram[..., 1, 0]
    half = 0.5 * (first - second)
    reach, middle = np.hypot(half, beside), 0.5 * (first + second)
    values, vectors = np.empty(gram.shape[:-1]), np.empty(gram.shape)
    values[..., 0], values[..., 1] = middle - reach, middle + reach
    # the form of each component that avoids cancellation
    large = np.hypot(reach + np.abs(half), beside)
    known = large > 0.0
    large = np.where(known, large, 1.0)
    cosine = np.where(known, (reach + np.abs(half)) / large, 1.0)
    sine = np.where(known, beside / large, 0.0)
    upper = half >= 0.0
    vectors[..., 0, 1] = np.where(upper, cosine, sine)
    vectors[..., 1, 1] = np.where(upper, sine, cosine)
    vectors[..., 0, 0] = -vectors[..., 1, 1]
    vectors[..., 1, 0] = vectors[..., 0, 1]
    return values, vectors


def inverse_roots(values: Array, least: float) -> Array:
    """Inverse square roots of eigenvalues (...); zero for eigenvalues not above ``least``."""
    seen = values > least
    return np.where(seen, 1.0 / np.sqrt(np.where(seen, values, 1.0)), 0.0)


def unit_columns(columns: Array) -> tuple[Array, Array]:
    """Columns (blocks, n, p) scaled to unit length, and their lengths (blocks, p); a zero column stays zero with length one."""
    size = np.sqrt(np.einsum("bnp,bnp->bp", columns, columns))
    size = np.where(size > 0.0, size, 1.0)
    return columns / size[:, None, :], size


def orthonormal(columns: Array) -> tuple[Array, Places]:
    """Orthonormal bases (blocks, n, p) of the column spaces, dependent directions set to zero; and the ranks (blocks,)."""
    return basis(columns)[:2]


def basis(columns: Array) -> tuple[Array, Places, float]:
    """Bases and ranks as of :func:`orthonormal`, and the log-determinant of the columns' Gram matrices, summed over the blocks.

    Eigenvalues of the scaled Gram matrix below ``SEEN``² count as ``SEEN``².
    """
    if columns.shape[-1] == 0:
        return columns, np.zeros(len(columns), dtype=np.intp), 0.0
    q, size = unit_columns(columns)
    keep = np.ones((1, 1), dtype=bool)
    determinant: float | None = None
    for tolerance in (1e-9, 0.5):  # the second pass removes rounding errors of the first
        values, vectors = np.linalg.eigh(np.swapaxes(q, -1, -2) @ q)
        if determinant is None:
            determinant = float(np.sum(np.log(np.maximum(values, SEEN**2))) + 2.0 * np.sum(np.log(size)))
        keep = values > tolerance
        q = q @ (vectors * inverse_roots(values, tolerance)[:, None, :])
    return q, keep.sum(axis=-1), determinant or 0.0


def schur(gram: Array, full: Array | None = None) -> float:
    """Residual sum of squares of the first target after regression on the others, from their Gram matrix (t, t).

    full : Gram matrix (t, t) before a projection; a target whose remaining sum of squares is rounding error is left out
    """
    squares = np.diag(gram)[1:]
    seen = squares > (0.0 if full is None else _LEFT * np.diag(full)[1:])
    if not seen.any():
        return float(gram[0, 0])
    size = np.sqrt(squares[seen])
    inner = gram[1:, 1:][np.ix_(seen, seen)] / np.outer(size, size)
    cross = gram[1:, 0][seen] / size
    return float(gram[0, 0] - cross @ np.linalg.lstsq(inner, cross, rcond=1e-8)[0])
