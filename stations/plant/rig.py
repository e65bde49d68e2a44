"""What the units and the test equipment of a simulated station really are in frequency."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from stations.plant.preset import Preset

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]


@dataclass(frozen=True)
class DynamicTruth:
    """What a unit really is in frequency: sprung mass, two-pole low-pass behind it, delay, clock, quadratic spring."""

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
    """What the equipment really is: its own errors, the same for all runs of a station."""

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
    axis_tilt: float = 0.0


def two_pole_behind(preset: Preset) -> float:
    """Corner of the two-pole low-pass, Hz, that puts the −3 dB point of the chain at the sheet's bandwidth."""
    u = preset.passband_hz / preset.natural_frequency_hz
    mass = (1.0 - u**2) ** 2 + (2.0 * preset.damping * u) ** 2
    left = 2.0 / mass - 1.0
    return preset.passband_hz / left**0.25 if left > 0.0 else 20.0 * preset.natural_frequency_hz


def directions(axis: int, across_deg: float | None) -> tuple[Array, Array, Array]:
    """Unit vectors (3,) of the driven direction and of the two across it, in the axes of the units."""
    own, one, two = np.eye(3)[axis], np.eye(3)[(axis + 1) % 3], np.eye(3)[(axis + 2) % 3]
    if across_deg is None:
        return own, one, two
    c, s = math.cos(math.radians(across_deg)), math.sin(math.radians(across_deg))
    return c * one + s * two, own, c * two - s * one
