from collections.abc import Mapping

import numpy as np

from inertial.dynamics.transfer_effects.base import AMBIENT_HPA, Array, Conditions, Parameter, TransferEffect

FREE_PATH_UM = 0.068  # of air at 25 °C and 1013 hPa
LEAST_RATIO = 1.2  # of the largest pressure to the least


def _slipping(pressure: Array, gap_um: Array) -> Array:
    """How much less viscous the film is than bulk gas, (n,) or (k, n) for k gaps: more for a thinner gap."""
    return np.asarray(1.0 + 9.638 * (FREE_PATH_UM * AMBIENT_HPA / pressure / gap_um) ** 1.159)


class GasPressure(TransferEffect):
    """Damping by a film of gas that is open to the air: at a lower pressure the molecules slip past the walls."""

    equation = "ζ·q(p)/q(1013 hPa), 1/q = 1 + 9.638·(λ/gap)^1.159, λ = 68 nm·1013 hPa/p"
    source = "T. Veijola et al., Sensors and Actuators A 48 (1995) 239: effective viscosity of a squeeze film"
    breaker = "the same frequencies near the natural one at another pressure"

    def parameters(self, points: Conditions) -> tuple[Parameter, ...]:
        return (Parameter("gap_um", "µm", 0.05, 500.0, (0.5, 3.0, 20.0), log=True),)

    def changes(self, points: Conditions, values: Array) -> Mapping[str, Array]:
        """Factor (n,) of the damping ratio at the pressure of each point."""
        return {"damping": _slipping(np.array([AMBIENT_HPA]), values[0]) / _slipping(points.pressure, values[0])}

    def seen(self, points: Conditions) -> bool:
        """Whether the pressure changed by a fifth or more."""
        return bool(points.pressure.max() >= LEAST_RATIO * points.pressure.min())
