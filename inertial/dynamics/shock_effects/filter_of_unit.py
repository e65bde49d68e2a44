import numpy as np

from inertial.dynamics.shock_effects.base import Array, ShockEffect, corner, through
from inertial.dynamics.transfer_effects.base import Parameter


class FilterOfUnit(ShockEffect):
    """A low-pass on the channel of the unit that the reference does not have: filters that do not match."""

    equation = "two-pole Butterworth at f_c behind the unit"
    source = "SAE J211; equal filters on both channels"
    unit = "Hz"
    breaker = "equal filters on both channels, with a corner of 2/D or more"

    def parameters(self, duration_s: float) -> tuple[Parameter, ...]:
        return (corner("filter_hz", duration_s),)

    def changed(self, wave: Array, rate_hz: float, values: Array) -> Array:
        w = 2.0 * np.pi * float(values[0])
        return through(wave, rate_hz, [1.0], [1.0 / w**2, np.sqrt(2.0) / w, 1.0])
