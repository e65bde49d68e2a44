"""A low-pass on the channel of the reference that the unit does not have: filters that do not match."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from scipy.interpolate import make_interp_spline

from inertial.dynamics.shock_effects.base import Array, ShockEffect, corner
from inertial.dynamics.transfer_effects.base import Parameter


class FilterOfReference(ShockEffect):
    """A low-pass on the channel of the reference that the unit does not have: filters that do not match."""

    id: ClassVar[str] = "filter_of_reference"
    equation: ClassVar[str] = "two-pole Butterworth at f_c behind the reference"
    source: ClassVar[str] = "SAE J211; equal filters on both channels"
    breaker: ClassVar[str] = "equal filters on both channels, with a corner of 2/D or more"

    def unit(self) -> str:
        """Unit of the coefficient or of the first parameter."""
        return "Hz"

    def parameters(self, duration_s: float) -> tuple[Parameter, ...]:
        """The parameters."""
        return (corner("reference_filter_hz", duration_s),)

    def changed(self, wave: Array, rate_hz: float, values: Array) -> Array:
        """The waveform (n,)."""
        w = 2.0 * np.pi * float(values[0])
        time = np.arange(len(wave)) / rate_hz
        curve = make_interp_spline(time, wave, k=5)
        return np.asarray(wave + np.sqrt(2.0) / w * curve(time, 1) + curve(time, 2) / w**2)
