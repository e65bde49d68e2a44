from typing import ClassVar

from inertial.effects.base import Array, SensorEffect, stack
from inertial.state import State


class ScaleTemperatureQuadratic(SensorEffect):
    """Curvature of the scale factor over temperature, along the sensor's own axis: S(θ)·M."""

    id: ClassVar[str] = "scale_temperature_quadratic"
    symbol: ClassVar[str] = "αT2"
    equation: ClassVar[str] = "αT2·θ²·(fi + δj·fj + δk·fk)"
    coefficients: ClassVar[tuple[str, ...]] = ("aT2",)
    source: ClassVar[str] = "temperature model b(T) = b0 + kT·θ + kT2·θ², S(T) = S0·(1 + αT·θ)"
    typical_ug: ClassVar[tuple[float, float]] = (10.0, 3000.0)
    hides_behind: ClassVar[tuple[str, ...]] = ()
    breaker: ClassVar[str] = "opposed poses at four temperatures or more"
    simplicity: ClassVar[int] = 6
    sharp: ClassVar[bool] = True
    after: ClassVar[tuple[str, ...]] = ("scale_temperature",)

    def columns(self, state: State, axis: int, **nonlinear: float) -> Array:
        theta = state.need("theta", self.id)
        return stack(state, [theta**2 * state.along(axis)])
