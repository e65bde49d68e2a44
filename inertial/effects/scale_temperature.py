from typing import ClassVar

from inertial.effects.base import Array, SensorEffect, stack
from inertial.state import State


class ScaleTemperature(SensorEffect):
    """Scale factor that follows the sensor's temperature, along the sensor's own axis: S(θ)·M."""

    id: ClassVar[str] = "scale_temperature"
    symbol: ClassVar[str] = "αT"
    equation: ClassVar[str] = "αT·θ·(fi + δj·fj + δk·fk)"
    coefficients: ClassVar[tuple[str, ...]] = ("aT",)
    source: ClassVar[str] = "temperature model b(T) = b0 + kT·θ + kT2·θ², S(T) = S0·(1 + αT·θ)"
    typical_ug: ClassVar[tuple[float, float]] = (50.0, 10000.0)
    hides_behind: ClassVar[tuple[str, ...]] = ("gravity_value",)
    breaker: ClassVar[str] = "opposed poses at every temperature"
    simplicity: ClassVar[int] = 4
    sharp: ClassVar[bool] = True

    def columns(self, state: State, axis: int, **nonlinear: float) -> Array:
        theta = state.need("theta", self.id)
        return stack(state, [theta * state.along(axis)])
