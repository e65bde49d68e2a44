from typing import ClassVar

from inertial.effects.base import Array, SensorEffect, stack
from inertial.state import State


class BiasTemperatureQuadratic(SensorEffect):
    """Curvature of the bias over temperature."""

    id: ClassVar[str] = "bias_temperature_quadratic"
    symbol: ClassVar[str] = "kT2"
    equation: ClassVar[str] = "kT2·θ²"
    coefficients: ClassVar[tuple[str, ...]] = ("kT2",)
    source: ClassVar[str] = "temperature model b(T) = b0 + kT·θ + kT2·θ², S(T) = S0·(1 + αT·θ)"
    typical_ug: ClassVar[tuple[float, float]] = (10.0, 5000.0)
    hides_behind: ClassVar[tuple[str, ...]] = ("thermal_hysteresis", "thermal_kink")
    breaker: ClassVar[str] = "at least four temperatures, on the way up and back"
    same_on_axes: ClassVar[bool] = True
    simplicity: ClassVar[int] = 5
    after: ClassVar[tuple[str, ...]] = ("bias_temperature",)

    def columns(self, state: State, axis: int, **nonlinear: float) -> Array:
        theta = state.need("theta", self.id)
        return stack(state, [theta**2])
