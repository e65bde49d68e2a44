from inertial.effects.base import Array, SensorEffect, stack
from inertial.state import State


class VibrationRectification(SensorEffect):
    """Bias from vibration, through the quadratic term."""

    id = "vibration_rectification"
    symbol = "VRE"
    equation = "VRE·a_rms²"
    coefficients = ("VRE",)
    source = "IEEE Std 1293-1998, vibration rectification"
    typical_ug = (1.0, 1000.0)
    per = ("g²",)
    hides_behind = ("second_order", "bias_temperature")
    breaker = "the compressor off; the vibration recorded"
    same_on_axes = True
    simplicity = 34

    def columns(self, state: State, axis: int, **nonlinear: float) -> Array:
        return stack(state, [state.need("vibration", self.id) ** 2])
