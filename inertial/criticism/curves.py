"""A curve of one driver, the same for every unit and axis but for its size: the signature of physics that no effect describes."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from inertial.criticism.model import Model
from inertial.criticism.search import PER_COEFFICIENT, cost_of_model
from inertial.criticism.space import Candidate, Space

Array = NDArray[np.float64]

_TURNS = 8


@dataclass(frozen=True)
class CurveFit:
    """A common curve beside a model.

    model : the model with the curve in it
    rank : coefficients spent, sizes and shape together
    cost : penalised deviance, on the scale of the search
    """

    driver: str
    model: Model
    rank: int
    cost: float


def fit_curve(model: Model, driver: str, candidate: Candidate) -> CurveFit:
    """The best common curve of a driver beside a model, with the share of wander estimated anew."""
    if candidate.shared:
        fitted = model.with_shared_curves(candidate.columns[:, :, 0, :])
        return CurveFit(driver, fitted, fitted.space.shared_rank, cost_of_model(fitted))
    share, fitted, rank = model.share, model, 0
    for _ in range(2):
        column, rank = _curve(model.at(share), candidate)
        fitted = model.with_curves(column)
        share = fitted.share
    shape = rank - candidate.columns.shape[0]
    return CurveFit(driver, fitted, rank, cost_of_model(fitted) + PER_COEFFICIENT * shape)


def _curve(space: Space, candidate: Candidate) -> tuple[Array, int]:
    """Rotated column (blocks, n, 1) of the common curve that takes off most, and the coefficients it spends."""
    whole = candidate.columns[:, :, 0, :]
    free = space._project(whole / space.spread[..., None])  # noqa: SLF001  # the package's own projection
    target = space.residual
    gram = np.swapaxes(free, -1, -2) @ free
    right = np.einsum("bnp,bn->bp", free, target)
    ridge = 1e-8 * np.trace(gram.sum(axis=0)) / gram.shape[-1] * np.eye(gram.shape[-1])
    size = np.ones(len(right))
    shape = _principal(gram, right, ridge)
    for _ in range(_TURNS):
        inner = np.einsum("p,bpr,r->b", shape, gram, shape)
        size = np.where(inner > 1e-12, np.einsum("bp,p->b", right, shape) / np.where(inner > 1e-12, inner, 1.0), 0.0)
        shape = np.linalg.solve(np.einsum("b,bpr->pr", size**2, gram) + ridge, np.einsum("b,bp->p", size, right))
        shape /= max(float(np.linalg.norm(shape)), 1e-300)
    return (whole @ shape)[..., None], len(right) + shape.size - 1


def _principal(gram: Array, right: Array, ridge: Array) -> Array:
    """A start: the leading direction of the blocks' own curves."""
    own = np.linalg.solve(gram + ridge, right[..., None])[..., 0]
    mean = gram.mean(axis=0) + ridge
    root = np.linalg.cholesky(mean)
    _, _, directions = np.linalg.svd(own @ root, full_matrices=False)
    shape = np.linalg.solve(root.T, directions[0])
    return shape / max(float(np.linalg.norm(shape)), 1e-300)
