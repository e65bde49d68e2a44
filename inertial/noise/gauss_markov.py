"""Bias as a sum of first-order Gauss–Markov processes db/dt = −b/T + w, the form in which a Kalman filter uses its noise."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import nnls

from inertial.arrays import Array

AT_MAXIMUM = 1.8927
"""Averaging time over T at which the Allan deviation of one process is largest."""


FLICKER_VARIANCE = 2.0 * np.log(2.0) / np.pi
"""Allan variance of flicker noise with B = 1: IEEE Std 952-1997, C.1.1.3."""

_SERIES = 1e-3  # of τ/T, below which the closed form loses its digits
_POINTS = 121  # averaging times at which the sum is fitted
_INSETS = np.linspace(-0.2, 0.9, 45)  # decades by which the extreme time constants lie inside the range
_FEW_DECADES = 2.0
_OF_A_STEP = 0.3
_PER_DECADE = 1.2  # processes; the Allan deviation is then flat to 1.5 %


def allan_variance(tau: ArrayLike, correlation_s: ArrayLike) -> Array:
    """Allan variance at ``tau`` s of a process of variance one and correlation time T.

    (2T/τ)·[1 − (T/2τ)·(3 − 4e^(−τ/T) + e^(−2τ/T))], the integral of the spectrum 4T/(1 + (2πfT)²); IEEE Std 952-1997, C.1.1.6.
    """
    x = np.asarray(tau, dtype=np.float64) / np.asarray(correlation_s, dtype=np.float64)
    safe = np.maximum(x, _SERIES)
    closed = 2.0 / safe * (1.0 - (3.0 - 4.0 * np.exp(-safe) + np.exp(-2.0 * safe)) / (2.0 * safe))
    return np.where(x < _SERIES, 2.0 * x / 3.0 - 0.5 * x**2, closed)


@dataclass(frozen=True)
class StepOfProcess:
    """A step of one process: x' = keep·x + e at its end, weight·x + ē its mean, x the value at its beginning.

    end_variance, mean_variance, covariance : of e, of ē, and between the two
    """

    keep: float
    weight: float
    end_variance: float
    mean_variance: float
    covariance: float

    def at_end(self) -> "StepOfProcess":
        """The step with the value at its end instead of the mean."""
        return StepOfProcess(self.keep, self.keep, self.end_variance, self.end_variance, self.end_variance)


def step_of_process(sd: float, correlation_s: float, seconds: float) -> StepOfProcess:
    """A step of a stationary process of standard deviation s and correlation time T.

    With u = Δt/T: keep φ = e^(−u), weight a = (1 − φ)/u. A mean over Δt has the variance s²·v, v = 2(u − 1 + φ)/u², and the
    covariance s²·a with either end of the step; what x explains of them is taken off:
    Var e = s²(1 − φ²), Var ē = s²(v − a²), Cov(e, ē) = s²·a·(1 − φ).
    """
    u = seconds / correlation_s
    lost = -float(np.expm1(-u))
    weight = lost / u
    series = 2.0 * u / 3.0 - 0.5 * u**2 + 7.0 * u**3 / 30.0
    rest = series if u < _SERIES else 2.0 * (u - lost) / u**2 - weight**2
    return StepOfProcess(1.0 - lost, weight, -(sd**2) * float(np.expm1(-2.0 * u)), sd**2 * rest, sd**2 * weight * lost)


def step_of_walk(walk: float, seconds: float) -> StepOfProcess:
    """A step of a random walk of coefficient K: K²Δt at its end, K²Δt/3 of its mean, K²Δt/2 between the two."""
    grown = walk**2 * seconds
    return StepOfProcess(1.0, 1.0, grown, grown / 3.0, grown / 2.0)


@dataclass(frozen=True)
class FlickerTerms:
    """Gauss–Markov processes whose sum has the flat Allan deviation of flicker noise with B = 1.

    sd : (k,), standard deviations over B; correlation_s : (k,)
    flatness : largest relative deviation of the Allan deviation from 0.664·B between ``shortest_s`` and ``longest_s``
    """

    sd: Array
    correlation_s: Array
    shortest_s: float
    longest_s: float
    flatness: float


def flicker_terms(shortest_s: float, longest_s: float, count: int | None = None) -> FlickerTerms:
    """Processes that approximate flicker noise between two averaging times.

    Time constants are evenly spaced in log τ; the weights are a non-negative least-squares fit to the relative Allan variance.
    Over three decades, three terms are within 9 %, four within 2 %.

    Parameters
    ----------
    shortest_s, longest_s : range of averaging times, s
    count : of processes; three up to two decades, else four

    Raises
    ------
    ValueError
        The range is empty.
    """
    if not 0.0 < shortest_s < longest_s:
        raise ValueError(f"flicker: averaging times from {shortest_s} to {longest_s} s, a range above 0 is needed")
    low, high = np.log10([shortest_s, longest_s])
    number = count or (3 if high - low <= _FEW_DECADES else 4)
    tau = np.logspace(low, high, _POINTS)
    best: tuple[float, Array, Array] | None = None
    for inset in _INSETS[0.45 * (high - low) > _INSETS]:
        constants = np.logspace(low + inset, high - inset, number) / AT_MAXIMUM
        model = allan_variance(tau[:, None], constants) / FLICKER_VARIANCE
        weights = _flat(model)
        off = float(np.max(np.abs(np.sqrt(model @ weights) - 1.0)))
        if best is None or off < best[0]:
            best = off, constants, weights
    if best is None:  # the grid of insets begins below every range
        raise ValueError("flicker: no time constants")
    off, constants, weights = best
    return FlickerTerms(np.sqrt(weights), constants, shortest_s, longest_s, off)


def flicker_of_steps(step_s: float, longest_s: float) -> FlickerTerms:
    """Processes for a filter that sees means over steps: flat to a third of a step, so that successive means are right too.

    With four processes that are flat from one step on, the innovations of flicker noise have a mean square of 1.05 and a
    correlation of −0.06; with these 1.00 and −0.01.
    """
    shortest = _OF_A_STEP * step_s
    count = max(3, int(np.ceil(_PER_DECADE * np.log10(longest_s / shortest))))
    return flicker_terms(shortest, longest_s, count)


def _flat(model: Array) -> Array:
    """Non-negative weights (k,) with ``model @ weights`` (t,) near one; each round gives the worst points more weight."""
    emphasis = np.ones(len(model))
    weights = nnls(model, emphasis)[0]
    for _ in range(6):
        off = np.abs(model @ weights - 1.0)
        emphasis *= 0.5 + off / max(float(off.max()), 1e-12)
        emphasis /= emphasis.max()
        weights = nnls(model * emphasis[:, None], emphasis)[0]
    return weights


@dataclass(frozen=True)
class BiasModel:
    """Noise of a corrected output, in g, by axis.

    white : (3,), N of IEEE Std 952, g/√Hz (two-sided: the mean over Δt has the variance N²/Δt)
    sd : (3, k), standard deviations of the Gauss–Markov processes; correlation_s : (k,), s
    walk : (3,), K, g/√s, of the random walk of the bias
    turn_on : (3,), standard deviation of the bias at the beginning, besides its processes
    """

    white: Array
    sd: Array
    correlation_s: Array
    walk: Array
    turn_on: Array


def bias_model(
    white: ArrayLike, instability: ArrayLike, walk: ArrayLike, turn_on: ArrayLike, flicker: FlickerTerms
) -> BiasModel:
    """The model of three axes from N, B and K of the Allan analysis, in g; the processes carry the flicker noise of B."""
    b = np.asarray(instability, dtype=np.float64)
    n, k, start = (np.broadcast_to(np.asarray(v, dtype=np.float64), b.shape) for v in (white, walk, turn_on))
    return BiasModel(n, b[:, None] * flicker.sd, flicker.correlation_s, k, start)
