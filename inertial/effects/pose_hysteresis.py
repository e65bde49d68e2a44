from typing import ClassVar

import numpy as np

from inertial import operators
from inertial.effects.base import Array, Nonlinear, SensorEffect, stack
from inertial.state import State


class PoseHysteresis(SensorEffect):
    """Output that remembers from which side a specific force was reached: for good, or until the next move."""

    id: ClassVar[str] = "pose_hysteresis"
    symbol: ClassVar[str] = "kP"
    equation: ClassVar[str] = (
        "kP·h(fi), h the play operator of half width w; or kP·tanh(Δfi/w), where each move wipes the last"
    )
    coefficients: ClassVar[tuple[str, ...]] = ("kP",)
    source: ClassVar[str] = (
        "Visintin, Differential Models of Hysteresis; mechanism: friction or charging of the pickoff"
    )
    typical_ug: ClassVar[tuple[float, float]] = (5.0, 1000.0)
    hides_behind: ClassVar[tuple[str, ...]] = ("backlash", "bias_asymmetry")
    breaker: ClassVar[str] = "the same poses from both sides"
    simplicity: ClassVar[int] = 33
    memory: ClassVar[bool] = True
    nonlinear: ClassVar[tuple[Nonlinear, ...]] = (
        Nonlinear("half_width", "g", 0.02, 1.0, "log", 6),
        Nonlinear("kept", "1", 0.0, 1.0, choices=(0.0, 1.0)),
    )

    def columns(self, state: State, axis: int, *, half_width: float, kept: float, **nonlinear: float) -> Array:
        if not kept:
            return stack(state, [np.tanh(state.force_step[..., axis] / half_width)])
        inside = state.remember((self.id, axis, half_width), lambda: operators.play(state.force[..., axis], half_width))
        return stack(state, [inside])

    def start_columns(self, state: State, axis: int, *, half_width: float, kept: float, **nonlinear: float) -> Array:
        first = np.zeros(state.time.shape)
        first[..., 0] = 1.0
        return stack(state, [operators.play_memory(state.force[..., axis], half_width) if kept else first])
