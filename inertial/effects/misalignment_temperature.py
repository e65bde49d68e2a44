from typing import ClassVar

from inertial.effects.base import AXES, Array, SensorEffect, others, stack
from inertial.state import State


class MisalignmentTemperature(SensorEffect):
    """Axes that tilt with temperature."""

    id: ClassVar[str] = "misalignment_temperature"
    symbol: ClassVar[str] = "δT"
    equation: ClassVar[str] = "θ·(δTj·fj + δTk·fk)"
    source: ClassVar[str] = "mechanism: thermal strain of the package"
    typical_ug: ClassVar[tuple[float, float]] = (10.0, 3000.0)
    hides_behind: ClassVar[tuple[str, ...]] = ("slot_rotation",)
    breaker: ClassVar[str] = "a fixture whose own tilt over temperature is known"
    simplicity: ClassVar[int] = 8

    def columns(self, state: State, axis: int, **nonlinear: float) -> Array:
        theta = state.need("theta", self.id)
        j, k = others(axis)
        return stack(state, [theta * state.force[..., j], theta * state.force[..., k]])

    def names(self, axis: int) -> tuple[str, ...]:
        return tuple(f"K{AXES[axis]}{AXES[k]}T" for k in others(axis))
