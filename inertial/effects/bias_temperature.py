from typing import ClassVar

from inertial.effects.base import Array, SensorEffect, stack
from inertial.state import State


class BiasTemperature(SensorEffect):
    """Bias that follows the sensor's temperature."""

    id: ClassVar[str] = "bias_temperature"
    symbol: ClassVar[str] = "kT"
    equation: ClassVar[str] = "kT·θ"
    coefficients: ClassVar[tuple[str, ...]] = ("kT",)
    source: ClassVar[str] = "temperature model b(T) = b0 + kT·θ + kT2·θ², S(T) = S0·(1 + αT·θ)"
    typical_ug: ClassVar[tuple[float, float]] = (0.5, 2500.0)
    hides_behind: ClassVar[tuple[str, ...]] = ("aging_linear", "supply_sensitivity", "thermal_lag")
    breaker: ClassVar[str] = "soaks on the way back, so that time and temperature part"
    same_on_axes: ClassVar[bool] = True
    simplicity: ClassVar[int] = 3

    def columns(self, state: State, axis: int, **nonlinear: float) -> Array:
        theta = state.need("theta", self.id)
        return stack(state, [theta])
