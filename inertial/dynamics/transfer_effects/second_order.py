import numpy as np

from inertial.dynamics.transfer_effects.base import Array, Complex, Conditions, Parameter, TransferEffect


class SecondOrder(TransferEffect):
    """A sprung mass: second-order response of the sensing element."""

    equation = "1/(1 − r² + 2jζr), r = f/f_n"
    source = "IEEE Std 1293, annex on the dynamic model"
    breaker = "points beyond the natural frequency"

    def parameters(self, points: Conditions) -> tuple[Parameter, ...]:
        low, top = float(points.frequency.min()), float(points.frequency.max())
        starts = tuple(float(f) for f in np.geomspace(max(low, 0.05 * top), 4.0 * top, 9))
        return (
            Parameter("natural_hz", "Hz", low, 50.0 * top, starts, log=True),
            Parameter("damping", "1", 1e-3, 5.0, (0.7, 0.2, 0.03), log=True),
        )

    def factor(self, points: Conditions, values: Array) -> Complex:
        ratio = points.frequency / values[0]
        return np.asarray(1.0 / (1.0 - ratio**2 + 2.0j * values[1] * ratio), dtype=np.complex128)
