"""The price of an effect, and the probability of the same reduction by noise."""

import numpy as np

from inertial.estimation.alternative import Handling
from inertial.estimation.model import Model
from inertial.estimation.noise_shares import deviance_of
from inertial.estimation.space import Gain, Space
from inertial.estimation.term import Term
from inertial.probability import log_f_tail

PER_COEFFICIENT = 2.5
PER_COLUMN = 6.0
"""Price, in chi-square, for each coefficient and each column where whole models are compared, curves among them."""


def price(deviance: float, coefficients: float) -> float:
    """Price of coefficients by their reduction D, in chi-square: k·(1 + ln(D/k)), and all of it where D is below k.

    Coefficients from a normal distribution whose variance is fitted to them: the evidence is the likelihood ratio less this.
    """
    if coefficients <= 0 or deviance <= coefficients:
        return max(deviance, 0.0)
    return coefficients * (1.0 + float(np.log(deviance / coefficients)))


def fall(space: Space, gain: Gain) -> np.ndarray:
    """Reduction of the deviance (grid,) by a candidate at the noise of a space, with the variances estimated again."""
    prior = space.noise.prior
    if np.isfinite(prior) and gain.by_block.any():
        degrees = (space.by_block + prior)[:, None]
        return np.sum(-degrees * np.log1p(-np.minimum(gain.by_block / np.maximum(degrees, 1e-9), 0.999)), axis=0)
    dof = max(space.dof, 1)
    return -dof * np.log1p(-np.minimum(gain.drop / max(space.rss, 1e-300), 0.999))


def log_p_value(space: Space, drop: float, rank: int) -> float:
    """Natural logarithm of the probability of such a reduction by noise with this number of coefficients."""
    after = space.dof - rank
    if rank == 0 or after <= 0:
        return 0.0
    left = max(space.rss - drop, 1e-300)
    return float(log_f_tail((drop / rank) / (left / after), rank, after))


def cost_of_model(model: Model) -> float:
    """Penalised deviance of a whole model: the fewer coefficients and columns, the better."""
    space = model.space
    nonlinear = sum(freedom(t) for t in model.terms)
    columns = model.local.shape[-1] + model.shared.shape[-1]
    rank = space.local_rank + space.shared_rank
    count = model.problem.covariance.count.astype(np.float64)
    deviance = space.logdet + deviance_of(space.squares, count)
    price_of_all = PER_COEFFICIENT * (rank + nonlinear) + PER_COLUMN * columns
    return deviance + price_of_all + of_few(model.problem.count, rank + nonlinear)


def of_few(count: int, coefficients: int) -> float:
    """What a deviance falls by chance beyond its price where few measurements are left to many coefficients.

    Hurvich and Tsai, Biometrika 76 (1989) 297: 2k(k + 1)/(n − k − 1).
    """
    return 2.0 * coefficients * (coefficients + 1.0) / max(count - coefficients - 1, 1e-3)


def freedom(term: Term) -> int:
    """Number of nonlinear parameters estimated from the data: one, or three if each axis has its own."""
    if isinstance(term.effect, Handling) or not term.effect.nonlinear:
        return 0
    return sum(len(v) if isinstance(v, tuple) else 1 for v in term.keywords.values())
