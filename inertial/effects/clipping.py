import numpy as np

from inertial.effects.base import CONVERTER, Array, Nonlinear, SensorEffect, place, stack
from inertial.state import State


class Clipping(SensorEffect):
    """Output that stops at full scale."""

    id = "clipping"
    symbol = "FS"
    equation = "min(max(fi, −FS), FS) − fi"
    coefficients = ("FS",)
    source = "transfer curve of a limiter"
    typical_ug = (100.0, 500000.0)
    hides_behind = ("third_order",)
    breaker = "a margin between the largest specific force and the range"
    simplicity = 23
    sharp = True
    nonlinear = (Nonlinear("full_scale", "g", 0.5, 0.999, "linear", 14),)

    def parameters(self, state: State) -> tuple[Nonlinear, ...]:
        """Where it acts, too, if the output runs with temperature."""
        return (*self.nonlinear, *place(state))

    def columns(
        self, state: State, axis: int, *, full_scale: float, place: float = CONVERTER, **nonlinear: float
    ) -> Array:
        f = state.converted(axis, place)
        return stack(state, [np.clip(f, -full_scale, full_scale) - f])
