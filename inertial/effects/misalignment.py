from typing import ClassVar

from inertial.effects.base import AXES, Array, SensorEffect, others, stack
from inertial.state import State


class Misalignment(SensorEffect):
    """Response to specific force across the sensor's axis: axes that are not square, and the mounting's rotation."""

    id: ClassVar[str] = "misalignment"
    symbol: ClassVar[str] = "δ"
    equation: ClassVar[str] = "δj·fj + δk·fk"
    source: ClassVar[str] = "IEEE Std 1293-1998, model equation"
    typical_ug: ClassVar[tuple[float, float]] = (1000.0, 10000.0)
    hides_behind: ClassVar[tuple[str, ...]] = ("slot_rotation",)
    breaker: ClassVar[str] = "take the device off, turn it and mount it again; or report the symmetric part only"
    simplicity: ClassVar[int] = 2

    def columns(self, state: State, axis: int, **nonlinear: float) -> Array:
        j, k = others(axis)
        return stack(state, [state.force[..., j], state.force[..., k]])

    def names(self, axis: int) -> tuple[str, ...]:
        return tuple(f"K{AXES[axis]}{AXES[k]}" for k in others(axis))
