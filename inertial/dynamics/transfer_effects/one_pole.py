import numpy as np

from inertial.dynamics.transfer_effects.base import Array, Complex, Conditions, Parameter, TransferEffect


class OnePole(TransferEffect):
    """A one-pole low-pass behind the sensing element: RC filter of the output."""

    equation = "1/(1 + jf/f_c)"
    source = "first-order low-pass"
    breaker = "points beyond the corner, or the step response"
    in_every_device = True

    def parameters(self, points: Conditions) -> tuple[Parameter, ...]:
        top = float(points.frequency.max())
        return (Parameter("one_pole_hz", "Hz", 0.05 * top, 200.0 * top, (0.5 * top, 2.0 * top, 10.0 * top), log=True),)

    def factor(self, points: Conditions, values: Array) -> Complex:
        return np.asarray(1.0 / (1.0 + 1j * points.frequency / values[0]), dtype=np.complex128)
