from typing import ClassVar

from inertial.effects.base import Array, SensorEffect, stack
from inertial.state import State


class AgingLinear(SensorEffect):
    """Bias that drifts at a constant rate."""

    id: ClassVar[str] = "aging_linear"
    symbol: ClassVar[str] = "kt"
    equation: ClassVar[str] = "kt·t"
    coefficients: ClassVar[tuple[str, ...]] = ("kt",)
    source: ClassVar[str] = "mechanism: relaxation of stress; drift term of IEEE Std 1293-1998"
    typical_ug: ClassVar[tuple[float, float]] = (1.0, 1000.0)
    per: ClassVar[tuple[str, ...]] = ("h",)
    hides_behind: ClassVar[tuple[str, ...]] = ("bias_temperature", "thermal_hysteresis", "warm_up")
    breaker: ClassVar[str] = "a reference pose measured again and again; soaks in mixed order"
    same_on_axes: ClassVar[bool] = True
    simplicity: ClassVar[int] = 27

    def columns(self, state: State, axis: int, **nonlinear: float) -> Array:
        hours = state.time / 3600.0
        return stack(state, [hours])
