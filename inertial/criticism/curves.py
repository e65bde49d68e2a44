"""A curve of one driver with the same shape for every unit and axis: the sign of an effect that the catalogue lacks."""

from dataclasses import dataclass

import numpy as np

from inertial.arrays import Array
from inertial.criticism.drivers import Driver
from inertial.estimation.candidate import Candidate
from inertial.estimation.model import Model
from inertial.estimation.penalty import PER_COEFFICIENT, cost_of_model
from inertial.estimation.space import Space

_TURNS = 8  # alternating estimates of sizes and shape


@dataclass(frozen=True)
class CurveFit:
    """A common curve beside a model.

    driver : with the columns that the curve was made of; model : with the curve in it
    rank : number of coefficients, of sizes and shape
    cost : penalised deviance, on the scale of the search
    """

    driver: Driver
    model: Model
    rank: int
    cost: float


def fit_curve(model: Model, driver: Driver) -> CurveFit:
    """The best common curve of a driver added to a model, with the noise estimated again."""
    candidate = driver.candidate
    if candidate.shared:
        fitted = model.with_shared_curves(candidate.of_blocks[:, :, 0, :])
        return CurveFit(driver, fitted, fitted.space.shared_rank, cost_of_model(fitted))
    noise, fitted, rank = model.noise, model, 0
    for _ in range(2):
        columns, rank = _curve(model.at(noise), candidate, driver.ways)
        fitted = model.with_curves(columns)
        noise = fitted.noise
    shape = rank - driver.ways * model.problem.blocks
    return CurveFit(driver, fitted, rank, cost_of_model(fitted) + PER_COEFFICIENT * shape)


def _curve(space: Space, candidate: Candidate, ways: int) -> tuple[Array, int]:
    """Columns (blocks, n, ways) of the common curve that reduces the residual most, and its number of coefficients."""
    flat = candidate.of_blocks[:, :, 0, :]
    blocks, n = flat.shape[:2]
    white = space.whiten(flat)
    whole, white, free = (a.reshape(blocks, n, ways, -1) for a in (flat, white, space.project(white)))
    even = _evened(np.einsum("bnwp,bnwr->pr", free, free), np.sqrt(np.einsum("bnwp,bnwp->p", white, white)))
    whole = whole @ even
    free = (free @ even).reshape(blocks, n, -1)
    gram = np.swapaxes(free, -1, -2) @ free
    right = np.einsum("bnq,bn->bq", free, space.residual)
    own = np.linalg.solve(gram + 1e-6 * np.eye(gram.shape[-1]), right[..., None])[..., 0]
    count = even.shape[-1]
    gram, right = gram.reshape(blocks, ways, count, ways, count), right.reshape(blocks, ways, count)
    # the leading direction of the own curves of every block and way
    shape = np.linalg.svd(own.reshape(-1, count), full_matrices=False)[2][0].astype(np.float64)
    for _ in range(_TURNS):
        inner = np.einsum("p,bwpvr,r->bwv", shape, gram, shape) + 1e-12 * np.eye(ways)
        size = np.linalg.solve(inner, (right @ shape)[..., None])[..., 0]
        together = np.einsum("bw,bwpvr,bv->pr", size, gram, size) + 1e-9 * np.eye(count)
        shape = np.linalg.solve(together, np.einsum("bw,bwp->p", size, right))
        shape /= max(float(np.linalg.norm(shape)), 1e-300)
    return whole @ shape, blocks * ways + count - 1


def _evened(gram: Array, size: Array) -> Array:
    """Transformation (p, r) to columns of equal size and no correlation over the lot, without the part that the model absorbs."""
    scale = np.maximum(size, 1e-150)  # its square is a number, too
    values, vectors = np.linalg.eigh(gram / np.outer(scale, scale))
    keep = values > 1e-6 * values[-1]
    return (vectors[:, keep] / np.sqrt(values[keep])) / scale[:, None]
