from collections.abc import Callable
from dataclasses import replace

import numpy as np

from inertial import operators
from inertial.effects.base import Array, Nonlinear, SensorEffect, stack
from inertial.state import State

UNTIL_MOVE, FROM_POSE, ON_THE_WAY = 0.0, 1.0, 2.0
"""What changes the side that is kept: every move wipes it; only the force of a pose; the force on the way between poses too."""


class PoseHysteresis(SensorEffect):
    """Output that remembers from which side a specific force was reached: for good, or until the next move."""

    id = "pose_hysteresis"
    symbol = "kP"
    equation = (
        "kP·h(fi), h the play of half width w, from pose to pose or over the way; or kP·tanh(Δfi/w) until the next move"
    )
    coefficients = ("kP",)
    source = "Visintin, Differential Models of Hysteresis; mechanism: friction or charging of the pickoff"
    typical_ug = (5.0, 1000.0)
    hides_behind = ("backlash", "bias_asymmetry")
    breaker = "the same poses from both sides"
    simplicity = 33
    memory = True
    nonlinear = (
        Nonlinear("half_width", "g", 0.02, 1.0, "log", 6),
        Nonlinear("kept", "1", 0.0, 2.0, choices=(UNTIL_MOVE, FROM_POSE, ON_THE_WAY)),
    )

    def parameters(self, state: State) -> tuple[Nonlinear, ...]:
        width, kept = self.nonlinear
        return self.nonlinear if state.way is not None else (width, replace(kept, choices=(UNTIL_MOVE, FROM_POSE)))

    def columns(self, state: State, axis: int, *, half_width: float, kept: float, **nonlinear: float) -> Array:
        if kept == UNTIL_MOVE:
            return stack(state, [np.tanh(state.force_step[..., axis] / half_width)])
        inside = state.remember(
            (self.id, axis, half_width, kept),
            lambda: _at_dwells(lambda signal: _from_zero(signal, half_width), state, axis, kept),
        )
        return stack(state, [inside])

    def start_columns(self, state: State, axis: int, *, half_width: float, kept: float, **nonlinear: float) -> Array:
        if kept == UNTIL_MOVE:
            first = np.zeros(state.time.shape)
            first[..., 0] = 1.0
            return stack(state, [first])
        # the side from which the first pose was reached is not recorded: the table came from anywhere
        memory = _at_dwells(lambda signal: operators.play_memory(signal, half_width), state, axis, kept)
        return stack(state, [memory])


def _at_dwells(operator: Callable[[Array], Array], state: State, axis: int, kept: float) -> Array:
    """An operator with memory over the force along an axis, from pose to pose or over the way, at the dwells, (..., n)."""
    way = state.way if kept == ON_THE_WAY else None
    course = state.force[..., None, axis] if way is None else way[..., axis]
    values = operator(course.reshape(*course.shape[:-2], -1))
    return values.reshape(course.shape)[..., -1]


def _from_zero(signal: Array, width: float) -> Array:
    """The play of a signal before which what is dragged is at zero, as far as the width lets it (Visintin's initial state)."""
    return operators.play(np.concatenate([np.zeros_like(signal[..., :1]), signal], axis=-1), width)[..., 1:]
