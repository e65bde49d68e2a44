"""Least squares of nonlinear models, many units at once: Gauss–Newton, each unit's step halved until it does not harm."""

from collections.abc import Callable

import numpy as np

from inertial.arrays import Array

_STEPS = 60
"""Steps, and halvings of one."""


def descended(theta: Array, step: Callable[[Array], Array], cost: Callable[[Array], Array], settled: float) -> Array:
    """Parameters of the least cost near a start.

    Parameters
    ----------
    theta : (units, ...), start; step : change that the linear model asks for; cost : (units,), of parameters
    settled : share of the cost that a last step takes off
    """
    before = cost(theta)
    for _ in range(_STEPS):
        theta, after = _advanced(theta, step(theta), before, cost)
        if np.all(before - after <= settled * (before + np.finfo(float).tiny)):
            break
        before = after
    return theta


def _advanced(theta: Array, step: Array, before: Array, cost: Callable[[Array], Array]) -> tuple[Array, Array]:
    """Parameters and costs after a step that is halved for each unit until it does not harm."""
    length = np.ones((len(theta), *[1] * (theta.ndim - 1)))
    trial = theta + step
    after = cost(trial)
    for _ in range(_STEPS):
        worse = ~(after <= before)
        if not worse.any():
            return trial, after
        length[worse] *= 0.5
        trial = theta + length * step
        after = cost(trial)
    worse = ~(after <= before)
    return np.where(worse.reshape(length.shape), theta, trial), np.where(worse, before, after)
