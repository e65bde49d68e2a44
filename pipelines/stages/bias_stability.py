"""Bias stability over one hour: standard deviation of means over 100 s, in the last hour of the static record."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from inertial.distributions import chi2_upper

Array = NDArray[np.float64]

TERM = "stability_1h"
HOUR_S = 3600.0
MEAN_S = 100.0
_TAIL = 0.025
PARTS = 100
"""Of a mean, by whose differences its white noise is known."""


def bias_stability(record: Array, rate_hz: float) -> tuple[float, float, float] | None:
    """Standard deviation of the 36 means, and the ends of its 95 % interval by χ²; None for a record of less than an hour.

    Means of wander are not independent: the degrees of freedom are those of the noise in the record. A drift is part of the
    value.

    Parameters
    ----------
    record : (n,), at ``rate_hz``; the results have its unit
    """
    length, count = round(MEAN_S * rate_hz), int(HOUR_S / MEAN_S)
    if length < 1 or record.size < count * length or not np.all(np.isfinite(record[-count * length :])):
        return None
    from inertial.dynamics.stability import dof_of_means  # loads scipy.stats, which a shorter record does not need

    means = record[-count * length :].reshape(count, length).mean(axis=1)
    size = max(1, length // PARTS)
    short = record[-(count * length // size * size) :].reshape(-1, size).mean(axis=1)
    white = float(np.var(np.diff(short), ddof=1)) / 2.0 * size / length
    value, dof = float(np.std(means, ddof=1)), dof_of_means(means, white)
    low, high = (value * float(np.sqrt(dof / chi2_upper(p, dof))) for p in (_TAIL, 1.0 - _TAIL))
    return value, low, high
