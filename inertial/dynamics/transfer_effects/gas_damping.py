from collections.abc import Mapping

import numpy as np

from inertial.dynamics.transfer_effects.base import AMBIENT_C, Array, Conditions, Parameter, TransferEffect

KELVIN = 273.15
SUTHERLAND_K = 110.4  # of air; of nitrogen 107
LEAST_K = 10.0  # over which the viscosity changes by 2 %


def viscosity(temperature: Array) -> Array:
    """Viscosity of air over that at 25 °C, (n,), at temperatures in °C."""
    kelvin, there = temperature + KELVIN, AMBIENT_C + KELVIN
    return np.asarray((kelvin / there) ** 1.5 * (there + SUTHERLAND_K) / (kelvin + SUTHERLAND_K))


class GasDamping(TransferEffect):
    """Damping by a film of gas, which grows with the temperature as the viscosity does."""

    equation = "ζ·(1 + c·(μ(T)/μ(25 °C) − 1)), μ ∝ T^1.5/(T + 110.4 K)"
    source = "W. Sutherland, Phil. Mag. 36 (1893) 507; squeeze film of a sealed package: the density of its gas stays"
    breaker = "the same frequencies near the natural one at another temperature"

    def parameters(self, points: Conditions) -> tuple[Parameter, ...]:
        return (Parameter("gas_share", "1", -1.0, 3.0, (1.0,)),)

    def changes(self, points: Conditions, values: Array) -> Mapping[str, Array]:
        """Factor (n,) of the damping ratio at the temperature of each point."""
        return {"damping": np.maximum(1.0 + values[0] * (viscosity(points.temperature) - 1.0), 1e-3)}

    def seen(self, points: Conditions) -> bool:
        """Whether the temperature moved by 10 K or more."""
        return bool(np.all(np.isfinite(points.temperature))) and bool(np.ptp(points.temperature) >= LEAST_K)
