"""Zero and sensitivity over the supply voltage: departures from a ratiometric output, or from one that is independent of it."""

from dataclasses import dataclass

import numpy as np

from inertial.arrays import Array
from inertial.distributions import chi2_tail
from inertial.dynamics.missing_effects import ADEQUATE_P

FEWEST_OF_PARABOLA = 3  # supplies: a parabola through the first has two coefficients
CLEAR_SQUARE_TERM = (
    2.58  # standard uncertainties of a parabola's square term, 1 % by chance, from which on no line is a slope
)


@dataclass(frozen=True)
class Follows:
    """Departures at n supply voltages, those at the first one being zero.

    supply : (n,), V
    sensitivity, sensitivity_error : (n,), share of the sensitivity at the first supply, and its standard uncertainty
    zero_g, zero_error_g : (n,), g
    slope_g_V, slope_error_g_V : of the zero over the supply, see :func:`slope_over`
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
    own_error = error / ratio / scale
    gain = sensitivity / ratio / sensitivity[0] - 1.0
    level = (zero / ratio - zero[0]) / scale
    spread = np.where(np.arange(len(supply)) == 0, 0.0, np.hypot(own_error, own_error[0]))
    own_zero_error = own_error if zero_error is None else zero_error / ratio / scale
    zero_spread = np.where(np.arange(len(supply)) == 0, 0.0, np.hypot(own_zero_error, own_zero_error[0]))
    slope, slope_error = slope_over(supply, level, own_zero_error)
    return Follows(supply, gain, spread, level, zero_spread, slope, slope_error, scale, own_error, own_zero_error)


def largest_departure(supply: Array, departure: Array, own_error: Array) -> tuple[float, float, int]:
    """Largest departure over the supplies, its standard uncertainty, unit of the departures, and the number of its supply.

    The largest of several departures within the noise is that of the noise: for four of no true departure it is 1.6 standard
    uncertainties on average. So where a straight line through the first supply is adequate (χ², p ≥ 0.005) and a parabola no
    better (its square term below one standard uncertainty), the departure is the line's at the supply that is farthest from the
    first, which noise does not choose; its uncertainty is the parabola's there, which a curve within the noise does not exceed.
    Where the parabola is adequate its largest departure is taken: one that is symmetric about the first supply leaves no slope.
    Else some departure is significant, and the largest is taken.

    Parameters
    ----------
    supply, departure : (n,), that of the first supply is 0; own_error : (n,), standard uncertainties without that of the first
    """
    step, enough = supply - supply[0], len(supply) >= FEWEST_OF_PARABOLA
    line = _curve(supply, departure, own_error, 1)
    bent = _curve(supply, departure, own_error, 2) if enough else line
    square_term = bent.square_term() if enough else 0.0
    if chi2_tail(line.square, max(1, len(supply) - 2)) >= ADEQUATE_P and square_term <= 1.0:
        k = int(np.argmax(np.abs(step)))
        return float(line.at(step)[k]), float(bent.error_at(step)[k]), k
    if enough and chi2_tail(bent.square, max(1, len(supply) - 3)) >= ADEQUATE_P:
        k = int(np.argmax(np.abs(bent.at(step))))
        return float(bent.at(step)[k]), float(bent.error_at(step)[k]), k
    k = int(np.argmax(np.abs(departure)))
    return float(departure[k]), float(np.hypot(own_error[k], own_error[0])), k


@dataclass(frozen=True)
class _Curve:
    """Coefficients (p,) of the powers of the step from the first supply, from the first on, their covariance, and χ²."""

    coefficients: Array
    covariance: Array
    square: float

    def _rows(self, step: Array) -> Array:
        return step[:, None] ** np.arange(1, len(self.coefficients) + 1)

    def square_term(self) -> float:
        """Size of the last coefficient in standard uncertainties."""
        return float(abs(self.coefficients[-1]) / np.sqrt(self.covariance[-1, -1]))

    def at(self, step: Array) -> Array:
        return np.asarray(self._rows(step) @ self.coefficients, dtype=np.float64)

    def error_at(self, step: Array) -> Array:
        rows = self._rows(step)
        return np.asarray(np.sqrt(np.sum(rows @ self.covariance * rows, axis=1)), dtype=np.float64)


def _curve(supply: Array, departure: Array, own_error: Array, order: int) -> _Curve:
    """A polynomial through the first supply by weighted least squares; departures share the first's error."""
    rows = (supply - supply[0])[1:, None] ** np.arange(1, order + 1)
    weighted = np.linalg.solve(np.diag(own_error[1:] ** 2) + own_error[0] ** 2, np.column_stack([rows, departure[1:]]))
    covariance = np.linalg.inv(rows.T @ weighted[:, :-1])
    c = covariance @ (rows.T @ weighted[:, -1])
    left = departure[1:] - rows @ c
    return _Curve(c, covariance, float(left @ (weighted[:, -1] - weighted[:, :-1] @ c)))


def slope_over(supply: Array, departure: Array, own_error: Array) -> tuple[float, float]:
    """Slope over the supply and its standard uncertainty: of the straight line, or to the supply of the largest departure.

    A curve that is symmetric about the first supply has a line without a slope, however far the output departs: the mean slope on
    the way to the largest departure is stated where the output is clearly no line.
    """
    line = _curve(supply, departure, own_error, 1)
    straight = chi2_tail(line.square, max(1, len(supply) - 2)) >= ADEQUATE_P
    if straight and (
        len(supply) < FEWEST_OF_PARABOLA or _curve(supply, departure, own_error, 2).square_term() <= CLEAR_SQUARE_TERM
    ):
        return float(line.coefficients[0]), float(np.sqrt(line.covariance[0, 0]))
    value, error, k = largest_departure(supply, departure, own_error)
    step = float(supply[k] - supply[0])
    return value / step, error / abs(step)
