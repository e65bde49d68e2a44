from collections.abc import Mapping

import numpy as np

from inertial.dynamics.transfer_effects.base import AMBIENT_C, Array, Conditions, Parameter, TransferEffect

LEAST_K = 10.0


class NaturalTemperature(TransferEffect):
    """A spring that softens or stiffens with temperature, and the natural frequency with it."""

    equation = "f_n·(1 + k·(T − 25 °C))"
    source = "temperature coefficient of Young's modulus: −60 to −70 ppm/K of silicon, half of it in the frequency"
    breaker = "the same frequencies near the natural one at another temperature"

    def parameters(self, points: Conditions) -> tuple[Parameter, ...]:
        return (Parameter("natural_tempco_per_K", "1/K", -3e-3, 3e-3, (0.0,)),)

    def changes(self, points: Conditions, values: Array) -> Mapping[str, Array]:
        """Factor (n,) of the natural frequency at the temperature of each point."""
        return {"natural_hz": 1.0 + values[0] * (points.temperature - AMBIENT_C)}

    def seen(self, points: Conditions) -> bool:
        """Whether the temperature moved by 10 K or more."""
        return bool(np.all(np.isfinite(points.temperature))) and bool(np.ptp(points.temperature) >= LEAST_K)
