"""Frequency response of the devices under test, and what units and test equipment really are in frequency."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.signal import cont2discrete, lfilter, lfilter_zi

from stations.plant.preset import Preset

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]


def output_pole_hz(preset: Preset) -> float:
    """Corner frequency of the output stage, Hz, for which the −3 dB point of the chain is the bandwidth of the data sheet.

    A spring-mass system with 2500 Hz and ζ = 0.7 alone passes 2500 Hz; the 1500 Hz of the data sheet hold for the whole chain.
    Infinite where the spring-mass system alone has a smaller bandwidth.
    """
    left = _left_of_the_bandwidth(preset)
    return preset.passband_hz / math.sqrt(left) if left > 0.0 else math.inf


def _left_of_the_bandwidth(preset: Preset) -> float:
    """Attenuation in power, less 1, that the output stage adds at the bandwidth for −3 dB of the chain."""
    u = preset.passband_hz / preset.natural_frequency_hz
    squared = (1.0 - u**2) ** 2 + (2.0 * preset.damping * u) ** 2  # 1/|H|² of the mass at the bandwidth
    return 2.0 / squared - 1.0


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


@dataclass(frozen=True)
class DynamicTruth:
    """True dynamic parameters of a unit: sprung mass, two-pole low-pass behind it, delay, clock, quadratic spring."""

    natural_hz: float
    damping: float
    low_pass_hz: float
    delay_s: float
    clock: float
    quadratic: Array  # (3,), 1/g
    mass_offset_m: float

    def mass(self, f: Array) -> Complex:
        """Response of the sprung mass."""
        r = f / self.natural_hz
        return 1.0 / (1.0 - r**2 + 2j * self.damping * r)

    def behind(self, f: Array) -> Complex:
        """Response of everything behind the mass, without the delay."""
        r = f / self.low_pass_hz
        return 1.0 / (1.0 - r**2 + 1j * math.sqrt(2.0) * r)


@dataclass(frozen=True)
class Rig:
    """True errors of the test equipment, which all runs of a station share."""

    reference_error: float
    distortion: float
    transverse: float
    transverse_angle: float
    fixture_hz: float
    fixture_damping: float
    repeatability: float = 1e-3
    hum_g: float = 1e-4
    arm_radius_error_m: float = 0.0
    arm_stretch: float = 0.0


def two_pole_behind(preset: Preset) -> float:
    """Corner of the two-pole low-pass, Hz, that puts the −3 dB point of the chain at the sheet's bandwidth."""
    left = _left_of_the_bandwidth(preset)
    return preset.passband_hz / left**0.25 if left > 0.0 else 20.0 * preset.natural_frequency_hz


def directions(axis: int, across_deg: float | None) -> tuple[Array, Array, Array]:
    """Unit vectors (3,) of the driven direction and of the two across it, in the axes of the units."""
    driven, first, second = np.eye(3)[axis], np.eye(3)[(axis + 1) % 3], np.eye(3)[(axis + 2) % 3]
    if across_deg is None:
        return driven, first, second
    c, s = math.cos(math.radians(across_deg)), math.sin(math.radians(across_deg))
    return c * first + s * second, driven, c * second - s * first
