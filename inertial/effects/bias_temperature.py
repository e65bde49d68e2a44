from inertial.effects.base import Array, SensorEffect, stack
from inertial.state import State


class BiasTemperature(SensorEffect):
    """Bias that follows the sensor's temperature."""

    id = "bias_temperature"
    symbol = "kT"
    equation = "kT·θ"
    coefficients = ("kT",)
    source = "temperature model b(T) = b0 + kT·θ + kT2·θ², S(T) = S0·(1 + αT·θ)"
    typical_ug = (0.5, 2500.0)
    hides_behind = ("aging_linear", "supply_sensitivity", "thermal_lag")
    breaker = "soaks on the way back, so that time and temperature part"
    same_on_axes = True
    simplicity = 3

    def columns(self, state: State, axis: int, **nonlinear: float) -> Array:
        return stack(state, [state.need("theta", self.id)])
