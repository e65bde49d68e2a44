from functools import lru_cache

import numpy as np
from scipy.interpolate import CubicSpline

from inertial.dynamics.shock_effects.base import Array, ShockEffect
from inertial.dynamics.transfer_effects.base import Parameter


class Delay(ShockEffect):
    """A delay between the channels: converter, linear-phase filter, time base."""

    equation = "u(t) = r(t − τ)"
    source = "time base"
    unit = "s"
    breaker = "a shared trigger edge on both channels"

    def parameters(self, duration_s: float) -> tuple[Parameter, ...]:
        return (Parameter("delay_s", "s", -0.3 * duration_s, 0.3 * duration_s, (0.0,)),)

    def changed(self, wave: Array, rate_hz: float, values: Array) -> Array:
        time = np.arange(len(wave)) / rate_hz
        return np.asarray(_spline(wave.tobytes(), rate_hz)(np.clip(time - values[0], time[0], time[-1])))


@lru_cache(maxsize=16)
def _spline(wave: bytes, rate_hz: float) -> CubicSpline:
    """The cubic spline through a waveform, the same for every delay."""
    values = np.frombuffer(wave)
    return CubicSpline(np.arange(len(values)) / rate_hz, values, bc_type="natural")
