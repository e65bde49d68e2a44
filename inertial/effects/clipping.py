"""Output that stops at full scale."""

from typing import ClassVar

import numpy as np

from inertial.effects.base import Array, Nonlinear, SensorEffect, stack
from inertial.state import State


class Clipping(SensorEffect):
    """Output that stops at full scale."""

    id: ClassVar[str] = "clipping"
    symbol: ClassVar[str] = "FS"
    equation: ClassVar[str] = "min(max(fi, −FS), FS) − fi"
    source: ClassVar[str] = "transfer curve of a limiter"
    typical_ug: ClassVar[tuple[float, float]] = (100.0, 500000.0)
    hides_behind: ClassVar[tuple[str, ...]] = ("third_order",)
    breaker: ClassVar[str] = "a margin between the largest specific force and the range"
    simplicity: ClassVar[int] = 23
    sharp: ClassVar[bool] = True
    nonlinear: ClassVar[tuple[Nonlinear, ...]] = (Nonlinear("full_scale", "g", 0.5, 0.999, "linear", 14),)

    def columns(self, state: State, axis: int, *, full_scale: float, **nonlinear: float) -> Array:
        f = state.converted(axis)
        return stack(state, [np.clip(f, -full_scale, full_scale) - f])

    def names(self, axis: int) -> tuple[str, ...]:
        return ("FS",)
