"""Variance of 1/f wander in a short series of means, beside known noise and fitted terms."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

Array = NDArray[np.float64]


def wander_variance(rows: Array, output: Array, known: Array, kernel: Array) -> float:
    """Variance of wander with the correlation ``kernel`` (n, n) beside a known covariance, by restricted likelihood.

    Parameters
    ----------
    rows : (n, terms); output : (n,), any unit
    known : (n, n), square of the output's unit
    """
    left = output - rows @ np.linalg.lstsq(rows, output, rcond=None)[0]
    size = float(left @ left) / max(1, len(left) - rows.shape[1])
    if size <= 0.0:
        return 0.0

    def cost(log: float) -> float:
        whole = known + np.exp(log) * kernel
        root = np.linalg.cholesky(whole)
        x, y = np.linalg.solve(root, rows), np.linalg.solve(root, output)
        normal = x.T @ x
        rest = y - x @ np.linalg.solve(normal, x.T @ y)
        return float(2.0 * np.sum(np.log(np.diag(root))) + np.linalg.slogdet(normal)[1] + rest @ rest)

    found: Any = minimize_scalar(cost, bounds=(np.log(1e-6 * size), np.log(1e3 * size)), method="bounded")
    return float(np.exp(found.x))
