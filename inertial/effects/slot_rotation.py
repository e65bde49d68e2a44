from typing import ClassVar

from inertial.effects.base import AXES, Array, Scope, SensorEffect, others, stack
from inertial.state import State


class SlotRotation(SensorEffect):
    """Rotation of a slot of the fixture, the same in every run."""

    id: ClassVar[str] = "slot_rotation"
    symbol: ClassVar[str] = "ρ"
    equation: ClassVar[str] = "f + f×ρ"
    source: ClassVar[str] = "geometry of the fixture"
    typical_ug: ClassVar[tuple[float, float]] = (100.0, 20000.0)
    hides_behind: ClassVar[tuple[str, ...]] = ("misalignment",)
    breaker: ClassVar[str] = "the same unit in another slot: for one unit in one slot it is the misalignment, exactly"
    simplicity: ClassVar[int] = 38
    scope: ClassVar[Scope] = "slot"

    def columns(self, state: State, axis: int, **nonlinear: float) -> Array:
        j, k = others(axis)
        return stack(state, [state.force[..., k], -state.force[..., j]])

    def names(self, axis: int) -> tuple[str, ...]:
        return tuple(f"rho_{AXES[k]}" for k in others(axis))
