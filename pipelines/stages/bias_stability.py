"""Bias stability over one hour: standard deviation of means over 100 s, in the last hour of the static record."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from inertial.distributions import chi2_upper

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

TERM = "stability_1h"
HOUR_S = 3600.0
MEAN_S = 100.0
_TAIL = 0.025


def bias_stability(record: Array, rate_hz: float) -> tuple[float, float, float] | None:
    """Standard deviation of the 36 means, and the ends of its 95 % interval by χ²; None for a record of less than an hour.

    Means of wander are not independent: the interval is that of 36 independent means, and a drift is part of the value.

    Parameters
    ----------
    record : (n,), at ``rate_hz``; the results have its unit
    """
    length, count = round(MEAN_S * rate_hz), int(HOUR_S / MEAN_S)
    if length < 1 or record.size < count * length or not np.all(np.isfinite(record[-count * length :])):
        return None
    means = record[-count * length :].reshape(count, length).mean(axis=1)
    value, dof = float(np.std(means, ddof=1)), count - 1
    low, high = (value * float(np.sqrt(dof / chi2_upper(p, dof))) for p in (_TAIL, 1.0 - _TAIL))
    return value, low, high
