"""A curve of one driver, the same for every unit and axis but for its size: the signature of physics that no effect describes."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from inertial.criticism.model import Model
from inertial.criticism.search import PER_COEFFICIENT, PER_COLUMN
from inertial.criticism.space import Candidate, Space

Array = NDArray[np.float64]

_TURNS = 8


@dataclass(frozen=True)
class CurveFit:
    """A common curve beside a model.

    column : (blocks, n, 1), rotated: the curve, whose size each block fits; for a station's driver the sum of its columns
    rank : coefficients spent, sizes and shape together
    cost : penalised deviance, on the scale of the search
    """

    driver: str
    model: Model
    rank: int
    cost: float


def fit_curve(model: Model, driver: str, candidate: Candidate) -> CurveFit:
    """The best common curve of a driver beside a model, with the share of wander estimated anew."""
    share = model.share
    fitted = model
    rank = 0
    for _ in range(2):
        space = model.at(share)
        column, rank = _curve(space, candidate)
        fitted = model.with_curves(column)
        share = fitted.share
    return CurveFit(driver, fitted, rank, cost_of_model(fitted, extra=rank - _sizes(candidate)))


def _sizes(candidate: Candidate) -> int:
    return 1 if candidate.shared else candidate.columns.shape[0]


def cost_of_model(model: Model, extra: int = 0) -> float:
    """Penalised deviance of a model: the fewer coefficients and effects, the better."""
    space, problem = model.space, model.problem
    logdet = float(np.sum(np.log(space.spread**2))) * (problem.blocks / space.spread.shape[0])
    deviance = problem.count * np.log(max(space.rss, 1e-300) / problem.count) + logdet
    coefficients = space.local_rank + space.shared_rank + extra
    nonlinear = sum(len(t.effect.parameters(problem.lot.state)) for t in model.terms)
    return float(deviance + PER_COEFFICIENT * (coefficients + nonlinear) + PER_COLUMN * model.local.shape[-1])


def _curve(space: Space, candidate: Candidate) -> tuple[Array, int]:
    """Rotated column (blocks, n, 1) of the common curve that takes off most, and the coefficients it spends."""
    whole = candidate.columns[:, :, 0, :]
    if candidate.shared:
        # a shared driver has one shape and one size: its best sum of columns is given to every block at its own scale
        shape = _shared_shape(space, whole)
        return (whole @ shape)[..., None], whole.shape[-1]
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


def _shared_shape(space: Space, whole: Array) -> Array:
    free = space._project(whole / space.spread[..., None]).reshape(-1, whole.shape[-1])  # noqa: SLF001
    return np.linalg.lstsq(free, space.residual.reshape(-1), rcond=1e-6)[0].astype(np.float64)
