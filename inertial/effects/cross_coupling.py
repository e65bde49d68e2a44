from inertial.effects.base import AXES, Array, SensorEffect, others, stack
from inertial.state import State


class CrossCoupling(SensorEffect):
    """Product of the specific force along the axis with that across it: a pendulum that tips."""

    id = "cross_coupling"
    symbol = "Kip, Kio"
    equation = "Kip·fi·fp + Kio·fi·fo"
    source = "IEEE Std 1293-1998, model equation"
    typical_ug = (5.0, 1000.0)
    breaker = "edges and general directions; β off the multiples of 90°, where fx·fy is zero"
    simplicity = 15
    vanishing = 1e-3

    def columns(self, state: State, axis: int, **nonlinear: float) -> Array:
        f, (j, k) = state.force, others(axis)
        return stack(state, [f[..., axis] * f[..., j], f[..., axis] * f[..., k]])

    def names(self, axis: int) -> tuple[str, ...]:
        return tuple(f"K{AXES[axis]}*{AXES[k]}" for k in others(axis))
