import numpy as np

from inertial.dynamics.shock_effects.base import Array, ShockEffect, through
from inertial.dynamics.transfer_effects.base import Parameter


class MountingResonance(ShockEffect):
    """A resonance of the mounting between the reference and the unit."""

    equation = "(1 + 2jζr)/(1 − r² + 2jζr), r = f/f_m"
    source = "sprung mass on its mounting"
    unit = "Hz"
    breaker = "another torque, adhesive or fixture"

    def parameters(self, duration_s: float) -> tuple[Parameter, ...]:
        starts = (2.0 / duration_s, 4.0 / duration_s, 7.0 / duration_s)
        return (
            Parameter("mounting_hz", "Hz", 1.0 / duration_s, 12.0 / duration_s, starts, log=True),
            Parameter("mounting_damping", "1", 0.002, 0.5, (0.03,), log=True),
        )

    def changed(self, wave: Array, rate_hz: float, values: Array) -> Array:
        w, z = 2.0 * np.pi * float(values[0]), float(values[1])
        return through(wave, rate_hz, [2.0 * z / w, 1.0], [1.0 / w**2, 2.0 * z / w, 1.0])
