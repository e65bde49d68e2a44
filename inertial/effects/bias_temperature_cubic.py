from typing import ClassVar

from inertial.effects.base import Array, SensorEffect, stack
from inertial.state import State


class BiasTemperatureCubic(SensorEffect):
    """Third order of the bias over temperature."""

    id: ClassVar[str] = "bias_temperature_cubic"
    symbol: ClassVar[str] = "kT3"
    equation: ClassVar[str] = "kT3·θ³"
    coefficients: ClassVar[tuple[str, ...]] = ("kT3",)
    source: ClassVar[str] = "temperature model b(T) = b0 + kT·θ + kT2·θ², S(T) = S0·(1 + αT·θ)"
    typical_ug: ClassVar[tuple[float, float]] = (10.0, 5000.0)
    hides_behind: ClassVar[tuple[str, ...]] = ("thermal_kink",)
    breaker: ClassVar[str] = "at least five temperatures"
    same_on_axes: ClassVar[bool] = True
    simplicity: ClassVar[int] = 7
    after: ClassVar[tuple[str, ...]] = ("bias_temperature",)

    def columns(self, state: State, axis: int, **nonlinear: float) -> Array:
        theta = state.need("theta", self.id)
        return stack(state, [theta**3])
