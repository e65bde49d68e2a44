"""Step responses: settling time, overshoot and damping of a second-order system."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from inertial.errors import NotIdentified

Array = NDArray[np.float64]


def settling_time(time: Array, response: Array, *, final: float, band: float) -> float:
    """Time in s from the first of `time` after which the response stays within ±`band` of `final`.

    Parameters
    ----------
    time : (n,), s
    response : (n,), any unit
    final, band : unit of the response

    Raises
    ------
    NotIdentified
        The response has not settled at the end of the record.
    """
    outside = np.flatnonzero(np.abs(response - final) > band)
    if outside.size == 0:
        return 0.0
    last = int(outside[-1])
    if last == len(time) - 1:
        off = abs(float(response[last]) - final)
        msg = f"settling: still {off:.3g} from the final value at {time[last]:.4g} s, within {band:.3g} is needed; record longer"
        raise NotIdentified(msg)
    return float(time[last + 1] - time[0])


def step_response(time: Array, natural_hz: float, damping: float) -> Array:
    """Response (n,) of a second-order system to a unit step at time 0."""
    wn = 2.0 * np.pi * natural_hz
    t = np.maximum(time, 0.0)
    if abs(damping - 1.0) < 1e-9:
        out = 1.0 - np.exp(-wn * t) * (1.0 + wn * t)
    else:
        root = np.sqrt(complex(damping**2 - 1.0))
        p1, p2 = wn * (-damping + root), wn * (-damping - root)
        out = 1.0 + np.real((p2 * np.exp(p1 * t) - p1 * np.exp(p2 * t)) / (p1 - p2))
    return np.where(time >= 0.0, out, 0.0)


def overshoot(damping: float) -> float:
    """Overshoot of the step response as a share of the step: e^(−πζ/√(1−ζ²)); 0 for ζ ≥ 1."""
    return 0.0 if damping >= 1.0 else float(np.exp(-np.pi * damping / np.sqrt(1.0 - damping**2)))


def damping_from_overshoot(share: float) -> float:
    """Damping ratio from the overshoot as a share of the step: −ln O/√(π² + ln²O)."""
    log = np.log(share)
    return float(-log / np.sqrt(np.pi**2 + log**2))
