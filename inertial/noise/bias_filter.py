"""Tracking of the bias of three axes: a Kalman filter that is updated only where the specific force is known.

Specific force and bias add in the output, so the bias can be estimated only where the force is known. Between updates the bias
drifts, and its standard deviation grows according to the noise model.
"""

from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from inertial.distributions import chi2_quantile
from inertial.noise.gauss_markov import BiasModel

Array = NDArray[np.float64]

AXES = 3
GATE_SIGMA = 5.0
_FEWEST = 8  # updates that are needed to judge their consistency


@dataclass
class BiasFilter:
    """Bias of three axes as processes db/dt = −b/T + w and a walk; the state of an axis is its k processes and the walk.

    A step of Δt multiplies a process by φ = e^(−Δt/T) and adds the variance s²(1 − φ²); it adds K²Δt to the walk. The constant
    part of the bias, that of the last switch-on, is the walk's value at the beginning.
    """

    model: BiasModel
    rejected: int = 0
    innovations: list[tuple[int, float]] = field(default_factory=list[tuple[int, float]])
    """Channel and innovation over its standard deviation, of every update that was accepted; channel 3 is the magnitude."""
    _x: Array = field(init=False, repr=False)
    _p: Array = field(init=False, repr=False)
    _sum: Array = field(init=False, repr=False)

    def __post_init__(self) -> None:
        model = self.model
        width = model.sd.shape[1] + 1
        first = np.concatenate([model.sd**2, model.turn_on[:, None] ** 2], axis=1)
        self._x = np.zeros(AXES * width)
        self._p = np.diag(first.ravel())
        self._sum = np.kron(np.eye(AXES), np.ones(width)).astype(np.float64)

    @property
    def bias(self) -> Array:
        """Bias (3,), g."""
        return self._sum @ self._x

    @property
    def covariance(self) -> Array:
        """Covariance (3, 3) of the error of the bias, g²."""
        return self._sum @ self._p @ self._sum.T

    def predict(self, seconds: float) -> None:
        """Propagates state and covariance over a time step; exact for a step of any length."""
        if seconds <= 0.0:
            return
        model = self.model
        keep = np.exp(-seconds / model.correlation_s)
        grown = np.concatenate([model.sd**2 * (1.0 - keep**2), model.walk[:, None] ** 2 * seconds], axis=1)
        phi = np.tile(np.append(keep, 1.0), AXES)
        self._x = phi * self._x
        self._p = phi[:, None] * self._p * phi + np.diag(grown.ravel())

    def known_force(self, difference: Array, seconds: float) -> None:
        """Updates with corrected output minus true force (3,), g, each a mean over ``seconds``."""
        for axis in range(AXES):
            self._update(self._sum[axis], float(difference[axis]), float(self.model.white[axis] ** 2) / seconds, axis)

    def known_magnitude(self, force: Array, magnitude: float, seconds: float) -> None:
        """Updates with the magnitude of the force alone: a unit at rest in any pose, its corrected output ``force`` (3,), g.

        It corrects the bias along the force only, to first order in the bias.
        """
        length = float(np.linalg.norm(force))
        along = force / length
        variance = float(along**2 @ self.model.white**2) / seconds
        # force still contains the bias: its length minus the magnitude is the bias along it
        self._update(along @ self._sum, length - magnitude, variance, AXES)

    def _update(self, row: Array, measured: float, variance: float, channel: int) -> None:
        """One scalar update in Joseph's form; an innovation beyond the gate is counted and not used."""
        innovation = measured - float(row @ self._x)
        across = self._p @ row
        total = float(row @ across) + variance
        normalised = innovation / np.sqrt(total)
        if not abs(normalised) <= GATE_SIGMA:
            self.rejected += 1
            return
        self.innovations.append((channel, float(normalised)))
        gain = across / total
        self._x = self._x + gain * innovation
        left = np.eye(len(row)) - np.outer(gain, row)
        self._p = left @ self._p @ left.T + variance * np.outer(gain, gain)


@dataclass(frozen=True)
class Consistency:
    """Consistency of the innovations of a filter with the covariance that it states.

    nis : mean of their squares, each divided by its variance; low, high : its 95 % bounds, χ²(n)/n
    lag_1 : correlation of successive innovations of a channel; white where its magnitude is below ``lag_1_bound``
    stated : verdict on the stated uncertainty; None where there are too few innovations
    """

    count: int
    nis: float
    low: float
    high: float
    lag_1: float
    lag_1_bound: float
    stated: Literal["consistent", "too small", "too large"] | None


def consistency(innovations: list[tuple[int, float]]) -> Consistency:
    """The consistency of accepted innovations (NIS, whiteness): Bar-Shalom, Li, Kirubarajan (2001), 5.4.2."""
    n = len(innovations)
    if n < _FEWEST:
        return Consistency(n, np.nan, np.nan, np.nan, np.nan, np.nan, None)
    values = np.array([value for _, value in innovations])
    low, high = (float(chi2_quantile(p, n)) / n for p in (0.025, 0.975))
    channels = np.array([channel for channel, _ in innovations])
    products = [values[channels == c][1:] * values[channels == c][:-1] for c in np.unique(channels)]
    pairs = np.concatenate(products)
    nis = float(np.mean(values**2))
    lag = float(pairs.sum() / np.sum(values**2)) if pairs.size else 0.0
    bound = 1.96 / np.sqrt(max(pairs.size, 1))
    within = low <= nis <= high  # outside its bounds the NIS decides, inside them the correlation
    small, large = nis > high or (within and lag > bound), nis < low or (within and lag < -bound)
    return Consistency(
        n, nis, low, high, lag, float(bound), "too small" if small else "too large" if large else "consistent"
    )


@dataclass(frozen=True)
class Track:
    """Bias (n, 3) in g after each step, its covariance (n, 3, 3) in g², and which steps updated it (n,).

    expected, expected_covariance : the same before the update of the step, as known to a filter in real time
    """

    bias: Array
    covariance: Array
    expected: Array
    expected_covariance: Array
    updated: NDArray[np.bool_]
    consistency: Consistency
    rejected: int


def track(model: BiasModel, time: Array, force: Array, known: Array, magnitude: Array, seconds: float) -> Track:
    """The bias over steps, with updates where the force is known.

    Parameters
    ----------
    time : (n,), s, middles of the steps
    force : (n, 3), g, corrected output, means over steps of ``seconds``
    known : (n, 3), g, true force; NaN where it is not known
    magnitude : (n,), g, its magnitude where that alone is known; NaN elsewhere
    """
    tracker = BiasFilter(model)
    n = len(time)
    bias, covariance, updated = np.empty((n, AXES)), np.empty((n, AXES, AXES)), np.zeros(n, dtype=np.bool_)
    expected, before = np.empty_like(bias), np.empty_like(covariance)
    for k in range(n):
        accepted = len(tracker.innovations)
        tracker.predict(float(time[k] - time[k - 1]) if k else 0.0)
        expected[k], before[k] = tracker.bias, tracker.covariance
        if np.all(np.isfinite(known[k])):
            tracker.known_force(force[k] - known[k], seconds)
        elif np.isfinite(magnitude[k]):
            tracker.known_magnitude(force[k], float(magnitude[k]), seconds)
        updated[k] = len(tracker.innovations) > accepted  # not where every innovation was beyond the gate
        bias[k], covariance[k] = tracker.bias, tracker.covariance
    return Track(bias, covariance, expected, before, updated, consistency(tracker.innovations), tracker.rejected)
