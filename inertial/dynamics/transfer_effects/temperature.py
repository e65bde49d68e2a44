import numpy as np

from inertial.dynamics.transfer_effects.base import Array, Complex, Conditions, Parameter, TransferEffect


class Temperature(TransferEffect):
    """A sensitivity that follows the temperature during the sweep."""

    equation = "1 + kT·(T − mean T)"
    source = "thermal coefficient of sensitivity"
    breaker = "the same frequencies at another temperature"

    def parameters(self, points: Conditions) -> tuple[Parameter, ...]:
        span = float(np.ptp(points.temperature)) or 1.0  # of points that are only planned, all at one temperature
        return (Parameter("tempco_per_K", "1/K", -0.2 / span, 0.2 / span, (0.0,)),)

    def factor(self, points: Conditions, values: Array) -> Complex:
        return np.asarray(1.0 + values[0] * (points.temperature - points.temperature.mean()), dtype=np.complex128)

    def seen(self, points: Conditions) -> bool:
        """Whether the temperature moved by 0.5 K or more."""
        return bool(np.all(np.isfinite(points.temperature))) and bool(np.ptp(points.temperature) >= 0.5)
