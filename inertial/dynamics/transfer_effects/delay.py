import numpy as np

from inertial.dynamics.transfer_effects.base import Array, Complex, Conditions, Parameter, TransferEffect


class Delay(TransferEffect):
    """A delay that is the same at all frequencies: linear-phase filter, converter, time base."""

    id = "delay"
    equation = "exp(−j2πfτ)"
    source = "time shift of a Fourier transform"
    breaker = "a shared trigger edge on both channels"

    def parameters(self, points: Conditions) -> tuple[Parameter, ...]:
        reach = 2.0 / float(points.frequency.max())
        return (Parameter("delay_s", "s", -reach, 10.0 * reach, (0.0, 0.05 * reach)),)

    def factor(self, points: Conditions, values: Array) -> Complex:
        return np.asarray(np.exp(-2j * np.pi * points.frequency * values[0]), dtype=np.complex128)
