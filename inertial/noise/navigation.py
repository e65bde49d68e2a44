"""What the noise of an accelerometer does to a position without aiding, and the densities that a Kalman filter asks for."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from inertial.arrays import Array

HOUR_S = 3600.0
PER_G = 9.80665
TO_M_S2: Mapping[str, float] = {"g": PER_G, "mg": 1e-3 * PER_G, "µg": 1e-6 * PER_G, "m/s^2": 1.0, "m/s²": 1.0}
TIMES_S = (1.0, 10.0, 60.0, 600.0, 3600.0)


@dataclass(frozen=True)
class NavigationError:
    """Standard deviations by one axis that is integrated from a known start.

    velocity_random_walk : m/s/√h, 60·N; None where N is not identified
    q_n, q_b : N² in (m/s²)²/Hz and B² in (m/s²)², for the measurement and the bias state [a, b] of a filter; None likewise
    velocity, position : (n,) m/s and m, at the times asked for
    """

    velocity_random_walk: float | None
    q_n: float | None
    q_b: float | None
    velocity: Array
    position: Array


def navigation_error(terms: Mapping[str, float | None], unit: str, time: Array) -> NavigationError:
    """The error of velocity and position by velocity random walk N, bias instability B and acceleration random walk K.

    White noise: σ_v² = N²·t, σ_p² = N²·t³/3. A bias that walks: K²·t³/3 and K²·t⁵/20. The bias instability counts as a constant
    bias of that standard deviation, which it is for times up to that of the flat part of the Allan curve, and too much beyond:
    B²·t² and B²·t⁴/4 (IEEE Std 952, annex C, for the spectra).

    Parameters
    ----------
    terms : N, B and K in ``unit``/√Hz, ``unit`` and ``unit``/√s; None, and counted as zero, where they are not identified
    unit : of acceleration, a key of ``TO_M_S2``
    time : (n,), s
    """
    factor = TO_M_S2[unit]
    known = {name: None if terms.get(name) is None else factor * float(terms[name] or 0.0) for name in "NBK"}
    n, b, k = (known[name] or 0.0 for name in "NBK")
    t = np.asarray(time, dtype=np.float64)
    velocity = np.sqrt(n**2 * t + b**2 * t**2 + k**2 * t**3 / 3.0)
    position = np.sqrt(n**2 * t**3 / 3.0 + b**2 * t**4 / 4.0 + k**2 * t**5 / 20.0)
    walk = None if known["N"] is None else float(np.sqrt(HOUR_S)) * n
    squares = [None if known[name] is None else value**2 for name, value in (("N", n), ("B", b))]
    return NavigationError(walk, squares[0], squares[1], velocity, position)
