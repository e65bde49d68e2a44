from inertial.effects.base import Array, SensorEffect, stack
from inertial.state import State


class BiasTemperatureCubic(SensorEffect):
    """Third order of the bias over temperature."""

    id = "bias_temperature_cubic"
    symbol = "kT3"
    equation = "kT3·θ³"
    coefficients = ("kT3",)
    source = "temperature model b(T) = b0 + kT·θ + kT2·θ², S(T) = S0·(1 + αT·θ)"
    typical_ug = (10.0, 5000.0)
    hides_behind = ("thermal_kink",)
    breaker = "at least five temperatures, on the way up and back"
    same_on_axes = True
    simplicity = 7
    after = ("bias_temperature",)

    def columns(self, state: State, axis: int, **nonlinear: float) -> Array:
        return stack(state, [state.need("theta", self.id) ** 3])
