"""Tracking of the bias of three axes: a Kalman filter that is updated only where the specific force is known.

Specific force and bias add in the output, so the bias can be estimated only where the force is known. Between updates the bias
drifts, and its standard deviation grows according to the noise model.

What is measured is the mean of the output over a step, so the state of an axis contains the mean of its bias over the step
beside the values of its parts at the end of the step. Taken for the value at one time, the part of flicker noise that changes
within a step would count in full, and the stated variance of an update of flicker would be 1.6 times the true one.
"""

from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from scipy.linalg import block_diag

from inertial.arrays import Array, Flags
from inertial.distributions import chi2_quantile
from inertial.noise.gauss_markov import BiasModel, StepOfProcess, step_of_process, step_of_walk

AXES = 3
GATE_SIGMA = 5.0
_MOST_STEPS = 64  # of different lengths whose transitions are stored
_FEWEST = 8  # updates that are needed to judge their consistency


@dataclass
class BiasFilter:
    """Bias of three axes as processes db/dt = −b/T + w and a walk.

    The state of an axis is its k processes and the walk at the end of the last step, and the mean m of their sum over that step.
    A step of Δt takes a process x and its share of m to (:class:`inertial.noise.gauss_markov.StepOfProcess`)

        x' = φ·x + e,  m' = Σ (a·x + ē),  φ = e^(−Δt/T),  a = (1 − φ)·T/Δt

    with Var e = s²(1 − φ²), Var ē = s²(v − a²), Cov(e, ē) = s²·a·(1 − φ), v the variance of a mean over Δt. Of the walk they are
    K²Δt, K²Δt/3 and K²Δt/2, φ = a = 1. An update sees m and white noise of variance N²/Δt. The constant part of the bias, that of
    the last switch-on, is the walk's value at the beginning.
    """

    model: BiasModel
    rejected: int = 0
    innovations: list[tuple[int, float]] = field(default_factory=list[tuple[int, float]])
    """Channel and innovation over its standard deviation, of every update that was accepted; channel 3 is the magnitude."""
    begin: "BiasState | None" = None
    """Where it goes on; None: a new switch-on."""
    _x: Array = field(init=False, repr=False)
    _p: Array = field(init=False, repr=False)
    _mean: Array = field(init=False, repr=False)
    _steps: dict[tuple[float, float], tuple[Array, Array]] = field(
        init=False, repr=False, default_factory=dict[tuple[float, float], tuple[Array, Array]]
    )

    def __post_init__(self) -> None:
        first = first_covariances(self.model)
        width = first.shape[-1]
        self._x, self._p = np.zeros(AXES * width), _blocks(list(first))
        if self.begin is not None:
            self._x, self._p = self.begin.x.copy(), self.begin.p.copy()
        self._mean = np.kron(np.eye(AXES), np.arange(width) == width - 1).astype(np.float64)

    @property
    def state(self) -> "BiasState":
        """What it takes to go on after a pause."""
        return BiasState(self._x.copy(), self._p.copy())

    @property
    def bias(self) -> Array:
        """Bias (3,), g, its mean over the last step."""
        return self._mean @ self._x

    @property
    def covariance(self) -> Array:
        """Covariance (3, 3) of the error of the bias, g²."""
        return self._mean @ self._p @ self._mean.T

    def predict(self, seconds: float, averaged_s: float = 0.0) -> None:
        """Propagates state and covariance; exact for a time of any length.

        Parameters
        ----------
        seconds : from the end of the last step to the end of this one
        averaged_s : length of this step, over which the bias is a mean; 0: its value at the end
        """
        if seconds <= 0.0:
            return
        averaged = min(averaged_s, seconds)
        if seconds > averaged:
            self._propagate(seconds - averaged, 0.0)
        if averaged > 0.0:
            self._propagate(averaged, averaged)

    def _propagate(self, seconds: float, averaged_s: float) -> None:
        key = (seconds, averaged_s)
        if key not in self._steps:
            if len(self._steps) >= _MOST_STEPS:
                self._steps.clear()
            transitions, added = transitions_by_axis(self.model, seconds, mean=averaged_s > 0.0)
            self._steps[key] = _blocks(list(transitions)), _blocks(list(added))
        phi, grown = self._steps[key]
        self._x = phi @ self._x
        self._p = phi @ self._p @ phi.T + grown

    def known_force(self, difference: Array, seconds: float) -> None:
        """Updates with corrected output minus true force (3,), g, each a mean over ``seconds``."""
        for axis in range(AXES):
            self._update(self._mean[axis], float(difference[axis]), float(self.model.white[axis] ** 2) / seconds, axis)

    def known_magnitude(self, force: Array, magnitude: float, seconds: float) -> None:
        """Updates with the magnitude of the force alone: a unit at rest in any pose, its corrected output ``force`` (3,), g.

        It corrects the bias along the force only, to first order in the bias.
        """
        length = float(np.linalg.norm(force))
        along = force / length
        variance = float(along**2 @ self.model.white**2) / seconds
        # force still contains the bias: its length minus the magnitude is the bias along it
        self._update(along @ self._mean, length - magnitude, variance, AXES)

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
class BiasState:
    """State (3w,) of a filter, in g, and its covariance (3w, 3w), of the w parts of every axis."""

    x: Array
    p: Array


