import numpy as np

from inertial.dynamics.transfer_effects.base import Array, Complex, Conditions, Parameter, TransferEffect


class Delay(TransferEffect):
    """A delay that is the same at all frequencies: linear-phase filter, converter, time base."""

    equation = "exp(−j2πfτ)"
    source = "time shift of a Fourier transform"
    breaker = "a shared trigger edge on both channels"

    def parameters(self, points: Conditions) -> tuple[Parameter, ...]:
        period = 1.0 / float(points.frequency.max())
        starts = (
            0.1 * period,
            *(0.4 * period * np.arange(21)).tolist(),
        )  # phases turn: a start has to be within half a turn
        return (Parameter("delay_s", "s", -2.0 * period, 20.0 * period, starts),)

    def factor(self, points: Conditions, values: Array) -> Complex:
        return np.asarray(np.exp(-2j * np.pi * points.frequency * values[0]), dtype=np.complex128)
