from inertial import operators
from inertial.effects.base import Array, Nonlinear, SensorEffect, stack
from inertial.state import State

_NARROW = 0.35
"""Half width of the second play over that of the first: together they follow a spread of widths (Preisach) closely."""


class ThermalHysteresis(SensorEffect):
    """Bias that remembers from which side a temperature was reached: one play, or two of different width."""

    id = "thermal_hysteresis"
    symbol = "kH"
    equation = "kH·h(T; w) + kH2·h(T; 0.35·w), h the play operator of half width w that begins at s, −1 … 1"
    coefficients = ("kH", "kH2")
    source = "Visintin, Differential Models of Hysteresis; mechanism: friction in the die attach"
    typical_ug = (100.0, 10000.0)
    per = ("K", "K")
    hides_behind = ("aging_linear", "bias_temperature_quadratic")
    breaker = "a closed loop of temperature, and minor loops; a one-way soak holds no information"
    same_on_axes = True
    simplicity = 24
    memory = True
    primary = 1
    nonlinear = (
        Nonlinear("half_width", "K", 1.0, 60.0, "log", 10),
        Nonlinear("start", "1", -1.0, 1.0, "linear", 3, of_run=True),
    )

    def columns(self, state: State, axis: int, *, half_width: float, start: float = 0.0, **nonlinear: float) -> Array:
        return stack(state, [self._inside(state, half_width, start), self._inside(state, _NARROW * half_width, start)])

    def _inside(self, state: State, half_width: float, start: float) -> Array:
        def hysteresis(time: Array, temperature: Array) -> Array:
            return operators.play(temperature, half_width, start)

        return state.temperature_operator((self.id, half_width, start), hysteresis)

    def start_columns(self, state: State, axis: int, *, half_width: float, **nonlinear: float) -> Array:

        def memory(time: Array, temperature: Array) -> Array:
            return operators.play_memory(temperature, half_width)

        return stack(state, [state.temperature_operator((self.id, "start", half_width), memory)])
