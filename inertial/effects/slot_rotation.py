from inertial.effects.base import AXES, Array, SensorEffect, others, stack
from inertial.state import State


class SlotRotation(SensorEffect):
    """Rotation of a slot of the fixture, the same in every run."""

    id = "slot_rotation"
    symbol = "ρ"
    equation = "f + f×ρ"
    source = "geometry of the fixture"
    typical_ug = (100.0, 20000.0)
    hides_behind = ("misalignment",)
    breaker = "the same unit in another slot: for one unit in one slot it is the misalignment, exactly"
    simplicity = 38
    scope = "slot"

    def columns(self, state: State, axis: int, **nonlinear: float) -> Array:
        j, k = others(axis)
        return stack(state, [state.force[..., k], -state.force[..., j]])

    def names(self, axis: int) -> tuple[str, ...]:
        return tuple(f"rho_{AXES[k]}" for k in others(axis))
