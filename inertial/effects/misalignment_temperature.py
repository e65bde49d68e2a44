from inertial.effects.base import AXES, Array, SensorEffect, others, stack
from inertial.state import State


class MisalignmentTemperature(SensorEffect):
    """Axes that tilt with temperature."""

    id = "misalignment_temperature"
    symbol = "δT"
    equation = "θ·(δTj·fj + δTk·fk)"
    source = "mechanism: thermal strain of the package"
    typical_ug = (10.0, 3000.0)
    hides_behind = ("slot_rotation",)
    breaker = "a fixture whose own tilt over temperature is known"
    simplicity = 8

    def columns(self, state: State, axis: int, **nonlinear: float) -> Array:
        theta = state.need("theta", self.id)
        j, k = others(axis)
        return stack(state, [theta * state.force[..., j], theta * state.force[..., k]])

    def names(self, axis: int) -> tuple[str, ...]:
        return tuple(f"K{AXES[axis]}{AXES[k]}T" for k in others(axis))
