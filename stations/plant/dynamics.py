"""Frequency response of the devices: a spring-mass system, then the low-pass filter of the output stage."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.signal import cont2discrete, lfilter, lfilter_zi

from stations.plant.preset import Preset

Array = NDArray[np.float64]


def output_pole_hz(preset: Preset) -> float:
    """Corner frequency of the output stage, Hz, for which the −3 dB point of the chain is the bandwidth of the data sheet.

    A spring-mass system with 2500 Hz and ζ = 0.7 alone passes 2500 Hz; the 1500 Hz of the data sheet hold for the whole chain.
    Infinite where the spring-mass system alone has a smaller bandwidth.
    """
    u = preset.passband_hz / preset.natural_frequency_hz
    squared = (1.0 - u**2) ** 2 + (2.0 * preset.damping * u) ** 2  # 1/|H|² of the mass at the bandwidth
    left = 2.0 / squared - 1.0
    return preset.passband_hz / math.sqrt(left) if left > 0.0 else math.inf


def transfer(preset: Preset) -> tuple[Array, Array]:
    """Numerator and denominator of the chain in s, with gain 1 at zero frequency."""
    wn = 2.0 * math.pi * preset.natural_frequency_hz
    mass = np.array([1.0 / wn**2, 2.0 * preset.damping / wn, 1.0])
    pole = output_pole_hz(preset)
    stage = np.array([1.0 / (2.0 * math.pi * pole), 1.0]) if math.isfinite(pole) else np.array([1.0])
    return np.array([1.0]), np.convolve(mass, stage)


class Dynamics:
    """Response of every axis of every unit to sampled force; exact for force that is linear between samples."""

    def __init__(self, preset: Preset) -> None:
        self._transfer = transfer(preset)
        self._b: Array = np.ones(1)
        self._a: Array = np.ones(1)
        self._state: Array = np.zeros((0, 1, 3))

    def begin(self, rate: float, force: Array) -> None:
        """Starts at ``rate`` Hz from rest under ``force`` (units, 3), g."""
        system: Any = cont2discrete(self._transfer, 1.0 / rate, method="foh")
        numerator, denominator = system[0], system[1]
        self._b, self._a = np.atleast_1d(np.squeeze(numerator)), np.atleast_1d(denominator)
        self._state = lfilter_zi(self._b, self._a)[:, None, None] * force[None]

    def respond(self, force: Array) -> Array:
        """The response to the next samples of force, (n, units, 3), g."""
        out, self._state = lfilter(self._b, self._a, force, axis=0, zi=self._state)
        return out
