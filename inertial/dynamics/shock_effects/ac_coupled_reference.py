import numpy as np

from inertial.dynamics.shock_effects.base import Array, ShockEffect
from inertial.dynamics.transfer_effects.base import Parameter


class AcCoupledReference(ShockEffect):
    """A reference that is AC-coupled: its peak is low and it undershoots after the pulse, with the time constant RC."""

    equation = "u = r + ∫r dt/RC"
    source = "charge amplifier, IEPE sensor: one-pole high-pass"
    unit = "s"
    breaker = "shocks in the other direction, and a longer record after the pulse: the output returns with RC"

    def parameters(self, duration_s: float) -> tuple[Parameter, ...]:
        starts = (10.0 * duration_s, 100.0 * duration_s)
        return (Parameter("coupling_s", "s", 1.5 * duration_s, 3000.0 * duration_s, starts, log=True),)

    def changed(self, wave: Array, rate_hz: float, values: Array) -> Array:
        integral = np.concatenate([[0.0], np.cumsum(0.5 * (wave[1:] + wave[:-1]))]) / rate_hz
        return np.asarray(wave + integral / values[0])
