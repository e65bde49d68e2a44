from typing import ClassVar

from inertial.effects.base import Array, SensorEffect, stack
from inertial.state import State


class VibrationRectification(SensorEffect):
    """Bias from vibration, through the quadratic term."""

    id: ClassVar[str] = "vibration_rectification"
    symbol: ClassVar[str] = "VRE"
    equation: ClassVar[str] = "VRE·a_rms²"
    coefficients: ClassVar[tuple[str, ...]] = ("VRE",)
    source: ClassVar[str] = "IEEE Std 1293-1998, vibration rectification"
    typical_ug: ClassVar[tuple[float, float]] = (1.0, 1000.0)
    per: ClassVar[tuple[str, ...]] = ("g²",)
    hides_behind: ClassVar[tuple[str, ...]] = ("second_order", "bias_temperature")
    breaker: ClassVar[str] = "the compressor off; the vibration recorded"
    same_on_axes: ClassVar[bool] = True
    simplicity: ClassVar[int] = 34

    def columns(self, state: State, axis: int, **nonlinear: float) -> Array:
        vibration = state.need("vibration", self.id)
        return stack(state, [vibration**2])
