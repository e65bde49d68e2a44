"""What the terms of an Allan curve make of dwell means: their error, and their covariance in real time."""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_triangular

from inertial.arrays import Array
from inertial.noise.flicker import FLICKER_FLOOR, flicker_of_means


@dataclass(frozen=True)
class DwellNoise:
    """Noise of one output, as its Allan curve states it.

    density : one-sided white noise n_d, g/√Hz (N of IEEE Std 952 is n_d/√2)
    instability : bias instability B, g: flicker of the one-sided density B²/(π·f)
    walk : random walk K, g/√s
    """

    density: float
    instability: float = 0.0
    walk: float = 0.0

    def white(self, duration: float) -> float:
        """Standard deviation of the white part of a mean over ``duration`` s, g: n_d/√(2·T)."""
        return self.density / float(np.sqrt(2.0 * duration))

    def wander(self, duration: float) -> float:
        """Allan deviation of flicker and random walk at ``duration`` s, g: neighbouring means differ by √2 of it."""
        return float(np.hypot(FLICKER_FLOOR * self.instability, self.walk * np.sqrt(duration / 3.0)))

    def error(self, duration: float) -> float:
        """Allan deviation at ``duration`` s, g: the error of a dwell against its neighbours."""
        return float(np.hypot(self.white(duration), self.wander(duration)))

    def balanced(self) -> float:
        """Dwell in s at which white noise has fallen to the wander: longer ones gain little. Infinite without wander."""
        floor = FLICKER_FLOOR * self.instability
        return 0.5 * (self.density / floor) ** 2 if floor > 0.0 else float("inf")


def dwell_covariance(
    time: Array, duration: float, noise: DwellNoise, *, since: float = 0.0, slowest: float = 0.0
) -> Array:
    """Covariance (n, n) of the means of dwells, g².

    White noise, flicker as a sum of Ornstein–Uhlenbeck processes with time constants an octave apart, each averaged over
    the dwells in closed form, and a random walk that is zero at ``since``. Flicker slower than the time from there to
    the end, or than ``slowest``, is left out: for the run it is the bias itself. Plans of different length are compared
    at one value.

    Parameters
    ----------
    time : (n,), s, middles of the dwells
    duration : s, of each dwell
    since : s, when the devices were powered and the random walk began
    slowest : s, least time constant that the slowest part of the flicker has
    """
    gap = np.abs(time[:, None] - time)
    covariance = np.eye(time.size) * noise.white(duration) ** 2
    if noise.instability > 0.0:
        longest = max(float(np.ptp(time)), float(time.max()) - since, slowest)
        covariance += noise.instability**2 * flicker_of_means(gap, duration, longest)
    if noise.walk > 0.0:
        elapsed = time - since
        walk = np.minimum(elapsed[:, None], elapsed)
        # the mean over a dwell loses a sixth of it of the variance at its middle
        covariance += noise.walk**2 * (walk - np.eye(time.size) * min(duration / 6.0, float(elapsed.min())))
    return covariance


def whitener(covariance: Array) -> Array:
    """Inverse root (n, n) of a covariance: applied from the left it makes noise white and of variance one."""
    root = np.linalg.cholesky(covariance)
    return np.asarray(solve_triangular(root, np.eye(len(root)), lower=True), dtype=np.float64)