def first_covariances(model: BiasModel) -> Array:
    """Covariance (3, w, w), g², of the parts and the mean of every axis at switch-on: the mean is then the value."""
    parts = model.sd.shape[1] + 1
    first = np.concatenate([model.sd**2, model.turn_on[:, None] ** 2], axis=1)
    into = np.vstack([np.eye(parts), np.ones(parts)])
    return np.stack([into @ np.diag(variances) @ into.T for variances in first])


def transitions_by_axis(model: BiasModel, seconds: float, *, mean: bool) -> tuple[Array, Array]:
    """Transition and added covariance (3, w, w) of a time; ``mean``: the last part is the mean over it, else its end."""
    steps: list[tuple[Array, Array]] = []
    for axis in range(AXES):
        parts = [
            *(step_of_process(s, t, seconds) for s, t in zip(model.sd[axis], model.correlation_s, strict=True)),
            step_of_walk(model.walk[axis], seconds),
        ]
        steps.append(_axis_step(parts if mean else [part.at_end() for part in parts]))
    return np.stack([phi for phi, _ in steps]), np.stack([grown for _, grown in steps])


def _axis_step(parts: list[StepOfProcess]) -> tuple[Array, Array]:
    """Transition (w, w) and added covariance (w, w) of the state of one axis: its parts, then their common mean."""
    k = len(parts)
    phi, grown = np.zeros((k + 1, k + 1)), np.zeros((k + 1, k + 1))
    for index, part in enumerate(parts):
        phi[index, index], phi[k, index] = part.keep, part.weight
        grown[index, index] = part.end_variance
        grown[index, k] = grown[k, index] = part.covariance
    grown[k, k] = sum(part.mean_variance for part in parts)
    return phi, grown


def _blocks(parts: list[Array]) -> Array:
    return np.asarray(block_diag(*parts), dtype=np.float64)


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
    """Bias (n, 3) in g after each step, a mean over the step, its covariance (n, 3, 3) in g², and which steps updated it (n,).

    expected, expected_covariance : the estimate before the update of the step, as known to a filter in real time
    """

    bias: Array
    covariance: Array
    expected: Array
    expected_covariance: Array
    updated: Flags
    consistency: Consistency
    rejected: int
    end: BiasState


def track(
    model: BiasModel,
    time: Array,
    force: Array,
    known: Array,
    magnitude: Array,
    seconds: float,
    begin: tuple[BiasState, float] | None = None,
) -> Track:
    """The bias over steps, with updates where the force is known.

    Parameters
    ----------
    time : (n,), s, middles of the steps
    force : (n, 3), g, corrected output, means over steps of ``seconds``
    known : (n, 3), g, true force; NaN where it is not known
    magnitude : (n,), g, its magnitude where that alone is known; NaN elsewhere
    begin : a state to go on with, and its time, s: the middle of the step after which it was stored
    """
    tracker = BiasFilter(model, begin=None if begin is None else begin[0])
    n = len(time)
    bias, covariance, updated = np.empty((n, AXES)), np.empty((n, AXES, AXES)), np.zeros(n, dtype=np.bool_)
    expected, before = np.empty_like(bias), np.empty_like(covariance)
    for k in range(n):
        accepted = len(tracker.innovations)
        since = float(time[k] - time[k - 1]) if k else seconds if begin is None else float(time[0] - begin[1])
        tracker.predict(since, seconds)
        expected[k], before[k] = tracker.bias, tracker.covariance
        if np.all(np.isfinite(known[k])):
            tracker.known_force(force[k] - known[k], seconds)
        elif np.isfinite(magnitude[k]):
            tracker.known_magnitude(force[k], float(magnitude[k]), seconds)
        updated[k] = len(tracker.innovations) > accepted  # not where every innovation was beyond the gate
        bias[k], covariance[k] = tracker.bias, tracker.covariance
    return Track(
        bias, covariance, expected, before, updated, consistency(tracker.innovations), tracker.rejected, tracker.state
    )
