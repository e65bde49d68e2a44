"""Output that remembers from which side a specific force was reached."""

from typing import ClassVar

from inertial import operators
from inertial.effects.base import Array, Nonlinear, SensorEffect, stack
from inertial.state import State


class PoseHysteresis(SensorEffect):
    """Output that remembers from which side a specific force was reached."""

    id: ClassVar[str] = "pose_hysteresis"
    symbol: ClassVar[str] = "kP"
    equation: ClassVar[str] = "kP·h(fi), h the play operator of half width w"
    source: ClassVar[str] = (
        "Visintin, Differential Models of Hysteresis; mechanism: friction or charging of the pickoff"
    )
    typical_ug: ClassVar[tuple[float, float]] = (5.0, 1000.0)
    hides_behind: ClassVar[tuple[str, ...]] = ("backlash", "bias_asymmetry")
    breaker: ClassVar[str] = "the same poses from both sides"
    simplicity: ClassVar[int] = 33
    nonlinear: ClassVar[tuple[Nonlinear, ...]] = (Nonlinear("half_width", "g", 0.02, 1.0, "log", 6),)

    def columns(self, state: State, axis: int, *, half_width: float, **nonlinear: float) -> Array:
        del nonlinear
        inside = state.remember((self.id, axis, half_width), lambda: operators.play(state.force[..., axis], half_width))
        return stack(state, [inside])

    def start_columns(self, state: State, axis: int, *, half_width: float, **nonlinear: float) -> Array:
        del nonlinear
        return stack(state, [operators.play_memory(state.force[..., axis], half_width)])

    def names(self, axis: int) -> tuple[str, ...]:
        del axis
        return ("kP",)
