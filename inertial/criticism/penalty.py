"""The price of an effect: penalised deviance, and the probability that noise alone takes off as much."""

import numpy as np
from scipy import stats

from inertial.criticism.model import Model, Term
from inertial.criticism.problem import Problem
from inertial.criticism.space import Space

PER_COEFFICIENT = 2.5
PER_COLUMN = 6.0
"""Penalty, in chi-square, for each coefficient and each column: a larger effect must earn its size."""


def cost_of(rank: int, columns: int, nonlinear: int) -> float:
    """Penalty of an effect, in chi-square."""
    return PER_COEFFICIENT * (rank + nonlinear) + PER_COLUMN * columns


def cost_in(problem: Problem, rank: int, nonlinear: int) -> float:
    """Penalty of an effect that the plan determines so many coefficients of, in chi-square."""
    return cost_of(rank, max(1, round(rank / problem.blocks)), nonlinear)


def log_p_value(space: Space, drop: float, rank: int) -> float:
    """Natural logarithm of the probability that noise alone takes off so much with so many coefficients."""
    after = space.dof - rank
    if rank == 0 or after <= 0:
        return 0.0
    left = max(space.rss - drop, 1e-300)
    return float(stats.f.logsf((drop / rank) / (left / after), rank, after))


def deviance(space: Space, drop: float = 0.0) -> float:
    """−2 log likelihood, up to a constant, of what a model leaves, less ``drop`` of its sum of squares."""
    count = space.basis.count
    return count * float(np.log(max(space.rss - drop, 1e-300) / count)) + space.logdet


def cost_of_model(model: Model) -> float:
    """Penalised deviance of a whole model: the fewer coefficients and columns, the better."""
    space = model.space
    nonlinear = sum(freedom(t) for t in model.terms)
    columns = model.local.shape[-1] + model.shared.shape[-1]
    return deviance(space) + cost_of(space.local_rank + space.shared_rank, columns, nonlinear)


def freedom(term: Term) -> int:
    """Number of nonlinear parameters that were found from the data: one, or three where the axes have their own."""
    return sum(len(v) if isinstance(v, tuple) else 1 for v in term.keywords.values()) if term.effect.nonlinear else 0
