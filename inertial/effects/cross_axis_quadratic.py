from inertial.effects.base import AXES, Array, SensorEffect, others, stack
from inertial.state import State


class CrossAxisQuadratic(SensorEffect):
    """Quadratic response to specific force across the axis."""

    id = "cross_axis_quadratic"
    symbol = "Kpp, Koo, Kpo"
    equation = "Kpp·fp² + Koo·fo² + Kpo·fp·fo"
    source = "IEEE Std 1293-1998, model equation"
    typical_ug = (5.0, 500.0)
    hides_behind = ("bias", "second_order")
    breaker = "general directions; K2 + Kpp + Koo as a sum is identical with the bias"
    simplicity = 18
    vanishing = 1e-3

    def columns(self, state: State, axis: int, **nonlinear: float) -> Array:
        f, (j, k) = state.force, others(axis)
        return stack(state, [f[..., j] ** 2, f[..., k] ** 2, f[..., j] * f[..., k]])

    def names(self, axis: int) -> tuple[str, ...]:
        j, k = others(axis)
        return f"K{AXES[j]}{AXES[j]}", f"K{AXES[k]}{AXES[k]}", f"K{AXES[j]}*{AXES[k]}"
