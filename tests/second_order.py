"""The step response of a second-order system in closed form, for tests of what is read from records."""

import numpy as np


def step_response(time: np.ndarray, natural_hz: float, damping: float) -> np.ndarray:
    """Response (n,) to a unit step at time 0; damping other than 1."""
    wn, root = 2.0 * np.pi * natural_hz, np.sqrt(complex(damping**2 - 1.0))
    p1, p2 = wn * (-damping + root), wn * (-damping - root)
    t = np.maximum(time, 0.0)
    return np.where(time >= 0.0, 1.0 + np.real((p2 * np.exp(p1 * t) - p1 * np.exp(p2 * t)) / (p1 - p2)), 0.0)
