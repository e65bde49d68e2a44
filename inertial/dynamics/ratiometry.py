"""Zero and sensitivity over the supply voltage: departures from a ratiometric output, or from one that is independent of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from inertial.distributions import chi2_tail
from inertial.dynamics.goodness import ADEQUATE_P

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Follows:
    """Departures at n supply voltages, those at the first one being zero.

    Attributes
    ----------
    supply : (n,), V
    sensitivity, sensitivity_error : (n,), share of the sensitivity at the first supply, and its standard uncertainty
    zero_g, zero_error_g : (n,), g
    slope_g_V, slope_error_g_V : of the zero over the supply, by weighted least squares through the first point
    scale : sensitivity at the first supply, output per g, positive
    own_error, own_zero_error : (n,), share and g, of each supply without that of the first, which departures have in common
    """

    supply: Array
    sensitivity: Array
    sensitivity_error: Array
    zero_g: Array
    zero_error_g: Array
    slope_g_V: float
    slope_error_g_V: float
    scale: float
    own_error: Array
    own_zero_error: Array


def zero_and_sensitivity(means: Array, errors: Array) -> tuple[Array, Array, Array]:
    """Zero and sensitivity per g from the two faces, and the standard uncertainty of both; each (n,), unit of the output.

    zero = (o₊ + o₋)/2, sensitivity = (o₊ − o₋)/2: independent for equal uncertainties of the faces.

    Parameters
    ----------
    means, errors : (n, 2), output on the two faces
    """
    both = 0.5 * np.hypot(errors[:, 0], errors[:, 1])
    return 0.5 * (means[:, 0] + means[:, 1]), 0.5 * (means[:, 0] - means[:, 1]), both


def departures(
    supply: Array, zero: Array, sensitivity: Array, error: Array, *, follows: bool, zero_error: Array | None = None
) -> Follows:
    """Departures from the values at the first supply; for an output that follows the supply after division by the voltage ratio.

    Ratiometric error of the sensitivity: S(V)/S(V₀)·V₀/V − 1. The point at V₀ is common, so departures share its uncertainty.

    Parameters
    ----------
    supply, zero, sensitivity, error : (n,)
    zero_error : (n,), that of the zero where it differs: wander is common to both faces, and leaves with their difference alone
    follows : whether the output is to be proportional to the supply
    """
    ratio = supply / supply[0] if follows else np.ones_like(supply)
    scale = float(abs(sensitivity[0]))
    own = error / ratio / scale
    gain = sensitivity / ratio / sensitivity[0] - 1.0
    level = (zero / ratio - zero[0]) / scale
    spread = np.where(np.arange(len(supply)) == 0, 0.0, np.hypot(own, own[0]))
    own_zero = own if zero_error is None else zero_error / ratio / scale
    zero_spread = np.where(np.arange(len(supply)) == 0, 0.0, np.hypot(own_zero, own_zero[0]))
    slope, slope_error, _ = _line(supply, level, own_zero)
    return Follows(supply, gain, spread, level, zero_spread, slope, slope_error, scale, own, own_zero)


def largest_departure(supply: Array, departure: Array, own: Array) -> tuple[float, float]:
    """Largest departure over the supplies and its standard uncertainty, unit of the departures.

    The largest of several departures within the noise is that of the noise: for four of no true departure it is 1.6 standard
    uncertainties on average. So where a straight line through the first supply is adequate (χ², p ≥ 0.005), the departure is the
    line's at the supply that is farthest from the first, which noise does not choose. Else some departure is significant, and the
    largest is taken.

    Parameters
    ----------
    supply, departure : (n,), that of the first supply is 0; own : (n,), standard uncertainties without the first one's share
    """
    slope, error, square = _line(supply, departure, own)
    if chi2_tail(square, max(1, len(supply) - 2)) >= ADEQUATE_P:
        step = float(max(supply - supply[0], key=abs))
        return slope * step, error * abs(step)
    k = int(np.argmax(np.abs(departure)))
    return float(departure[k]), float(np.hypot(own[k], own[0]))


def _line(supply: Array, departure: Array, own: Array) -> tuple[float, float, float]:
    """Slope of a straight line through the first supply, its standard uncertainty, and χ²; departures share the first's error."""
    step = (supply - supply[0])[1:]
    covariance = np.diag(own[1:] ** 2) + own[0] ** 2
    weight = np.linalg.solve(covariance, step)
    norm = float(step @ weight)
    slope = float(weight @ departure[1:]) / norm
    left = departure[1:] - slope * step
    return slope, float(norm**-0.5), float(left @ np.linalg.solve(covariance, left))
