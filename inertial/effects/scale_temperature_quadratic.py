from inertial.effects.base import Array, SensorEffect, stack
from inertial.state import State


class ScaleTemperatureQuadratic(SensorEffect):
    """Curvature of the scale factor over temperature, along the sensor's own axis: S(θ)·M."""

    id = "scale_temperature_quadratic"
    symbol = "αT2"
    equation = "αT2·θ²·(fi + δj·fj + δk·fk)"
    coefficients = ("aT2",)
    source = "temperature model b(T) = b0 + kT·θ + kT2·θ², S(T) = S0·(1 + αT·θ)"
    typical_ug = (10.0, 3000.0)
    hides_behind = ()
    breaker = "opposed poses at four temperatures or more"
    simplicity = 6
    sharp = True
    after = ("scale_temperature",)

    def columns(self, state: State, axis: int, **nonlinear: float) -> Array:
        return stack(state, [state.need("theta", self.id) ** 2 * state.along(axis)])
