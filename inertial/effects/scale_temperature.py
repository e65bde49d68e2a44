from inertial.effects.base import Array, SensorEffect, stack
from inertial.state import State


class ScaleTemperature(SensorEffect):
    """Scale factor that follows the sensor's temperature, along the sensor's own axis: S(θ)·M."""

    id = "scale_temperature"
    symbol = "αT"
    equation = "αT·θ·(fi + δj·fj + δk·fk)"
    coefficients = ("aT",)
    source = "temperature model b(T) = b0 + kT·θ + kT2·θ², S(T) = S0·(1 + αT·θ)"
    typical_ug = (50.0, 10000.0)
    hides_behind = ("gravity_value",)
    breaker = "opposed poses at every temperature"
    simplicity = 4
    sharp = True

    def columns(self, state: State, axis: int, **nonlinear: float) -> Array:
        return stack(state, [state.need("theta", self.id) * state.along(axis)])
