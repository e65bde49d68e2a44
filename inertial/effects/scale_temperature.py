"""Scale factor that follows the sensor's temperature."""

from typing import ClassVar

from inertial.effects.base import Array, SensorEffect, stack
from inertial.state import State


class ScaleTemperature(SensorEffect):
    """Scale factor that follows the sensor's temperature."""

    id: ClassVar[str] = "scale_temperature"
    symbol: ClassVar[str] = "αT"
    equation: ClassVar[str] = "αT·θ·fi"
    source: ClassVar[str] = "temperature model b(T) = b0 + kT·θ + kT2·θ², S(T) = S0·(1 + αT·θ)"
    typical_ug: ClassVar[tuple[float, float]] = (50.0, 10000.0)
    hides_behind: ClassVar[tuple[str, ...]] = ("gravity_value",)
    breaker: ClassVar[str] = "opposed poses at every temperature"
    simplicity: ClassVar[int] = 4

    def columns(self, state: State, axis: int, **nonlinear: float) -> Array:
        del nonlinear
        theta = state.need("theta", self.id)
        f = state.force[..., axis]
        return stack(state, [theta * f])

    def names(self, axis: int) -> tuple[str, ...]:
        del axis
        return ("aT",)
