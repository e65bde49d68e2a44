"""A curve of one driver with the same shape for every unit and axis: the sign of an effect that the catalogue lacks."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from inertial.criticism.candidate import Candidate
from inertial.criticism.model import Model
from inertial.criticism.penalty import PER_COEFFICIENT, cost_of_model
from inertial.criticism.space import Space

Array = NDArray[np.float64]

_TURNS = 8  # alternating estimates of sizes and shape


@dataclass(frozen=True)
class CurveFit:
    """A common curve beside a model.

    model : the model with the curve in it
    rank : number of coefficients, of sizes and shape
    cost : penalised deviance, on the scale of the search
    """

    driver: str
    model: Model
    rank: int
    cost: float


def fit_curve(model: Model, driver: str, candidate: Candidate) -> CurveFit:
    """The best common curve of a driver added to a model, with the noise estimated again."""
    if candidate.shared:
        fitted = model.with_shared_curves(candidate.of_blocks[:, :, 0, :])
        return CurveFit(driver, fitted, fitted.space.shared_rank, cost_of_model(fitted))
    noise, fitted, rank = model.noise, model, 0
    for _ in range(2):
        column, rank = _curve(model.at(noise), candidate)
        fitted = model.with_curves(column)
        noise = fitted.noise
    shape = rank - model.problem.blocks
    return CurveFit(driver, fitted, rank, cost_of_model(fitted) + PER_COEFFICIENT * shape)


def _curve(space: Space, candidate: Candidate) -> tuple[Array, int]:
    """Column (blocks, n, 1) of the common curve that reduces the residual most, and its number of coefficients."""
    whole = candidate.of_blocks[:, :, 0, :]
    white = space.whiten(whole)
    free = space.project(white)
    even = _evened(np.einsum("bnp,bnr->pr", free, free), np.sqrt(np.einsum("bnp,bnp->p", white, white)))
    whole, free = whole @ even, free @ even
    gram = np.swapaxes(free, -1, -2) @ free
    right = np.einsum("bnp,bn->bp", free, space.residual)
    ridge = 1e-9 * np.eye(gram.shape[-1])
    own = np.linalg.solve(gram + 1e-6 * np.eye(gram.shape[-1]), right[..., None])[..., 0]
    shape = np.linalg.svd(own, full_matrices=False)[2][0].astype(
        np.float64
    )  # the leading direction of the blocks' own curves
    for _ in range(_TURNS):
        inner = np.einsum("p,bpr,r->b", shape, gram, shape)
        size = np.where(inner > 1e-12, np.einsum("bp,p->b", right, shape) / np.where(inner > 1e-12, inner, 1.0), 0.0)
        shape = np.linalg.solve(np.einsum("b,bpr->pr", size**2, gram) + ridge, np.einsum("b,bp->p", size, right))
        shape /= max(float(np.linalg.norm(shape)), 1e-300)
    return (whole @ shape)[..., None], len(right) + shape.size - 1


def _evened(gram: Array, size: Array) -> Array:
    """Transformation (p, r) to columns of equal size and no correlation over the lot, without the part that the model absorbs."""
    scale = np.maximum(size, 1e-300)
    values, vectors = np.linalg.eigh(gram / np.outer(scale, scale))
    keep = values > 1e-6 * values[-1]
    return (vectors[:, keep] / np.sqrt(values[keep])) / scale[:, None]
