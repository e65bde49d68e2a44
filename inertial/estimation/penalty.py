"""The price (penalty) of an effect's coefficients, and the probability that noise reduces the deviance as much."""

import numpy as np

from inertial.estimation.alternative import Handling
from inertial.estimation.model import Model
from inertial.estimation.noise_shares import deviance_of
from inertial.estimation.space import Gain, Space
from inertial.estimation.term import Term
from inertial.probability import log_f_tail

PER_COEFFICIENT = 2.5
PER_COLUMN = 6.0
"""Price, in chi-square, of each coefficient and each column where complete models, also with curves, are compared."""


def price(deviance: float, coefficients: float) -> float:
    """Price of k coefficients that reduce the deviance by D, in chi-square: k·(1 + ln(D/k)), or D where D ≤ k.

    For coefficients from a normal distribution of fitted variance, D less this price is twice the log evidence ratio.
    """
    if deviance <= coefficients or coefficients <= 0:
        return max(deviance, 0.0)
    return coefficients * (1.0 + float(np.log(deviance / coefficients)))


def fall(space: Space, gain: Gain) -> np.ndarray:
    """Reduction of the deviance (grid,) by a candidate at the shares of a space, with the variances estimated again."""
    prior = space.noise.prior
    if np.isfinite(prior) and gain.by_block.any():
        degrees = (space.by_block + prior)[:, None]
        return np.sum(-degrees * np.log1p(-np.minimum(gain.by_block / np.maximum(degrees, 1e-9), 0.999)), axis=0)
    dof = max(space.dof, 1)
    return -dof * np.log1p(-np.minimum(gain.drop / max(space.rss, 1e-300), 0.999))


def log_p_value(space: Space, drop: float, rank: int) -> float:
    """Log probability, by an F test, that noise reduces the sum of squares by ``drop`` with ``rank`` coefficients."""
    after = space.dof - rank
    if rank == 0 or after <= 0:
        return 0.0
    left = max(space.rss - drop, 1e-300)
    return float(log_f_tail((drop / rank) / (left / after), rank, after))


def cost_of_model(model: Model) -> float:
    """Penalised deviance of a complete model, with prices for coefficients and columns; smaller is better."""
    space = model.space
    nonlinear = sum(freedom(t) for t in model.terms)
    columns = model.local.shape[-1] + model.shared.shape[-1]
    rank = space.local_rank + space.shared_rank
    count = model.problem.covariance.count.astype(np.float64)
    deviance = space.logdet + deviance_of(space.squares, count)
    price_of_all = PER_COEFFICIENT * (rank + nonlinear) + PER_COLUMN * columns
    return deviance + price_of_all + of_few(model.problem.count, rank + nonlinear)


def of_few(count: int, coefficients: int) -> float:
    """Small-sample correction of the price of k coefficients with n measurements, in chi-square: 2k(k + 1)/(n − k − 1).

    Hurvich and Tsai, Biometrika 76 (1989) 297.
    """
    return 2.0 * coefficients * (coefficients + 1.0) / max(count - coefficients - 1, 1e-3)


def freedom(term: Term) -> int:
    """Number of nonlinear parameters of a term estimated from the data; a parameter with a value per axis counts per axis."""
    if isinstance(term.effect, Handling) or not term.effect.nonlinear:
        return 0
    return sum(len(v) if isinstance(v, tuple) else 1 for v in term.keywords.values())
