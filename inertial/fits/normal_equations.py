"""Normal equations of the units' own columns, and inverses of many of them at once."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from inertial.errors import NotIdentified

Array = NDArray[np.float64]

SINGULAR = 1e-11
"""Smallest eigenvalue of the scaled normal matrix: below, a coefficient is not determined."""

_DELICATE = 1e3
"""Variance inflation of a coefficient above which the solution is refined once."""

_SUSPICIOUS = 1e9
"""Variance inflation above which the eigenvalues are looked at."""


_MANY = 64
"""Matrices from which on they are inverted together: LAPACK takes them one by one."""


class LocalColumns:
    """Normal equations of the units' own columns, scaled; one system serves all units where they share design and weights."""

    def __init__(self, columns: Array, weight: Array | None, names: Sequence[Sequence[tuple[str, str]]]) -> None:
        self.columns, self.weight = columns, weight
        self.weighted = columns if weight is None else columns * weight[..., None]
        # columns are not scaled one by one: that is a second array as large as they are
        gram = np.swapaxes(self.weighted, -1, -2) @ self.weighted
        self.scale = np.sqrt(np.diagonal(gram, axis1=-2, axis2=-1))
        self._refuse_empty(names)
        self.gram_inverse = self._inverted(gram / (self.scale[..., :, None] * self.scale[..., None, :]), names)
        # the largest variance inflation: 1/v² of the column that the others leave least of
        self.delicate = float(np.max(np.diagonal(self.gram_inverse, axis1=-2, axis2=-1))) > _DELICATE
        self.inverse = self.gram_inverse / (self.scale[..., :, None] * self.scale[..., None, :])

    def _refuse_empty(self, names: Sequence[Sequence[tuple[str, str]]]) -> None:
        empty = np.argwhere(self.scale <= 0.0)
        if empty.size:
            axis, column = int(empty[0, -2]), int(empty[0, -1])
            effect, name = names[axis][column]
            raise NotIdentified(
                f"fit: {effect} ({name} of axis {'xyz'[axis]}) is zero in every dwell; "
                f"the plan must excite it; add poses or conditions that do, or leave it out of the model"
            )

    def _inverted(self, gram: Array, names: Sequence[Sequence[tuple[str, str]]]) -> Array:
        """Inverse of the scaled normal matrices; a singular one is refused with the coefficients it confuses."""
        inverse: Array
        try:
            inverse = inverses(gram)
        except np.linalg.LinAlgError:
            inverse = np.full(gram.shape, np.inf)
        inflation = np.diagonal(inverse, axis1=-2, axis2=-1)
        if np.all(inflation < _SUSPICIOUS) and np.all(inflation > 0.0):
            return inverse
        self._refuse_singular(gram, names)
        return inverse

    def _refuse_singular(self, gram: Array, names: Sequence[Sequence[tuple[str, str]]]) -> None:
        values, vectors = np.linalg.eigh(gram)
        bad = np.argwhere(values[..., 0] < SINGULAR)
        if not bad.size:
            return
        where = tuple(int(i) for i in bad[0])
        axis = where[-1]
        share = np.abs(vectors[(*where, slice(None), 0)])
        involved = [names[axis][i] for i in np.argsort(-share) if share[i] > 0.1]
        listed = ", ".join(f"{effect} ({name})" for effect, name in involved)
        raise NotIdentified(
            f"fit: the plan cannot tell these coefficients of axis {'xyz'[axis]} apart: {listed}; "
            f"add poses or temperatures that separate them, or leave one out of the model"
        )

    def solve(self, z: Array) -> Array:
        """Coefficients (..., 3, p) for targets (..., 3, n); with one step of refinement against the rounding of HᵀWH."""
        theta = self._step(z)
        return theta + self._step(z - self.apply(theta)) if self.delicate else theta

    def _step(self, z: Array) -> Array:
        weighted = z if self.weight is None else z * self.weight
        right = _apply(np.swapaxes(self.weighted, -1, -2), weighted) / self.scale
        return _apply(self.gram_inverse, right) / self.scale

    def apply(self, theta: Array) -> Array:
        """The model's output (..., 3, n)."""
        return _apply(self.columns, theta)

    def project_out(self, columns: Array) -> Array:
        """Weighted columns (..., 3, n, q) less what the local columns explain."""
        weighted = columns if self.weight is None else columns * self.weight[..., None]
        scaled = self.weighted / self.scale[..., None, :]
        inside = np.matmul(self.gram_inverse, np.matmul(np.swapaxes(scaled, -1, -2), weighted))
        return weighted - np.matmul(scaled, inside)

    def chi2(self, residual: Array) -> tuple[Array, Array]:
        """Weighted sum of squares and degrees of freedom, each (..., 3)."""
        weighted = residual if self.weight is None else residual * self.weight
        count = (
            np.full(residual.shape[:-1], residual.shape[-1])
            if self.weight is None
            or self.weight.all()  # to count along an axis takes as long as a product of all columns
            else np.count_nonzero(np.broadcast_to(self.weight, residual.shape), axis=-1)
        )
        return np.einsum("...n,...n->...", weighted, weighted), count - self.columns.shape[-1]


def inverses(gram: Array) -> Array:
    """Inverses of symmetric positive definite matrices (..., p, p); of many at once by Cholesky's method over all of them.

    Raises
    ------
    numpy.linalg.LinAlgError
        One is singular.
    """
    many = gram.reshape(-1, *gram.shape[-2:])
    if len(many) < _MANY:
        return np.linalg.inv(gram).astype(np.float64)
    p = gram.shape[-1]
    a = np.ascontiguousarray(many.transpose(1, 2, 0))
    lower, back, out = np.zeros_like(a), np.zeros_like(a), np.empty_like(a)
    with np.errstate(invalid="ignore", divide="ignore"):
        for k in range(p):
            column = a[k:, k] - np.einsum("jb,ijb->ib", lower[k, :k], lower[k:, :k])
            pivot = 1.0 / np.sqrt(column[0])
            lower[k:, k], back[k, k] = column * pivot, pivot
            back[k, :k] = -pivot * np.einsum("jb,jib->ib", lower[k, :k], back[:k, :k])
    for i in range(p):
        out[i, : i + 1] = np.einsum("kb,kjb->jb", back[i:, i], back[i:, : i + 1])
        out[: i + 1, i] = out[i, : i + 1]
    inverse = np.ascontiguousarray(out.transpose(2, 0, 1)).reshape(gram.shape)
    return inverse if np.all(np.isfinite(inverse)) else np.linalg.inv(gram).astype(np.float64)


def _apply(matrices: Array, vectors: Array) -> Array:
    """Matrices (..., 3, m, k) times vectors (..., 3, k), (..., 3, m).

    Matrices that all units share are put side by side in one (3k, 3m), so that the whole lot is a single product without a copy.
    """
    if matrices.ndim > 3 or vectors.ndim != 3:
        return np.matmul(matrices, vectors[..., None])[..., 0]
    _, m, k = matrices.shape
    together = np.zeros((k, 3, m, 3))
    for axis in range(3):
        together[:, axis, :, axis] = matrices[axis].T
    flat = np.swapaxes(vectors, -1, -2).reshape(-1, 3 * k)
    return np.swapaxes((flat @ together.reshape(3 * k, 3 * m)).reshape(-1, m, 3), -1, -2)
