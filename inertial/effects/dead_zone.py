import numpy as np

from inertial.effects.base import CONVERTER, Array, Nonlinear, SensorEffect, place, stack
from inertial.state import State


class DeadZone(SensorEffect):
    """Output that stays at zero until the specific force leaves a zone about null."""

    id = "dead_zone"
    symbol = "DZ"
    equation = "−clip(fi, −w, w)"
    coefficients = ("DZ",)
    source = "mechanism: stiction or a threshold of the converter; IEEE Std 1293-1998, threshold"
    typical_ug = (1.0, 5000.0)
    hides_behind = ("bias_asymmetry", "odd_quadratic")
    breaker = "a micro-tilt through zero"
    simplicity = 22
    sharp = True
    nonlinear = (Nonlinear("width", "g", 1e-5, 0.5, "log", 12),)

    def parameters(self, state: State) -> tuple[Nonlinear, ...]:
        """Where it acts, too, if the output runs with temperature."""
        return (*self.nonlinear, *place(state))

    def columns(self, state: State, axis: int, *, width: float, place: float = CONVERTER, **nonlinear: float) -> Array:
        return stack(state, [-np.clip(state.converted(axis, place), -width, width)])
