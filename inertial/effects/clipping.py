from typing import ClassVar

import numpy as np

from inertial.effects.base import CONVERTER, Array, Nonlinear, SensorEffect, place, stack
from inertial.state import State


class Clipping(SensorEffect):
    """Output that stops at full scale."""

    id: ClassVar[str] = "clipping"
    symbol: ClassVar[str] = "FS"
    equation: ClassVar[str] = "min(max(fi, −FS), FS) − fi"
    coefficients: ClassVar[tuple[str, ...]] = ("FS",)
    source: ClassVar[str] = "transfer curve of a limiter"
    typical_ug: ClassVar[tuple[float, float]] = (100.0, 500000.0)
    hides_behind: ClassVar[tuple[str, ...]] = ("third_order",)
    breaker: ClassVar[str] = "a margin between the largest specific force and the range"
    simplicity: ClassVar[int] = 23
    sharp: ClassVar[bool] = True
    nonlinear: ClassVar[tuple[Nonlinear, ...]] = (Nonlinear("full_scale", "g", 0.5, 0.999, "linear", 14),)

    def parameters(self, state: State) -> tuple[Nonlinear, ...]:
        """Where it acts, too, if the output runs with temperature."""
        return (*self.nonlinear, *place(state))

    def columns(
        self, state: State, axis: int, *, full_scale: float, place: float = CONVERTER, **nonlinear: float
    ) -> Array:
        f = state.converted(axis, place)
        return stack(state, [np.clip(f, -full_scale, full_scale) - f])
