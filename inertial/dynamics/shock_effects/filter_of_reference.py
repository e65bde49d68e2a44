from functools import lru_cache

import numpy as np
from scipy.interpolate import make_interp_spline

from inertial.dynamics.shock_effects.base import Array, ShockEffect, corner
from inertial.dynamics.transfer_effects.base import Parameter


class FilterOfReference(ShockEffect):
    """A low-pass on the channel of the reference that the unit does not have: filters that do not match."""

    equation = "two-pole Butterworth at f_c behind the reference"
    source = "SAE J211; equal filters on both channels"
    unit = "Hz"
    breaker = "equal filters on both channels, with a corner of 2/D or more"

    def parameters(self, duration_s: float) -> tuple[Parameter, ...]:
        return (corner("reference_filter_hz", duration_s),)

    def changed(self, wave: Array, rate_hz: float, values: Array) -> Array:
        w = 2.0 * np.pi * float(values[0])
        first, second = _derivatives(wave.tobytes(), rate_hz)
        return np.asarray(wave + np.sqrt(2.0) / w * first + second / w**2)


@lru_cache(maxsize=16)
def _derivatives(wave: bytes, rate_hz: float) -> tuple[Array, Array]:
    """First and second derivative of a waveform by time, (n,) each: the same for every corner of the filter."""
    values = np.frombuffer(wave)
    time = np.arange(len(values)) / rate_hz
    curve = make_interp_spline(time, values, k=5)
    return np.asarray(curve(time, 1)), np.asarray(curve(time, 2))
