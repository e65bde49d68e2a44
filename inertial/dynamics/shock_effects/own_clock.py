import numpy as np
from scipy.interpolate import CubicSpline

from inertial.dynamics.shock_effects.base import Array, ShockEffect
from inertial.dynamics.transfer_effects.base import Parameter


class OwnClock(ShockEffect):
    """A clock of the device that departs from that of the reference: the pulse is stretched."""

    equation = "u(t) = r(t·(1 + ε))"
    source = "time base"
    unit = "share"
    breaker = "a sweep, or a shared sample clock"

    def parameters(self, duration_s: float) -> tuple[Parameter, ...]:
        return (Parameter("clock_share", "1", -0.05, 0.05, (0.0,)),)

    def changed(self, wave: Array, rate_hz: float, values: Array) -> Array:
        time = np.arange(len(wave)) / rate_hz
        middle = time[int(np.argmax(np.abs(wave)))]
        at = np.clip(middle + (time - middle) * (1.0 + values[0]), time[0], time[-1])
        return np.asarray(CubicSpline(time, wave, bc_type="natural")(at))
