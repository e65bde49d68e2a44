"""Bias that drifts with the logarithm of the time since power-on."""

from typing import ClassVar

import numpy as np

from inertial.effects.base import Array, Nonlinear, SensorEffect, stack
from inertial.state import State


class AgingLog(SensorEffect):
    """Bias that drifts with the logarithm of the time since power-on."""

    id: ClassVar[str] = "aging_log"
    symbol: ClassVar[str] = "kl"
    equation: ClassVar[str] = "kl·ln(1 + u/τ)"
    source: ClassVar[str] = "mechanism: thermally activated relaxation with a spread of barriers"
    typical_ug: ClassVar[tuple[float, float]] = (1.0, 1000.0)
    hides_behind: ClassVar[tuple[str, ...]] = ("warm_up", "aging_linear")
    breaker: ClassVar[str] = "a long stay at constant temperature after power-on"
    simplicity: ClassVar[int] = 29
    nonlinear: ClassVar[tuple[Nonlinear, ...]] = (Nonlinear("tau", "s", 30.0, 36000.0, "log", 8),)

    def columns(self, state: State, axis: int, *, tau: float, **nonlinear: float) -> Array:
        del axis, nonlinear
        since = state.time - state.time[..., :1] if state.since_power is None else state.since_power
        return stack(state, [np.log1p(since / tau)])

    def names(self, axis: int) -> tuple[str, ...]:
        del axis
        return ("kl",)
