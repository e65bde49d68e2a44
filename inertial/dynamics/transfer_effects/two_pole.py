import numpy as np

from inertial.dynamics.transfer_effects.base import Array, Complex, Conditions, Parameter, TransferEffect


class TwoPole(TransferEffect):
    """A two-pole Butterworth low-pass behind the sensing element."""

    equation = "1/(1 − r² + j√2·r), r = f/f_c"
    source = "Butterworth low-pass of order 2"
    breaker = "points beyond the corner, or the step response"
    in_every_device = True

    def parameters(self, points: Conditions) -> tuple[Parameter, ...]:
        top = float(points.frequency.max())
        return (Parameter("two_pole_hz", "Hz", 0.05 * top, 100.0 * top, (0.6 * top, 1.5 * top, 5.0 * top), log=True),)

    def factor(self, points: Conditions, values: Array) -> Complex:
        ratio = points.frequency / values[0]
        return np.asarray(1.0 / (1.0 - ratio**2 + 1j * np.sqrt(2.0) * ratio), dtype=np.complex128)
