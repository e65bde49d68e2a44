"""Prediction of a station's next lot from its earlier ones: a local level that may wander, for every effect.

A slowly drifting reference that no column of the station describes is confounded with everything that changes slowly: a wafer, a
batch, a firmware. Each station therefore has a local-level model (random walk plus noise, Kalman filter), whose ratio of walk to
noise is chosen by the likelihood of the past. Drivers are judged by the innovations, against the prediction of the driver
passed through the same filter.
"""

from dataclasses import dataclass, field

import numpy as np

from inertial.arrays import Array, Flags, over
from inertial.discovery.running_sums import BOUND

WALKS: Array = np.array([0.0, 1e-4, 3e-4, 1e-3, 3e-3, 1e-2, 3e-2, 1e-1, 3e-1, 1.0])
"""Variance of the walk from one lot of a station to the next, over that of the noise of a lot."""

WALK_FROM = 2.0
"""Gain of log likelihood from which on stations have a random walk; a value constant within a lot may then be station wander."""


@dataclass
class Level:
    """Filter state of a station for each walk and effect: level and its variance, (q, h), whether it is known, (h,)."""

    mean: Array
    variance: Array
    known: Flags
    predictors: dict[str, Array] = field(default_factory=dict[str, Array])


@dataclass(frozen=True)
class Innovation:
    """Innovation of a lot: its deviation from the prediction by its station's past, over the standard deviation.

    size, information : (h,), of the lot; zero information: not measured · rms : (h,), of earlier innovations
    value : (h,), at the walk that the past prefers, of unit variance if the noise is as stated; zero if there is no past
    every : (q, h), the same at each walk · gain, roots : (q, h), filter gains, and standard deviations of the innovations
    known : (h,), whether the station has earlier lots
    """

    station: str
    size: Array
    information: Array
    rms: Array
    value: Array
    every: Array
    gain: Array
    roots: Array
    known: Flags


class Wander:
    """Kalman filters of all stations.

    Parameters
    ----------
    count : number of hypotheses, h
    """

    def __init__(self, count: int) -> None:
        self.stations: dict[str, Level] = {}
        self.log_likelihood: Array = np.zeros((WALKS.size, count))
        self.beside: dict[str, Array] = {}  # log likelihood with the prediction of each driver in the model
        self._lots = np.zeros((2, count))  # Σ of the noise variance of the lots, and their number

    @property
    def gained(self) -> Array:
        """Gain of log likelihood by a walk over none, (h,)."""
        return _gained(self.log_likelihood)

    def gained_beside(self, name: str) -> Array:
        """Gain of log likelihood by a walk, with a driver's predictions in the model, (h,)."""
        known = self.beside.get(name)
        return np.zeros(self.log_likelihood.shape[1]) if known is None else _gained(known)

    def level(self, station: str) -> Level:
        """The filter state of a station, unknown for a new one."""
        shape = self.log_likelihood.shape
        if station not in self.stations:
            self.stations[station] = Level(np.zeros(shape), np.zeros(shape), np.zeros(shape[1], dtype=bool))
        return self.stations[station]

    def innovation(self, station: str, size: Array, information: Array, rms: Array) -> Innovation:
        """The innovation of a lot with sizes (h,) and information (h,), beside the rms (h,) of earlier ones."""
        level, seen = self.level(station), information > 0.0
        safe = np.where(seen, information, 1.0)
        # the walk is in units of the noise variance of a typical lot
        typical = np.where(self._lots[1] > 0.0, over(*self._lots), 1.0 / safe)
        variance = level.variance + WALKS[:, None] * typical
        total = variance + 1.0 / safe
        roots = np.sqrt(total)
        known = level.known & seen
        every = np.where(known, (size - level.mean) / roots, 0.0)
        gain = np.where(level.known, variance / total, 1.0)
        value = _chosen_of(every, self.log_likelihood)
        return Innovation(station, size, information, rms, value, every, gain, roots, known)

    def beside_driver(self, name: str, prediction: Array, found: Innovation, told: Flags) -> tuple[Array, Array]:
        """Innovation of a lot, and innovation of a driver's prediction in the same filter, (h,) each; updates the state.

        The walk is the one that the past prefers with the driver's predictions in the model: a change that the driver explains at
        all stations is not attributed to a walk of each.

        Parameters
        ----------
        told : (h,), whether the prediction is based on enough lots; if not, a step does not count as evidence of a walk
        """
        level = self.level(found.station)
        likelihood = self.beside.setdefault(name, np.zeros_like(self.log_likelihood))
        before = level.predictors.get(name)
        if before is None:
            level.predictors[name] = np.broadcast_to(prediction, found.gain.shape).copy()
            return np.zeros(prediction.size), np.zeros(prediction.size)
        every = np.where(found.known, (prediction - before) / found.roots, 0.0)
        value, left = _chosen_of(found.every, likelihood), _chosen_of(every, likelihood)
        likelihood += np.where(told, _likelihood(found.every - every, found), 0.0)
        before += found.gain * (prediction - before)
        return value, left

    def update(self, found: Innovation) -> None:
        """Update the filter of a station with a lot; innovations larger than five times their rms are clipped."""
        level, seen = self.level(found.station), found.information > 0.0
        bounded = np.clip(found.every, -BOUND * found.rms, BOUND * found.rms)
        self.log_likelihood += _likelihood(found.every, found)
        moved = np.where(level.known, level.mean + found.gain * bounded * found.roots, found.size)
        safe = np.where(seen, found.information, 1.0)
        level.mean = np.where(seen, moved, level.mean)
        level.variance = np.where(seen, found.gain / safe, level.variance)
        level.known = level.known | seen
        self._lots += np.where(seen, 1.0 / safe, 0.0), seen


def _likelihood(every: Array, found: Innovation) -> Array:
    """Log likelihood ratio (q, h) of innovations at each walk to that without one; innovations are clipped at five rms."""
    bounded = np.clip(every, -BOUND * found.rms, BOUND * found.rms) / np.maximum(found.rms, 1e-300)
    gained = -np.log(found.roots) - 0.5 * bounded**2
    return np.where(found.known, gained - gained[0], 0.0)


def _gained(likelihood: Array) -> Array:
    """Gain (h,) of the best walk over none, from log likelihoods (q, h)."""
    return np.max(likelihood[1:], axis=0) - likelihood[0]


def _chosen_of(every: Array, likelihood: Array) -> Array:
    """Values (h,) of ``every`` (q, h) at the most likely walk; without a walk unless one is clearly better."""
    best = np.where(_gained(likelihood) > WALK_FROM, 1 + np.argmax(likelihood[1:], axis=0), 0)
    return every[best, np.arange(best.size)]
