from typing import ClassVar

import numpy as np

from inertial.dynamics.transfer_effects.base import Array, Complex, Conditions, Parameter, TransferEffect


class SecondOrder(TransferEffect):
    """A sprung mass: second-order response of the sensing element."""

    id: ClassVar[str] = "second_order"
    equation: ClassVar[str] = "1/(1 − r² + 2jζr), r = f/f_n"
    source: ClassVar[str] = "IEEE Std 1293, annex on the dynamic model"
    breaker: ClassVar[str] = "points beyond the natural frequency"

    def parameters(self, points: Conditions) -> tuple[Parameter, ...]:
        top = float(points.frequency.max())
        return (
            Parameter("natural_hz", "Hz", 0.2 * top, 50.0 * top, (0.7 * top, 1.5 * top, 4.0 * top), log=True),
            Parameter("damping", "1", 1e-3, 5.0, (0.7, 0.05), log=True),
        )

    def factor(self, points: Conditions, values: Array) -> Complex:
        ratio = points.frequency / values[0]
        return np.asarray(1.0 / (1.0 - ratio**2 + 2.0j * values[1] * ratio), dtype=np.complex128)
