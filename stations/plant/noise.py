"""Noise of the devices under test: white, flicker and random walk, from one stream of random numbers for each unit.

Draws are made sample by sample in order, so that a record does not depend on the size of the requests.
"""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from stations.plant.device import REFERENCE_C
from stations.plant.preset import Preset

Array = NDArray[np.float64]

RATIO = 3.0  # ratio of adjacent time constants; the sum of Lorentzians at this ratio follows 1/f within 0.1 %
SHORTEST, LONGEST = -6, 10  # powers of the ratio around 0.1 s: from 0.14 ms to 1.6 hours
TERMS = LONGEST - SHORTEST + 1
FASTEST = 0.5  # sample periods; the decimation filter of the reader averages faster changes


def flicker_variance(instability: float) -> float:
    """Variance of each process so that their sum has the bias instability B, in the square of its unit.

    Flicker of B has the one-sided density h/f with h = B²/π (its Allan deviation is sqrt(2·ln2·h) = 0.664·B). A process of
    variance v and time constant τ has 4vτ/(1 + (2πfτ)²); with a ratio r between the τ the sum tends to v/(f·ln r).
    """
    return instability**2 / math.pi * math.log(RATIO)


class UnitNoise:
    """The noise of a lot, in g, with the state that continues from one sampling to the next."""

    def __init__(self, preset: Preset, streams: Sequence[np.random.Generator]) -> None:
        self._preset = preset
        self._walk_step = preset.rate_random_walk_ug * 1e-6
        # time constants of the Ornstein–Uhlenbeck processes of the flicker noise, (17,), s
        self._tau = np.array([0.1 * RATIO**k for k in range(SHORTEST, LONGEST + 1)])
        self._sigma = math.sqrt(flicker_variance(preset.bias_instability_ug * 1e-6))
        self._streams = list(streams)
        self._flicker = self._sigma * self._draw(1, TERMS)[0]
        self._walk: Array = np.zeros((len(self._streams), 3))
        self._filtered: Array = np.zeros_like(self._walk)  # white noise behind the output filter at the last sample

    @property
    def walk(self) -> Array:
        """The random walk at this moment, (units, 3), g; zero when the device was switched on."""
        return self._walk

    @property
    def slow(self) -> Array:
        """Random walk and flicker at this moment, (units, 3), g."""
        return self._walk + self._flicker.sum(axis=-1)

    def jump(self, gap: float) -> None:
        """Advances the slow processes over ``gap`` seconds without sampling; exact, in one step."""
        keep = np.exp(-gap / self._tau)
        z = self._draw(1, TERMS + 1)[0]
        self._flicker = keep * self._flicker + self._sigma * np.sqrt(1.0 - keep**2) * z[..., :TERMS]
        self._walk = self._walk + self._walk_step * math.sqrt(gap) * z[..., TERMS]

    def sample(self, n: int, rate: float, temperature: Array | None = None) -> Array:
        """The next ``n`` samples at ``rate`` Hz, (n, units, 3), g.

        White noise of the one-sided density n_d has the deviation n_d·sqrt(fs/2) per sample, or that of the output filter; it
        grows exponentially with ``temperature`` (n, units), °C, as leakage currents and their shot noise do.
        """
        slow = np.flatnonzero(self._tau * rate >= FASTEST)
        z = self._draw(n, 2 + (len(slow) if self._sigma > 0.0 else 0))
        white = z[..., 0]
        if temperature is not None and self._preset.noise_temperature_per_K != 0.0:
            white = white * np.exp(self._preset.noise_temperature_per_K * (temperature - REFERENCE_C))[..., None]
        total = self._white(white, rate)
        if self._walk_step > 0.0:
            steps = self._walk_step / math.sqrt(rate) * z[..., 1]
            steps[0] += self._walk
            path = np.cumsum(steps, axis=0)
            self._walk = path[-1].copy()
            total += path
        if self._sigma > 0.0:
            for column, k in enumerate(slow, start=2):
                keep = math.exp(-1.0 / (rate * self._tau[k]))
                gain = self._sigma * math.sqrt(1.0 - keep**2)
                start = (keep * self._flicker[..., k])[None]
                path, _ = lfilter([gain], [1.0, -keep], z[..., column], axis=0, zi=start)
                self._flicker[..., k] = path[-1]
                total += path
        return total

    def _white(self, z: Array, rate: float) -> Array:
        """White noise from standard normal numbers (n, units, 3); behind an output filter its samples are correlated."""
        sigma, keep = 1e-6 * self._preset.sample_noise_ug(rate), self._preset.sample_correlation(rate)
        if keep == 0.0:
            return sigma * z
        path, _ = lfilter([sigma * math.sqrt(1.0 - keep**2)], [1.0, -keep], z, axis=0, zi=keep * self._filtered[None])
        self._filtered = path[-1].copy()
        return path

    def _draw(self, n: int, terms: int) -> Array:
        """Standard normal numbers, (n, units, 3, terms); those of each unit come from its own stream."""
        return np.stack([stream.standard_normal((n, 3, terms)) for stream in self._streams], axis=1)
