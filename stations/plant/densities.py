"""Random vibration of the simulated exciter: Gaussian, with the density of a profile, at rest before and after."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from schemas.vibration_profile import load_vibration_profile

Array = NDArray[np.float64]
REST_S = 1.0
RAMP_S = 0.05


def random_force(profile: str, level_g: float, seconds: float, rate_hz: float, rng: np.random.Generator) -> Array:
    """Force (n,) in g: rest, ``seconds`` of vibration of this overall level with short ramps, rest."""
    points = np.array(load_vibration_profile(profile).breakpoints)
    count = round(seconds * rate_hz)
    f = np.fft.rfftfreq(count, 1.0 / rate_hz)
    inside = (f >= points[0, 0]) & (f <= points[-1, 0])
    density = np.zeros_like(f)
    density[inside] = np.exp(np.interp(np.log(f[inside]), np.log(points[:, 0]), np.log(points[:, 1])))
    z = rng.standard_normal((2, f.size))
    wave = np.fft.irfft(np.sqrt(density) * (z[0] + 1j * z[1]), count)
    wave *= level_g / float(np.sqrt(np.mean(wave**2)))
    ramp = np.minimum(1.0, np.minimum(np.arange(count), np.arange(count)[::-1]) / (RAMP_S * rate_hz))
    rest = np.zeros(round(REST_S * rate_hz))
    return np.concatenate([rest, wave * ramp, rest])
