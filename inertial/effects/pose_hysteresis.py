import numpy as np

from inertial import operators
from inertial.effects.base import Array, Nonlinear, SensorEffect, stack
from inertial.state import State


class PoseHysteresis(SensorEffect):
    """Output that remembers from which side a specific force was reached: for good, or until the next move."""

    id = "pose_hysteresis"
    symbol = "kP"
    equation = "kP·h(fi), h the play operator of half width w; or kP·tanh(Δfi/w), where each move wipes the last"
    coefficients = ("kP",)
    source = "Visintin, Differential Models of Hysteresis; mechanism: friction or charging of the pickoff"
    typical_ug = (5.0, 1000.0)
    hides_behind = ("backlash", "bias_asymmetry")
    breaker = "the same poses from both sides"
    simplicity = 33
    memory = True
    nonlinear = (
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
